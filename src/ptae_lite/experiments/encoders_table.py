"""How the table of `encoders` is read: equal lengths side by side, and which levelled off."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from ptae_lite.errors import ConfigError
from ptae_lite.experiments import encoders

EQUAL = {  # presentations of each eye in the two fair comparisons
    "images seen": encoders.EQUAL_PRESENTATIONS,
    "compute": encoders.EQUAL_COMPUTE,
}


def of(rows: pd.DataFrame, names, split: str = "test") -> pd.DataFrame:
    """The rows of these eyes, in this order, with presentations in thousands and TFLOP."""
    own = rows[rows["split"] == split]
    found = pd.concat([own[own["eye"] == name] for name in names])
    return found.assign(thousands=found["presentations"] / 1e3, tflop=found["gflop"] / 1e3)


def at(rows: pd.DataFrame, lengths: Mapping[str, int], split: str = "test") -> pd.DataFrame:
    """The rows of eyes at the given presentations. Raises `ConfigError` where there is none."""
    own = of(rows, lengths, split)
    found = own[own["presentations"] == own["eye"].map(lengths)]
    for eye in lengths:
        if eye not in set(found["eye"]):
            raise ConfigError(f"the table has no {eye} of {lengths[eye]} presentations")
    return found


def summary(rows: pd.DataFrame, measures: Mapping[str, tuple[str, int]]) -> pd.DataFrame:
    """Mean over the seeds with the lowest and the highest, a line for each eye, in order.

    `measures` says of a column its label and how many digits to show.
    """
    table: dict = {}
    for eye, own in rows.groupby("eye", sort=False):
        table[eye] = {"seeds": str(own["seed"].nunique())}
        for column, (label, digits) in measures.items():
            of_seeds = (own[column].agg(how) for how in ("min", "mean", "max"))
            low, mean, high = (f"{value:.{digits}f}" for value in of_seeds)
            table[eye][label] = mean if low == high else f"{mean} ({low}-{high})"
    return pd.DataFrame(table).T


ERRORS, COLOURS = ("pixel_error", "first_place_mm"), ("first_both", "last_both")


def changes(rows: pd.DataFrame) -> pd.DataFrame:
    """What the last doubling changed, by eye and presentations, on held-out patterns.

    Against the nearest training of half the length or less, of the same seed, and of the same
    device where there is one; means over the pairs of a seed, then over the seeds. Errors of the
    drawing and of the places of first frames in percent, both colours of first frames and of last
    ones in points. Lengths without a shorter one beside them are left out.
    """
    measures, found = [*ERRORS, *COLOURS], {}
    own = rows[(rows["split"] == "held_out") & rows["eye"].isin(encoders.CAES)]
    for eye, runs in own.groupby("eye", sort=False):
        for presentations, now in runs.groupby("presentations"):
            shorter = runs["presentations"][runs["presentations"].between(1, presentations / 2)]
            before = runs[runs["presentations"] == shorter.max()]
            pairs = now.merge(before, on="seed", suffixes=("", " before"))
            same = pairs["device"] == pairs["device before"]
            pairs = pairs[same | ~same.groupby(pairs["seed"]).transform("any")]
            if len(pairs):
                mean = pairs.groupby("seed").mean(numeric_only=True).mean()
                short = mean[[f"{name} before" for name in measures]].set_axis(measures)
                moved = mean[measures] - short
                moved[[*ERRORS]] *= 100 / short[[*ERRORS]]
                found[eye, presentations] = moved
    lengths = pd.MultiIndex.from_tuples(found, names=["eye", "presentations"])
    return pd.DataFrame(list(found.values()), lengths, measures)


def levelled(rows: pd.DataFrame) -> pd.Series:
    """Which of the lengths in `changes` have levelled off.

    The rule: both errors changed by less than a tenth, both colours by less than three points.
    """
    size = changes(rows).abs()
    return (size[[*ERRORS]] < 10).all(axis=1) & (size[[*COLOURS]] < 3).all(axis=1)

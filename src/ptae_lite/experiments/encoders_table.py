"""How to read the table of `encoders`: rows of equal lengths, and which trainings converged."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from ptae_lite.errors import ConfigError
from ptae_lite.experiments import encoders

EQUAL = {  # images seen by each encoder in the two fair comparisons
    "images seen": encoders.EQUAL_SAMPLES_SEEN,
    "compute": encoders.EQUAL_COMPUTE,
}


def of(rows: pd.DataFrame, names, split: str = "test") -> pd.DataFrame:
    """The rows of these encoders, in this order.

    The new columns are `thousands` of images seen and `tflop`.
    """
    own = rows[rows["split"] == split]
    found = pd.concat([own[own["encoder"] == name] for name in names])
    return found.assign(thousands=found["samples_seen"] / 1e3, tflop=found["gflop"] / 1e3)


def at(rows: pd.DataFrame, lengths: Mapping[str, int], split: str = "test") -> pd.DataFrame:
    """The rows of encoders at the given numbers of images seen.

    Raises:
        ConfigError: the table lacks one.
    """
    own = of(rows, lengths, split)
    found = own[own["samples_seen"] == own["encoder"].map(lengths)]
    for encoder in lengths:
        if encoder not in set(found["encoder"]):
            raise ConfigError(f"the table has no {encoder} of {lengths[encoder]} presentations")
    return found


def summary(rows: pd.DataFrame, measures: Mapping[str, tuple[str, int]]) -> pd.DataFrame:
    """Mean over the seeds with the lowest and the highest, a row for each encoder, in order.

    Args:
        measures: by column of the table, its label and the number of digits.
    """
    table: dict = {}
    for encoder, own in rows.groupby("encoder", sort=False):
        table[encoder] = {"seeds": str(own["seed"].nunique())}
        for column, (label, digits) in measures.items():
            of_seeds = (own[column].agg(how) for how in ("min", "mean", "max"))
            low, mean, high = (f"{value:.{digits}f}" for value in of_seeds)
            table[encoder][label] = mean if low == high else f"{mean} ({low}-{high})"
    return pd.DataFrame(table).T


ERRORS, COLOURS = ("pixel_error", "first_place_mm"), ("first_both", "last_both")


def changes(rows: pd.DataFrame) -> pd.DataFrame:
    """What the last doubling of the images seen changed, on held-out patterns.

    Each training is compared with the nearest one of half its length or less, of the same seed, and
    of the same device if there is one. Values are means over the pairs of a seed, then over the
    seeds. Errors of the reconstruction and of the places in first frames change in percent. The
    accuracy of both colours in first and in last frames changes in points. A length without a
    shorter one is left out.
    """
    measures, found = [*ERRORS, *COLOURS], {}
    own = rows[(rows["split"] == "held_out") & rows["encoder"].isin(encoders.CAES)]
    for encoder, runs in own.groupby("encoder", sort=False):
        for samples_seen, now in runs.groupby("samples_seen"):
            shorter = runs["samples_seen"][runs["samples_seen"].between(1, samples_seen / 2)]
            before = runs[runs["samples_seen"] == shorter.max()]
            pairs = now.merge(before, on="seed", suffixes=("", " before"))
            same = pairs["device"] == pairs["device before"]
            pairs = pairs[same | ~same.groupby(pairs["seed"]).transform("any")]
            if len(pairs):
                mean = pairs.groupby("seed").mean(numeric_only=True).mean()
                short = mean[[f"{name} before" for name in measures]].set_axis(measures)
                moved = mean[measures] - short
                moved[[*ERRORS]] *= 100 / short[[*ERRORS]]
                found[encoder, samples_seen] = moved
    lengths = pd.MultiIndex.from_tuples(found, names=["encoder", "samples_seen"])
    return pd.DataFrame(list(found.values()), lengths, measures)


def converged(rows: pd.DataFrame) -> pd.Series:
    """Which of the lengths in `changes` have converged.

    The rule: both errors changed by less than a tenth, and both accuracies by less than three
    points.
    """
    size = changes(rows).abs()
    return (size[[*ERRORS]] < 10).all(axis=1) & (size[[*COLOURS]] < 3).all(axis=1)

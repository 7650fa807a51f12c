"""How a claim of the paper is read from our tables.

A claim takes its values out of `Tables`, one for each training. So the stored tables and those of
a single run are read in the same way. A claim with a number of the paper holds in the direction in
which the text reads it (`reported.ClaimTest.reads`): a model that does better than a number to its
credit keeps to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.experiments import encoders_table, family, incongruence_table
from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT
from ptae_lite.experiments.supervision import REGULAR
from ptae_lite.paper import reported

TINY = 2  # percent: with so few labels a longer training counts as well
MARGIN = {"%": 2.0, "% NRMSE": 0.5}  # ours may be so much worse than a number and keep to it
SEPARATED, PLAIN = "separated 3x10", "plain 10"
IN_WORDS = "in words"  # what stands in place of the paper's number where it has none


class Tables(NamedTuple):
    """What claims are read from, all of one data set; a single run has only what it made."""

    family: pd.DataFrame
    curves: pd.DataFrame
    supervision: pd.DataFrame
    incongruence: pd.DataFrame
    encoders: pd.DataFrame


@dataclass(frozen=True)
class ClaimTest:
    """A sentence of the paper in our words, and how it is held against our tables."""

    group: str
    says: str
    paper: str  # its number, as the text puts it
    values: Callable[[Tables], Sequence[float]] = lambda tables: []
    holds: Callable[[np.ndarray, Tables], bool] | None = None  # None: nothing can tell
    unit: str = "%"
    chapter: str = "03_crossmodal_transformer"
    heading: str = "What it can do"
    caveat: str = ""  # said when it holds; a claim that holds with a caveat has one
    remark: str = ""  # said when it does not hold, or cannot be tested
    trained: bool = True  # a value is a training, and one of them is little
    # What a training of few labels gave, and one eight times as long, by seed. Where that brings
    # the claim nearer, it is not said that it does not hold.
    longer: Callable[[Tables], tuple[pd.Series, pd.Series]] | None = None
    upwards: bool = True  # a larger value is nearer to the claim

    @property
    def digits(self) -> int:
        return 2 if "NRMSE" in self.unit or "million" in self.unit else 1


def number(says: str, claim: reported.PaperNumber, values, unit="%", **more) -> ClaimTest:
    """A claim with a number of the paper, held against the median of the trainings."""

    def holds(found, _):
        if claim.reads == reported.AT_LEAST:
            return np.median(found) >= claim.value - MARGIN[unit]
        return np.median(found) <= claim.value + MARGIN[unit]

    upwards = claim.reads == reported.AT_LEAST
    return ClaimTest(says=says, paper=claim.says, values=values, holds=holds, unit=unit,
                 upwards=upwards, **more)  # fmt: skip


def always(found, _) -> bool:
    """Whether a difference is on the claimed side with each seed."""
    return bool((found > 0).all())


def of_family(column: str, variant: str = "PTAE"):
    def values(tables: Tables):
        rows = tables.family
        return rows[rows["variant"] == variant][column] if len(rows) else []

    return values


def lead(claim: str, column: str):
    """By how much the first variant of one of `family.CLAIMS` is better, seed by seed."""
    first, second = family.CLAIMS[claim]
    sign = 1 if column.endswith("accuracy") else -1

    def values(tables: Tables):
        if not {first, second} <= set(tables.family.get("variant", ())):
            return []
        scores = tables.family.pivot(index="seed", columns="variant", values=column)
        return (sign * (scores[first] - scores[second])).dropna()

    return values


def clearly(claim: str, expected: str, *columns: str):
    """Whether `family.clearly_better` names the expected variant, or neither, in all columns."""
    pair = family.CLAIMS[claim]
    return lambda _, tables: all(
        family.clearly_better(tables.family, *pair, column) == expected for column in columns
    )


def ratio_of_updates(tables: Tables):
    """PTAE's updates to stay above 75 % describe, as a share of PGAE's, by seed."""
    if tables.curves.empty:
        return []
    found = family.updates_to(tables.curves[tables.curves["variant"].isin(["PTAE", "PGAE"])], 75)
    updates = found.pivot(index="seed", columns="variant", values="updates")
    return 100 * updates["PTAE"] / updates["PGAE"]


def with_labels(model: str, column: str, mode: str, share: float, variant: str | None = None):
    """The trainings with a share of the labels, by seed; half of each batch where samples are few.

    A training with 1 or 2 % of the iterations shows a label too seldom to judge, so the long one
    counts there.
    """
    chosen = "balanced" if mode == "samples" else "long" if share <= TINY else "paper"

    def values(tables: Tables) -> pd.Series:
        rows = tables.supervision
        if rows.empty:
            return pd.Series(dtype=float)
        same = (rows["model"] == model) & (rows["mode"] == mode) & (rows["share"] == share)
        regular = rows["share"] == REGULAR[mode]
        same &= regular | (rows["variant"] == (variant or chosen))
        return rows[same].set_index("seed")[column]

    return values


def both_lengths(read, share: float):
    """What `read(variant)` gives of a training and of the long one, with the seeds of both.

    Labels are shown to both as in the paper. None where a share is not tiny: there is no long one.
    """

    def values(tables: Tables) -> tuple[pd.Series, pd.Series]:
        return read("paper")(tables).align(read("long")(tables), join="inner")

    return values if share <= TINY else None


def under(signal: str, conflicts: int, place: str | None = None):
    """Scores under so many conflicts, the mean over the choices of aspects, by seed."""
    place = (place or EXTRA_INPUT[signal]) if conflicts else "none"
    column = "accuracy" if signal in ANSWERS_WORDS else "nrmse"

    def values(tables: Tables):
        rows = tables.incongruence
        if rows.empty:
            return []
        same = (rows["signal"] == signal) & (rows["conflict_in"] == place)
        same &= (rows["model"] == "ptae") & (rows["conflicts"] == conflicts)
        return rows[same].groupby("seed")[column].mean()

    return values


def more_harm(one: str, other: str, model: str = "ptae"):
    """How much more three conflicts cost in one signal than in the other, by seed."""

    def values(tables: Tables):
        rows = tables.incongruence
        if rows.empty or model not in set(rows["model"]):
            return []
        paid = incongruence_table.damage(rows[rows["model"] == model])
        paid = paid.pivot(index="seed", columns="signal", values="conflict")
        return paid[one] - paid[other]

    return values


def part_of_harm(signal: str, place: str):
    """What three conflicts in one part of the clip cost, in percent of those in both."""

    def values(tables: Tables):
        calm, part, both = (
            under(signal, count, where)(tables)
            for count, where in ((0, None), (3, place), (3, "action"))
        )
        return 100 * (part - calm) / (both - calm) if len(calm) else []

    return values


def plateau(model: str, column: str, *shares: float):
    """How far the means of some shares of the samples lie above the regular trainings'."""

    def values(tables: Tables):
        regular = with_labels(model, column, "samples", 100)(tables)
        found = [with_labels(model, column, "samples", share)(tables) for share in shares]
        return [np.mean(f) - np.mean(regular) for f in found] if all(map(len, found)) else []

    return values


def ahead(column: str, mode: str, share: float, variant: str | None = None):
    """By how much PTAE is ahead of PGAE with a share of the labels, seed by seed."""

    def values(tables: Tables) -> pd.Series:
        one, other = (
            with_labels(m, column, mode, share, variant)(tables) for m in ("ptae", "pgae")
        )
        return (one - other).dropna()

    return values


def fall(model: str, column: str, mode: str, before: float, share: float):
    """How much lower a share of the labels is than the share before it, seed by seed."""

    def values(tables: Tables) -> pd.Series:
        high, low = (with_labels(model, column, mode, s)(tables) for s in (before, share))
        return (high - low).dropna()

    return values


def channels(tables: Tables):
    """Both colours of first frames: separated channels before one network, equally many images."""
    if tables.encoders.empty:
        return []
    same = encoders_table.at(tables.encoders, encoders_table.EQUAL["images seen"])
    scores = same.pivot(index="seed", columns="encoder", values="first_both")
    return scores[SEPARATED] - scores[PLAIN]

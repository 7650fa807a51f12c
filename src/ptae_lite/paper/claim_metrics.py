"""How our tables are compared with a claim of the paper.

A claim takes its values from `Tables`, one for each training. So the stored tables and those of a
single run are read in the same way. A claim with a number of the paper holds if ours lies on the
right side of it (`reported.PaperNumber.reads`): a model that is better than the number also agrees
with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.experiments import encoders_table, family, incongruence_table
from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT
from ptae_lite.experiments.supervision_grid import REGULAR
from ptae_lite.paper import reported

MARGIN = {"%": 2.0, "% NRMSE": 0.5}  # ours agrees with a number if it is worse by this or less
# Variants of few iterations, the first that is there counts: the recipe that was better on held-out
# patterns, then the longest.
BEST_FIRST = ("adam-paper-length", "adam-long", "adam", "paper-length", "long", "paper")
SEPARATED, PLAIN = "separated 3x10", "plain 10"
IN_WORDS = "in words"  # stands for the paper's number if it gives none


class Tables(NamedTuple):
    """The tables of one data set from which claims are read. A single run has only some of them."""

    family: pd.DataFrame
    curves: pd.DataFrame
    supervision: pd.DataFrame
    incongruence: pd.DataFrame
    encoders: pd.DataFrame


class Notes(NamedTuple):
    """What to add to a verdict: `caveat` if the claim holds, `remark` if it does not."""

    caveat: str = ""
    remark: str = ""


@dataclass(frozen=True)
class ClaimTest:
    """A sentence of the paper in our words, and how our tables test it.

    Attributes:
        group: the part of the report card.
        says: the claim.
        paper: the paper's number, as the text puts it.
        values: our values, one for each training.
        holds: whether the claim holds for these values; None if nothing can tell.
        unit: of the values.
        chapter: the chapter that shows it.
        heading: the heading there.
        caveat: what to add if it holds on our recording. A claim that holds with a caveat has one.
        remark: what to add if it does not hold there, or cannot be tested.
        theirs: the same two, for the authors' data.
        trained: each value is a training, so a single value is weak evidence.
        number: the paper's number, if the claim has one.
    """

    group: str
    says: str
    paper: str
    values: Callable[[Tables], Sequence[float]] = lambda tables: []
    holds: Callable[[np.ndarray, Tables], bool] | None = None
    unit: str = "%"
    chapter: str = "03_crossmodal_transformer"
    heading: str = "What it can do"
    caveat: str = ""
    remark: str = ""
    theirs: Notes = Notes()
    trained: bool = True
    number: reported.PaperNumber | None = None

    @property
    def digits(self) -> int:
        """How many digits of its values are shown after the point."""
        return 2 if "NRMSE" in self.unit or "million" in self.unit else 1


def number(says: str, claim: reported.PaperNumber, values, unit="%", **more) -> ClaimTest:
    """A claim with a number of the paper. It is compared with the median of our trainings."""

    def holds(found, _):
        if claim.reads == reported.AT_LEAST:
            return np.median(found) >= claim.value - MARGIN[unit]
        return np.median(found) <= claim.value + MARGIN[unit]

    return ClaimTest(says=says, paper=claim.says, values=values, holds=holds, unit=unit,
                 number=claim, **more)  # fmt: skip


def always(found, _) -> bool:
    """Whether the values are above 0 with each seed."""
    return bool((found > 0).all())


def of_family(column: str, variant: str = "PTAE"):
    """Makes a function of `Tables`: a column of `family.csv` for one variant."""

    def values(tables: Tables):
        rows = tables.family
        return rows[rows["variant"] == variant][column] if len(rows) else []

    return values


def lead(claim: str, column: str):
    """Makes a function of `Tables`: how much better the first variant of a claim is, by seed.

    Args:
        claim: one of `family.CLAIMS`.
    """
    first, second = family.CLAIMS[claim]
    sign = 1 if column.endswith("accuracy") else -1

    def values(tables: Tables):
        if not {first, second} <= set(tables.family.get("variant", ())):
            return []
        scores = tables.family.pivot(index="seed", columns="variant", values=column)
        return (sign * (scores[first] - scores[second])).dropna()

    return values


def clearly(claim: str, expected: str, *columns: str):
    """Makes a test: does `family.clearly_better` give the `expected` answer in all columns?"""
    pair = family.CLAIMS[claim]
    return lambda _, tables: all(
        family.clearly_better(tables.family, *pair, column) == expected for column in columns
    )


def ratio_of_updates(tables: Tables):
    """Updates until PTAE stays above 75 % describe accuracy, in percent of PGAE's, by seed."""
    if tables.curves.empty:
        return []
    found = family.updates_to(tables.curves[tables.curves["variant"].isin(["PTAE", "PGAE"])], 75)
    updates = found.pivot(index="seed", columns="variant", values="updates")
    return (100 * updates["PTAE"] / updates["PGAE"]).dropna()


def with_labels(model: str, column: str, mode: str, share: float):
    """Makes a function of `Tables`: a score with a share of the labels, by seed.

    With few iterations, `BEST_FIRST` says which trainings count: in a short one labels may be too
    seldom to judge the share.
    """
    variants = ("paper",) if mode == "samples" else BEST_FIRST

    def values(tables: Tables) -> pd.Series:
        rows = tables.supervision
        if rows.empty:
            return pd.Series(dtype=float)
        rows = rows[(rows["model"] == model) & (rows["mode"] == mode) & (rows["share"] == share)]
        if share != REGULAR[mode]:
            there = [name for name in variants if name in set(rows["variant"])]
            rows = rows[rows["variant"].isin(there[:1])]
        return rows.set_index("seed")[column]

    return values


def under(signal: str, conflicts: int, place: str | None = None):
    """Makes a function of `Tables`: scores under `conflicts` conflicts, by seed.

    Each is the mean over the choices of aspects.
    """
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
    """Makes a function of `Tables`: how much more three conflicts harm one signal than another."""

    def values(tables: Tables):
        rows = tables.incongruence
        if rows.empty or model not in set(rows["model"]):
            return []
        paid = incongruence_table.damage(rows[rows["model"] == model])
        paid = paid.pivot(index="seed", columns="signal", values="conflict")
        return paid[one] - paid[other]

    return values


def part_of_harm(signal: str, place: str):
    """Makes a function of `Tables`: harm of conflicts in one part of the clip.

    It is the harm of three conflicts, in percent of the harm in both parts.
    """

    def values(tables: Tables):
        calm, part, both = (
            under(signal, count, where)(tables)
            for count, where in ((0, None), (3, place), (3, "action"))
        )
        return 100 * (part - calm) / (both - calm) if len(calm) else []

    return values


def plateau(model: str, column: str, *shares: float):
    """Makes a function of `Tables`: how far some shares lie above the regular training (means)."""

    def values(tables: Tables):
        regular = with_labels(model, column, "samples", 100)(tables)
        found = [with_labels(model, column, "samples", share)(tables) for share in shares]
        return [np.mean(f) - np.mean(regular) for f in found] if all(map(len, found)) else []

    return values


def ahead(column: str, mode: str, share: float):
    """Makes a function of `Tables`: how far PTAE is ahead of PGAE with a share of the labels."""

    def values(tables: Tables) -> pd.Series:
        one, other = (with_labels(m, column, mode, share)(tables) for m in ("ptae", "pgae"))
        return (one - other).dropna()

    return values


def fall(model: str, column: str, mode: str, before: float, share: float):
    """Makes a function of `Tables`: how much a score falls between two shares of the labels."""

    def values(tables: Tables) -> pd.Series:
        high, low = (with_labels(model, column, mode, s)(tables) for s in (before, share))
        return (high - low).dropna()

    return values


def channels(tables: Tables):
    """How much better separate channels show both colours of first frames than one network does.

    The values are points, by seed, after equally many images.
    """
    if tables.encoders.empty:
        return []
    same = encoders_table.at(tables.encoders, encoders_table.EQUAL["images seen"])
    scores = same.pivot(index="seed", columns="encoder", values="first_both")
    return scores[SEPARATED] - scores[PLAIN]

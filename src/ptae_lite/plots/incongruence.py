"""Figures of incongruence: the four signals by the number of conflicts, and what answers follow.

All are drawn from the table of `experiments.incongruence_table`. No model runs here.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ptae_lite.experiments.answer_source import SOURCES
from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT, PLACES
from ptae_lite.paper import reported
from ptae_lite.plots import style

SHOWN = ("describe", "repeat language", "repeat action", "execute")  # words above, motions below
LOOKS = {  # of a line of conflicts, by where they are
    "language": (style.BLUE, "-", "o"), "action": (style.BLUE, "-", "o"),
    "vision": (style.GREEN, "--", "s"), "proprioception": (style.RED, "-.", "v"),
}  # fmt: skip
CONTROLS = {"congruent": (style.ORANGE, "D"), "congruent_other": (style.PURPLE, "X")}
TWO_WAY = ("two-way attention", style.RED, "--", "s")
CONGRUENT = ("trained with extra input", style.GREEN, "-.", "^")
MODELS = {
    "ptae_adam": ("trained with Adam alone", style.BLUE, "-", "o"),
    "ptae": ("chapter 03's", style.PURPLE, ":", "D"),
    "ptae_two_way_adam": TWO_WAY, "ptae_two_way": TWO_WAY,
    "ptae_congruent_adam": CONGRUENT, "ptae_congruent": CONGRUENT,
}  # fmt: skip
FILLS = {  # of a bar, and its hatch
    "truth": (style.SKY, ""), "distractor": (style.RED, "///"), "mixture": (style.ORANGE, "..."),
    "neither": ("#DDDDDD", "xx"),
}  # fmt: skip


def score_name(signal: str) -> str:
    """The column with a signal's score: `accuracy` (high is good) or `nrmse` (low is good)."""
    return "accuracy" if signal in ANSWERS_WORDS else "nrmse"


def by_conflicts(table: pd.DataFrame, parts: bool = True) -> Figure:
    """One model's four signals by the number of conflicts.

    A point is the mean over choices of aspects and over seeds, and its bar goes from the lowest to
    the highest seed. Diamonds and crosses at zero are the congruent controls. Triangles are the
    numbers in the paper's text.

    Args:
        parts: draw the conflicts in one part of a clip as well.
    """
    figure, axes = plt.subplots(2, 2, figsize=(style.WIDTH, 5.0), sharex=True)
    for axis, signal in zip(axes.flat, SHOWN, strict=True):
        rows = table[table["signal"] == signal]
        for place in _places(signal, parts):
            colour, dash, mark = LOOKS[place]
            main = place == EXTRA_INPUT[signal]
            label = "conflict" if main else f"in {place} only"
            means = seed_means(rows, ["none", place] if main else [place])
            _bars(axis, means, colour, dash, mark, label, shift=0 if main else 0.06)
        for place, (colour, mark) in CONTROLS.items():
            label = "congruent" if place == "congruent" else "congruent, another"
            at = 0.12 * (1 + list(CONTROLS).index(place))
            _bars(axis, seed_means(rows, [place]), colour, "", mark, label, shift=at)
        numbers = reported.CONFLICTS[signal]
        axis.plot(list(numbers), [claim.value for claim in numbers.values()], "^", ms=9,
                  color=style.GREY, fillstyle="none", label="paper's text")  # fmt: skip
        axis.set_title(_title(signal))
        _scale(axis, signal)
    for axis in axes[-1]:
        axis.set(xlabel="conflicts", xticks=range(4))
    handles, labels = axes[1, 1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return style.closed(figure)


def _places(signal: str, parts: bool) -> tuple[str, ...]:
    """Where a signal's conflicts are: all of the extra input first, then its parts."""
    places = PLACES[EXTRA_INPUT[signal]]
    return places if parts else places[:1]


def _title(signal: str) -> str:
    """The signal, and what is false in it. On two lines, because a panel is narrow."""
    return f"{signal}\n(conflict in {EXTRA_INPUT[signal]})"


def seed_means(rows: pd.DataFrame, places: list[str]) -> pd.DataFrame:
    """Mean, lowest and highest seed of a signal's score, by the number of conflicts."""
    column = score_name(rows["signal"].iloc[0])
    chosen = rows[rows["conflict_in"].isin(places)]
    seeds = chosen.groupby(["conflicts", "seed"])[column].mean()
    return seeds.groupby("conflicts").agg(["mean", "min", "max"])


def _bars(axis, means, colour, dash, mark, label, shift=0.0) -> None:
    spread = [means["mean"] - means["min"], means["max"] - means["mean"]]
    axis.errorbar(means.index + shift, means["mean"], yerr=spread, color=colour, ls=dash or "none",
                  marker=mark, ms=5, capsize=3, lw=1.5, label=label)  # fmt: skip


def _scale(axis, signal: str) -> None:
    good = signal in ANSWERS_WORDS
    axis.set(ylabel="accuracy, %" if good else "NRMSE, %", ylim=(-4, 106) if good else (0, None))


def compared(table: pd.DataFrame) -> Figure:
    """The four signals with each model: regular input, the congruent control, 1 to 3 conflicts."""
    figure, axes = plt.subplots(2, 2, figsize=(style.WIDTH, 5.0), sharex=True)
    for axis, signal in zip(axes.flat, SHOWN, strict=True):
        there = [name for name in MODELS if name in set(table["model"])]
        for k, name in enumerate(there):
            label, colour, dash, mark = MODELS[name]
            rows = table[(table["model"] == name) & (table["signal"] == signal)]
            places = [["none"], ["congruent"], [EXTRA_INPUT[signal]]]
            means = pd.concat([seed_means(rows, place) for place in places])
            means.index = range(len(means))
            _bars(axis, means, colour, dash, mark, label, shift=0.08 * (k - 1))
        axis.set_title(_title(signal))
        _scale(axis, signal)
    for axis in axes[-1]:
        axis.set_xticks(range(5), ["none", "\ntrue", "1", "2", "3"])
        axis.set_xlabel("extra input; conflicts")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)


def followed(table: pd.DataFrame, parts: bool = True) -> Figure:
    """What one model's answers follow: a bar for each condition, means over choices and seeds.

    Args:
        parts: draw the conflicts in one part of a clip as well.
    """
    rows = {signal: _conditions(signal, parts) for signal in SHOWN}
    heights = [max(len(rows[s]) for s in SHOWN[:2]), max(len(rows[s]) for s in SHOWN[2:])]
    size = (style.WIDTH, 1.4 + 0.21 * sum(heights))
    figure, axes = plt.subplots(
        2, 2, figsize=size, sharex=True, gridspec_kw={"height_ratios": heights}
    )
    for axis, signal in zip(axes.flat, SHOWN, strict=True):
        of = table[table["signal"] == signal]
        names = list(rows[signal])
        left = np.zeros(len(names))
        values = [of[(of["conflict_in"] == place) & (of["conflicts"] == count)]
                  for place, count in rows[signal].values()]  # fmt: skip
        for name in SOURCES:
            width = np.array([part[name].mean() for part in values])
            colour, hatch = FILLS[name]
            axis.barh(names, width, left=left, color=colour, hatch=hatch, edgecolor="white",
                      lw=0.4, label=name)  # fmt: skip
            left += width
        axis.invert_yaxis()
        axis.grid(axis="y", visible=False)
        axis.set(title=signal, xlim=(0, 100))
    for axis in axes[-1]:
        axis.set_xlabel("% of the answers")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return style.closed(figure)


def _conditions(signal: str, parts: bool) -> dict[str, tuple[str, int]]:
    """The bars of a signal, by name: where the conflict is, and how many."""
    rows = {"regular": ("none", 0), "congruent": ("congruent", 0),
            "another": ("congruent_other", 0)}  # fmt: skip
    if signal == "execute":
        rows["blank"] = ("blank", 0)
    for place in _places(signal, parts):
        short = "" if place == EXTRA_INPUT[signal] else f" {place[:6]}{'.' if place[6:] else ''}"
        rows |= {f"{n}{short or (' conflict' if n == 1 else ' conflicts')}": (place, n)
                 for n in (1, 2, 3)}  # fmt: skip
    return rows

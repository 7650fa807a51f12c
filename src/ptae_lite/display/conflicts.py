"""Incongruence to look at: the four signals by the number of conflicts, and their panel.

Everything is drawn from tables of `studies.incongruence` and `studies.stories`, stored or just
made; no model is asked here.
"""

from __future__ import annotations

from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ptae_lite import published
from ptae_lite.display import style
from ptae_lite.display.panels import Panel
from ptae_lite.robot.arm import JOINT_NAMES
from ptae_lite.studies.incongruence import ANSWERS_WORDS, EXTRA_INPUT
from ptae_lite.studies.stories import Stories

LOOKS = ((style.BLUE, "-"), (style.ORANGE, "--"), (style.RED, ":"))  # by choice of aspects


def score_name(signal: str) -> str:
    """The column that scores a signal: `accuracy`, where high is good, or `nrmse`."""
    return "accuracy" if signal in ANSWERS_WORDS else "nrmse"


def by_conflicts(table: pd.DataFrame) -> Figure:
    """The four signals over the number of conflicts; small dots are single choices of aspects.

    With the rows of the control in the table, diamonds show them at zero conflicts.
    """
    figure, axes = plt.subplots(2, 2, figsize=(7.5, 4.4), sharex=True)
    for axis, signal in zip(axes.T.flat, EXTRA_INPUT, strict=True):
        _curve(axis, table, signal)
        axis.set_title(f"{signal} (conflict in {EXTRA_INPUT[signal]})")
    for axis in axes[-1]:
        axis.set_xlabel("conflicts")
    axes[0, 0].legend(fontsize=8, loc="lower left")
    return style.closed(figure)


def card(table: pd.DataFrame, stories: Stories, signal: str, conflicts: int) -> Figure:
    """One signal's curve with one number of conflicts marked, and what one clip's answers are."""
    told = stories.of(signal, conflicts)
    words = signal in ANSWERS_WORDS
    figure = plt.figure(figsize=(8.2, 2.7 if words else 4.4))
    grid = figure.add_gridspec(1 if words else 2, 5)
    axis, text = figure.add_subplot(grid[0, :2]), figure.add_subplot(grid[0, 2:])
    _curve(axis, table, signal, mark=conflicts)
    axis.set_xlabel("conflicts")
    lines = [("the clip shows", told["shown"].iloc[0], style.GREY)]
    if words:
        lines.append(("asked for", told["asked"].iloc[0], "black"))
    for row, (colour, _) in zip(told.itertuples(), LOOKS, strict=False):
        lines.append((_choice(row), f"extra input: {row.extra}", style.GREY if words else colour))
        if words:
            verdict = "right" if row.right else "WRONG"
            lines.append(
                (
                    "",
                    f"{verdict}: {row.answer or '(nothing)'}",
                    style.BLUE if row.right else style.RED,
                )
            )
    for line, (before, what, colour) in enumerate(lines):
        y = 0.97 - (0.12 if words else 0.16) * line
        text.text(0, y, before, fontsize=8, color=style.GREY, transform=text.transAxes)
        text.text(0.36, y, what, fontsize=8, color=colour, transform=text.transAxes)
    text.axis("off")
    if not words:
        _motions([figure.add_subplot(grid[1, j]) for j in range(5)], stories, told)
    return style.closed(figure)


def describe(table: pd.DataFrame, stories: Stories, signal: str, conflicts: int) -> str:
    """What `card` shows, in words."""
    score = score_name(signal)
    rows = table[(table["signal"] == signal) & (table["conflicts"] == conflicts)]
    mean = rows.loc[rows["conflict_in"] != "congruent", score].mean()
    told = stories.of(signal, conflicts)
    answers = []
    for row in told.itertuples():
        value = rows.loc[_same(rows, row), score].iloc[0]
        answer = f"; the answer is {row.answer or 'nothing'}, {'right' if row.right else 'wrong'}"
        answers.append(
            f"{_choice(row)}: {score} {value:.1f} %, extra input {row.extra}"
            f"{answer if signal in ANSWERS_WORDS else ''}"
        )
    return (
        f"{signal}, {_count(conflicts)}: over all test clips the mean "
        f"{'accuracy' if signal in ANSWERS_WORDS else 'NRMSE'} is {mean:.1f} %. One clip shows "
        f"{told['shown'].iloc[0]}. {'. '.join(answers)}."
    )


def panel(table: pd.DataFrame, stories: Stories) -> Panel:
    """Choose a signal and a number of conflicts."""
    return Panel(
        partial(card, table, stories),
        {"signal": list(EXTRA_INPUT), "conflicts": [0, 1, 2, 3]},
        "One test clip under conflict",
        start={"signal": "repeat language", "conflicts": 1},
        describe=partial(describe, table, stories),
    )


def _curve(axis, table: pd.DataFrame, signal: str, mark: int | None = None) -> None:
    column = score_name(signal)
    rows = table[table["signal"] == signal]
    control = rows[rows["conflict_in"] == "congruent"]
    rows = rows.drop(control.index)
    mean = rows.groupby("conflicts")[column].mean()
    axis.plot(rows["conflicts"], rows[column], ".", color=style.SKY, label="one choice")
    axis.plot(mean.index, mean, "o-", color=style.BLUE, label="mean of choices")
    if len(control):
        axis.plot(0, control[column], "D", color=style.ORANGE, label="congruent extra input")
    axis.plot(3, published.THREE_CONFLICTS[signal].value, "^", color=style.GREY, fillstyle="none",
              label="paper's text, 3 conflicts")  # fmt: skip
    if mark is not None:
        axis.plot(mark, mean[mark], "s", markersize=12, color=style.RED, fillstyle="none",
                  markeredgewidth=2, label="here")  # fmt: skip
    good = column == "accuracy"
    axis.set(
        ylabel="accuracy, %" if good else "NRMSE, %",
        ylim=(-3, 105) if good else (0, None),
        xticks=range(4),
    )


def _motions(axes, stories: Stories, told: pd.DataFrame) -> None:
    for j, axis in enumerate(axes):
        axis.plot(np.degrees(stories.truth[:, j]), color="#BBBBBB", linewidth=4, label="recorded")
        for row, (colour, dash) in zip(told.itertuples(), LOOKS, strict=False):
            made = np.degrees(stories.joints[row.track][: len(stories.truth), j])
            axis.plot(made, dash, color=colour, label=_choice(row))
        axis.set_title(JOINT_NAMES[j])
    axes[0].set_ylabel("degrees")
    axes[2].set_xlabel("frame")
    labels = axes[0].get_legend_handles_labels()
    axes[0].figure.legend(*labels, loc="outside lower center", ncols=4)


def _same(rows: pd.DataFrame, row) -> pd.Series:
    return (rows["conflict_in"] == row.conflict_in) & (rows["aspects"].fillna("") == row.aspects)


def _choice(row) -> str:
    if not row.conflicts:
        return "regular input" if row.conflict_in == "none" else "all of it true"
    return f"{row.aspects.replace(' ', ', ')} false"


def _count(conflicts: int) -> str:
    return f"{conflicts or 'no'} conflict{'' if conflicts == 1 else 's'}"

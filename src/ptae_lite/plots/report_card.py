"""Figures of the report card: claims with their numbers and verdicts, and verdicts by group."""

from __future__ import annotations

from textwrap import wrap

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ptae_lite.paper import reported
from ptae_lite.plots import style

LOOKS = {  # a verdict by colour and by the form of its mark
    "held": {"color": style.BLUE, "marker": "o"},
    "held with a caveat": {"color": style.BLUE, "marker": "o", "fillstyle": "left",
                           "markerfacecoloralt": "white"},
    "not held": {"color": style.RED, "marker": "o", "markerfacecolor": "white"},
    "not testable": {"color": style.GREY, "marker": "X"},
    "not trained": {"color": style.GREY, "marker": "."},
}  # fmt: skip
OURS, THEIRS = "our recording", "authors' data"
SUFFIX = {OURS: "", THEIRS: "_theirs"}  # of the columns of `measured`
GOOD = "#D5EBE1"  # where ours has to lie
TITLES = {"%": "answers in words, % right", "% NRMSE": "movements, error in % (NRMSE)",
          "": "claims in words: our median (lowest to highest)"}  # fmt: skip
LINE = 0.17  # inches of a line of text
LABEL, TEXT = 64, 56  # characters of a claim and of our values, in a line


def card(rows: pd.DataFrame, run: bool = False) -> Figure:
    """All claims: the paper's number, ours with its range, and the verdict.

    Claims with a number have an axis: in the green part, ours agrees with the paper. Of claims in
    words, our values stand beside the verdict.

    Args:
        rows: `paper.report_card.measured`, or some of its rows.
        run: also mark the values of `run`.
    """
    kinds = rows["unit"].where(rows["paper"].notna(), "")
    parts = {kind: rows[kinds == kind] for kind in TITLES if (kinds == kind).any()}
    laid = {kind: _lay_out(part, kind == "") for kind, part in parts.items()}
    heights = [bottom for _, _, bottom in laid.values()]
    figure, axes = plt.subplots(
        len(parts), 1, squeeze=False, height_ratios=heights,
        figsize=(style.WIDTH, LINE * sum(heights) + 0.5 * len(parts) + 1.0),
    )  # fmt: skip
    for axis, (kind, part), height in zip(axes[:, 0], parts.items(), heights, strict=True):
        texts, places, _ = laid[kind]
        green = part["paper"] + part["margin"]  # where errors may end
        largest = max(part[["high", "high_theirs"]].max(axis=None), green.max())
        top = 1.08 * largest if kind == "% NRMSE" else 100
        axis.set(title=TITLES[kind], ylim=(height, -0.6), yticks=[])
        axis.set_xlim(-0.03 * top, 1.03 * top)
        axis.spines["left"].set_visible(False)
        if kind == "":
            axis.set_xticks([])
            axis.spines["bottom"].set_visible(False)
        for y, text, strong in texts:
            axis.text(0, y, text, va="top", fontweight="bold" if strong else "normal",
                      transform=axis.get_yaxis_transform())  # fmt: skip
        for (_, row), y in zip(part.iterrows(), places, strict=True):
            (_in_words if kind == "" else _with_number)(axis, row, y, (0, top), run)
    figure.legend(handles=_legend(rows, run), loc="outside upper center", ncols=2)
    return style.closed(figure)


def by_group(rows: pd.DataFrame) -> Figure:
    """How many claims of each group have which verdict: a mark for each claim."""
    groups = list(dict.fromkeys(rows["group"]))
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.55 * len(groups) + 1.0))
    for y, group in enumerate(groups):
        for data, suffix in _sets(rows):
            column, x = rows[f"verdict{suffix}"][rows["group"] == group], 0
            for verdict in LOOKS:
                count = int((column == verdict).sum())
                axis.plot(np.arange(x, x + count), [y + _shift(rows, data)] * count, ls="", ms=6.5,
                          **_look(verdict, data))  # fmt: skip
                x += count
    axis.set_yticks(range(len(groups)), groups)
    axis.set(ylim=(len(groups) - 0.5, -0.5), xticks=[])
    axis.tick_params(axis="y", length=0)
    axis.grid(visible=False)
    axis.spines[["left", "bottom"]].set_visible(False)
    figure.legend(handles=_verdicts(rows) + _data_sets(rows), loc="outside lower center", ncols=2)
    return style.closed(figure)


def _sets(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """The data sets of some rows, with the suffix of their columns: ours, and theirs if trained."""
    trained = ~rows["verdict_theirs"].isin(["not trained", "not testable"])
    return list(SUFFIX.items()) if trained.any() else [(OURS, "")]


def _shift(rows: pd.DataFrame, data: str) -> float:
    """Where a data set's mark lies about the line of its claim or group."""
    return 0.0 if len(_sets(rows)) == 1 else {OURS: -0.2, THEIRS: 0.2}[data]


def _look(verdict: str, data: str) -> dict:
    """How a mark is drawn: its colour and filling say the verdict, its form the data set."""
    look = LOOKS[verdict]
    return look | {"marker": "s"} if data == THEIRS and look["marker"] == "o" else look


def _lay_out(part: pd.DataFrame, in_words: bool) -> tuple[list, list, float]:
    """Texts with their places in lines, and whether they are bold; places of the marks; the end."""
    texts, places, y = [], [], 0.0
    for group, rows in part.groupby("group", sort=False):
        texts.append((y, group, True))
        y += 1.2
        for _, row in rows.iterrows():
            lines = wrap(row["claim"], LABEL)
            texts.append((y, "\n".join(lines), False))
            tall = sum(len(wrap(t, TEXT)) for t in _values(row).values()) if in_words else 0.8
            y += len(lines) + 0.45
            places.append(y + (tall - 1) / 2)
            y += tall + 0.35
        y += 0.3
    return texts, places, y


def _values(row: pd.Series) -> dict[str, str]:
    """Our values as a text, by data set. If there are none, a text that says so."""
    digits = 2 if "NRMSE" in row["unit"] or "million" in row["unit"] else 1
    texts = {}
    for data, suffix in SUFFIX.items():
        if np.isnan(row[f"median{suffix}"]):
            continue
        low, middle, high = (
            f"{row[name + suffix] + 0.0:.{digits}f}" for name in ("low", "median", "high")
        )
        of = "" if data == OURS else f"{data}: "
        between = f" ({low} to {high})" if low != high else ""
        texts[data] = f"{of}{middle}{between} {row['unit']}"
    return texts or {OURS: "nothing to compare"}


def _with_number(axis: Axes, row: pd.Series, y: float, ends, run: bool) -> None:
    low, high = ends
    if row["reads"] == reported.AT_LEAST:
        low = row["paper"] - row["margin"]
    else:
        high = row["paper"] + row["margin"]
    axis.barh(y, high - low, left=low, height=0.8, color=GOOD, zorder=1)
    axis.plot([row["paper"]] * 2, [y - 0.4, y + 0.4], color="black", lw=2, zorder=3)
    for data, suffix in _sets(row.to_frame().T):
        look, at = _look(row[f"verdict{suffix}"], data), y + _shift(row.to_frame().T, data)
        ends = [row[f"low{suffix}"], row[f"high{suffix}"]]
        axis.plot(ends, [at, at], color=look["color"], lw=2, zorder=4)
        axis.plot(row[f"median{suffix}"], at, ls="", ms=5.5, zorder=5, **look)
    if run:
        axis.plot(row["run"], y, "D", color="black", mfc="none", ms=7, zorder=6)


def _in_words(axis: Axes, row: pd.Series, y: float, ends, run: bool) -> None:
    texts = {data: wrap(text, TEXT) for data, text in _values(row).items()}
    top = y - (sum(map(len, texts.values())) - 1) / 2
    for data, lines in texts.items():
        at = top + (len(lines) - 1) / 2
        axis.plot(2, at, ls="", ms=6, **_look(row[f"verdict{SUFFIX[data]}"], data))
        axis.text(6, at, "\n".join(lines), va="center")
        top += len(lines)


def _verdicts(rows: pd.DataFrame) -> list[Line2D]:
    there = rows[["verdict", "verdict_theirs"]] if len(_sets(rows)) == 2 else rows[["verdict"]]
    return [Line2D([], [], ls="", ms=6, label=verdict, **LOOKS[verdict])
            for verdict in LOOKS if (there == verdict).any(axis=None)]  # fmt: skip


def _data_sets(rows: pd.DataFrame) -> list[Line2D]:
    """Which form stands for which data set, if there are two."""
    if len(_sets(rows)) == 1:
        return []
    return [Line2D([], [], ls="", ms=6, marker=marker, color="black", mfc="none", label=data)
            for data, marker in ((OURS, "o"), (THEIRS, "s"))]  # fmt: skip


def _legend(rows: pd.DataFrame, run: bool) -> list:
    """What is there: verdicts, and for claims with a number the parts of their axis."""
    empty = rows["median_theirs"].isna()  # these have no mark
    shown = rows.assign(verdict_theirs=rows["verdict_theirs"].mask(empty, rows["verdict"]))
    handles: list = _verdicts(shown) + _data_sets(rows)
    if rows["paper"].notna().any():
        handles.append(Line2D([], [], color="black", lw=2, ls="", marker="|", ms=9, mew=2,
                              label="the paper's number"))  # fmt: skip
        handles.append(Patch(color=GOOD, label="where ours agrees"))
    if run:
        handles.append(Line2D([], [], color="black", marker="D", mfc="none", ls="", ms=7,
                              label="this run"))  # fmt: skip
    return handles

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
}  # fmt: skip
GOOD = "#D5EBE1"  # where ours has to lie
TITLES = {"%": "answers in words, % right", "% NRMSE": "movements, error in % (NRMSE)",
          "": "claims in words: median (range)"}  # fmt: skip
LINE = 0.15  # inches of a line of text
# Characters of a claim and of our values in a line, beside an axis and without one.
BESIDE, ALONE = (46, 60), (66, 46)


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
    widths = ALONE if list(parts) == [""] else BESIDE
    laid = {kind: _lay_out(part, widths, in_words=kind == "") for kind, part in parts.items()}
    heights = [places.max() + 2.2 for _, places, _ in laid.values()]
    figure, axes = plt.subplots(
        len(parts), 1, squeeze=False, height_ratios=heights,
        figsize=(7.0, LINE * sum(heights) + 0.75 * len(parts) + 0.5),
    )  # fmt: skip
    for axis, kind, height in zip(axes[:, 0], parts, heights, strict=True):
        labels, places, bold = laid[kind]
        axis.set_yticks(places, labels)
        for label, strong in zip(axis.get_yticklabels(), bold, strict=True):
            label.set(fontsize=8, fontweight="bold" if strong else "normal")
        axis.set(title=TITLES[kind], ylim=(height - 0.8, -0.9))
        axis.tick_params(axis="y", length=0)
        axis.grid(axis="y", visible=False)
        ends = (
            0,
            {"%": 100, "": 1}.get(kind, 1.08 * parts[kind][["high", "paper"]].max(axis=None)),
        )
        if kind == "":
            axis.set_xticks([])
            axis.spines["bottom"].set_visible(False)
        pad = 0.03 * (ends[1] - ends[0])
        axis.set_xlim(ends[0] - pad, ends[1] + pad)
        for (_, row), y in zip(parts[kind].iterrows(), places[~bold], strict=True):
            if kind == "":
                _in_words(axis, row, y, widths[1])
            else:
                _with_number(axis, row, y, ends, run)
    legend = _legend(run)[: len(LOOKS) if widths is ALONE else None]
    figure.legend(handles=legend, loc="outside upper center", ncols=3, fontsize=8)
    return style.closed(figure)


def by_group(rows: pd.DataFrame) -> Figure:
    """How many claims of each group have which verdict: a square for each claim."""
    groups = list(dict.fromkeys(rows["group"]))
    figure, axis = plt.subplots(figsize=(6.4, 0.42 * len(groups) + 0.9))
    for y, group in enumerate(groups):
        x = 0
        for verdict, look in LOOKS.items():
            count = int(((rows["group"] == group) & (rows["verdict"] == verdict)).sum())
            axis.plot(np.arange(x, x + count), [y] * count, ls="", ms=8, **look)
            x += count
    axis.set_yticks(range(len(groups)), groups)
    axis.set(ylim=(len(groups) - 0.5, -0.5), xticks=[])
    axis.tick_params(axis="y", length=0)
    axis.grid(visible=False)
    axis.spines[["left", "bottom"]].set_visible(False)
    handles = [Line2D([], [], ls="", ms=8, label=name, **look) for name, look in LOOKS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8)
    return style.closed(figure)


def _lay_out(
    part: pd.DataFrame, widths, in_words: bool
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Labels of the rows and of the groups' headings, their places in lines, and which are bold."""
    labels, places, bold, y = [], [], [], 0.0
    for group, rows in part.groupby("group", sort=False):
        labels, places, bold, y = [*labels, group], [*places, y], [*bold, True], y + 1.1
        for _, row in rows.iterrows():
            lines = wrap(row["claim"], widths[0])
            tall = max(len(lines), len(wrap(_values(row), widths[1])) if in_words else 1)
            labels.append("\n".join(lines))
            places.append(y + (tall - 1) / 2)
            bold.append(False)
            y += tall + 0.2
        y += 0.3
    return labels, np.array(places), np.array(bold)


def _values(row: pd.Series) -> str:
    """Our values as a text."""
    if np.isnan(row["median"]):
        return "nothing to compare"
    digits = 2 if "NRMSE" in row["unit"] or "million" in row["unit"] else 1
    low, middle, high = (f"{row[name] + 0.0:.{digits}f}" for name in ("low", "median", "high"))
    return f"{middle} ({low} to {high}) {row['unit']}" if low != high else f"{middle} {row['unit']}"


def _with_number(axis: Axes, row: pd.Series, y: float, ends, run: bool) -> None:
    low, high = ends
    if row["reads"] == reported.AT_LEAST:
        low = row["paper"] - row["margin"]
    else:
        high = row["paper"] + row["margin"]
    axis.barh(y, high - low, left=low, height=0.95, color=GOOD, zorder=1)
    axis.plot([row["paper"]] * 2, [y - 0.45, y + 0.45], color="black", lw=2, zorder=3)
    look = LOOKS[row["verdict"]]
    axis.plot([row["low"], row["high"]], [y, y], color=look["color"], lw=2, zorder=4)
    axis.plot(row["median"], y, ls="", ms=7, zorder=5, **look)
    if run:
        axis.plot(row["run"], y, "D", color="black", mfc="none", ms=7, zorder=6)


def _in_words(axis: Axes, row: pd.Series, y: float, width: int) -> None:
    axis.plot(0.02, y, ls="", ms=7, **LOOKS[row["verdict"]])
    text = "\n".join(wrap(_values(row), width))
    axis.text(0.06, y, text, va="center", fontsize=8)


def _legend(run: bool) -> list:
    handles = [Line2D([], [], ls="", ms=7, label=name, **look) for name, look in LOOKS.items()]
    handles.append(Line2D([], [], color="black", lw=2, ls="", marker="|", ms=9, mew=2,
                          label="the paper's number"))  # fmt: skip
    handles.append(Patch(color=GOOD, label="where ours agrees with it"))
    if run:
        handles.append(Line2D([], [], color="black", marker="D", mfc="none", ls="", ms=7,
                              label="this run"))  # fmt: skip
    return handles

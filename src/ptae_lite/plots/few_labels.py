"""Figures of chapter 04: lists of labels as dots, signals as tiles, scores by share of labels."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int, UInt8
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptae_lite.plots import style

COLOURS = (style.RED, style.BLUE, style.GREY, style.SKY)  # of what is not a model
MARKS = ("o", "s", "D", "v")
DASHES = ("-", "--", "-.", ":")
SHARES = (1, 2, 5, 10, 20, 50, 100)  # ticks of an axis of shares


LONGEST_NAME = 20  # letters that fit at the left end of a curve


def strips(
    panels: Mapping[str, Mapping[str, Collection[float]]], x_label: str, chance: float | None = None
) -> Figure:
    """A dot for each value, in named rows; each row ends in its mean.

    Args:
        panels: title to the rows of a panel. All panels have the same rows.
        chance: what guessing would give, as a dotted line.
    """
    rows = list(next(iter(panels.values())))
    size = (style.WIDTH, 0.6 + (0.4 + 0.4 * len(rows)) * len(panels))
    figure, grid = plt.subplots(len(panels), 1, figsize=size, squeeze=False, sharex=True)
    highest = max(max(values) for panel in panels.values() for values in panel.values())
    for axes, (title, panel) in zip(grid.flat, panels.items(), strict=True):
        colour = style.of_model(title, style.BLUE)
        for i, values in enumerate(panel.values()):
            spread = 0.2 * np.sin(2.4 * np.arange(len(values)))  # so that equal dots stay apart
            axes.plot(values, i + spread, MARKS[i], color=colour, ms=5, alpha=0.6, mew=0)
            axes.plot([np.mean(values)] * 2, [i - 0.33, i + 0.33], color=colour, lw=2)
            axes.text(1.34 * highest, i, f"mean {np.mean(values):.0f}", color=style.ink(colour),
                      ha="right", va="center", bbox=style.PLAIN)  # fmt: skip
        if chance is not None:
            axes.axvline(chance, color=style.GREY, ls=":", lw=1.2)
            axes.text(chance, len(rows) - 0.52, " chance", color=style.GREY, va="bottom")
        axes.set(title=title, xlim=(-0.02 * highest, 1.35 * highest))
        axes.set_xticks([tick for tick in axes.get_xticks() if 0 <= tick <= 100])  # percent
        axes.set_yticks(range(len(rows)), rows)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
    grid[-1, 0].set_xlabel(x_label)
    return style.closed(figure)


def schedules(shown: Mapping[str, Bool[np.ndarray, "clips epochs"]]) -> Figure:
    """When each clip is shown with its sentence: dark squares."""
    figure, grid = plt.subplots(1, len(shown), figsize=(style.WIDTH, 2.6), sharey=True)
    for axes, (title, table) in zip(grid, shown.items(), strict=True):
        axes.imshow(~table, cmap="gray", vmin=-0.3, vmax=1, aspect="auto")
        axes.set(title=title, xlabel="epoch")
        axes.grid(False)
    grid[0].set_ylabel("clip")
    return style.closed(figure)


def tiles(
    tables: Mapping[str, Int[np.ndarray, "R C"]], rows: Sequence[str], columns: Sequence[str],
    wrong: Bool[np.ndarray, "R C"],
) -> Figure:  # fmt: skip
    """Tables of counts as tiles: blue where a count may be, red where it must not.

    Args:
        wrong: the tiles that must be zero.
    """
    size = (style.WIDTH, 0.5 + 1.05 * len(tables))
    figure, grid = plt.subplots(len(tables), 1, figsize=size, sharex=True, squeeze=False)
    for axes, (title, table) in zip(grid[:, 0], tables.items(), strict=True):
        paint = np.where(table == 0, 0, np.where(wrong, 2, 1))
        colours = plt.matplotlib.colors.ListedColormap(["white", "#CFE3F1", "#F0A58A"])
        axes.imshow(paint, cmap=colours, vmin=0, vmax=2, aspect="auto")
        for (i, j), count in np.ndenumerate(table):
            axes.text(j, i, f"{count}", ha="center", va="center")
        axes.set_title(title, loc="left")
        axes.set_yticks(range(len(rows)), rows)
        axes.set_xticks(range(len(columns)), columns)
        axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
        axes.grid(False)
        axes.grid(which="minor", color="#BBBBBB")
        axes.tick_params(which="both", length=0)
    return style.closed(figure)


def edges(graph: Float[np.ndarray, "M M"], blocks: Sequence[str], sizes: Sequence[int]) -> Figure:
    """The edges of a graph whose nodes are sorted by blocks: a dot where two nodes are joined.

    Args:
        blocks: names, in order.
        sizes: nodes of each block.
    """
    figure, axes = plt.subplots(figsize=(style.WIDTH, 4.0))
    row, column = np.nonzero(graph)
    axes.plot(column, row, ".", ms=1.4, mew=0, color=style.BLUE, rasterized=True)
    ends = np.cumsum(sizes)
    axes.set(xlim=(0, len(graph)), ylim=(len(graph), 0), aspect="equal", xticks=[])
    axes.set_yticks(ends - np.asarray(sizes) / 2, blocks)
    axes.tick_params(length=0)
    for end in ends[:-1]:
        axes.axhline(end, color="#E4E4E4", lw=0.6)
        axes.axvline(end, color="#E4E4E4", lw=0.6)
    axes.grid(visible=False)
    return style.closed(figure)


def by_share(
    panels: Mapping[str, Mapping[str, pd.Series]], x_label: str, *,
    levels: Mapping[str, float] | None = None, top: Mapping[str, float] | None = None,
) -> Figure:  # fmt: skip
    """Curves over the share of labels (logarithmic), each with its name at its left end; or in a
    legend, if there are more than three or a name is long.

    Args:
        panels: label of the vertical axis to named curves: values by share in percent.
        levels: dotted lines in the last panel, with their names.
        top: upper end of a panel's vertical axis.
    """
    size = (style.WIDTH, 0.2 + 2.5 * len(panels))
    figure, grid = plt.subplots(len(panels), 1, figsize=size, squeeze=False)
    for axes, (label, curves) in zip(grid.flat, panels.items(), strict=True):
        for k, (name, curve) in enumerate(curves.items()):
            look = {"color": style.of_model(name, COLOURS[k]), "marker": MARKS[k], "ms": 4.5}
            axes.plot(curve.index, curve, DASHES[k], **look)
        high = (top or {}).get(label, 105)
        in_legend = len(curves) > 3 or max(map(len, curves)) > LONGEST_NAME
        axes.set(ylabel=label, xscale="log", ylim=(0, high), xlim=(0.8 if in_legend else 0.17, 120))
        axes.set_xticks(SHARES, SHARES)
        axes.minorticks_off()
        if in_legend:
            where = "upper left" if len(curves) > 3 else "lower right"
            axes.legend(axes.lines, list(curves), loc=where)
            continue
        for y, (k, name) in _apart(curves, 0.075 * high).items():
            first = next(iter(curves[name].index))
            colour = style.ink(style.of_model(name, COLOURS[k]))
            axes.text(0.82 * first, y, name, color=colour, ha="right", va="center")
    axes.set_xlabel(x_label)
    for name, level in (levels or {}).items():
        axes.axhline(level, color=style.GREY, ls=":", lw=1.2)
        axes.text(0.18, level, name, color=style.GREY, va="center", bbox=style.PLAIN)
    return style.closed(figure)


def _apart(curves: Mapping[str, pd.Series], gap: float) -> dict[float, tuple[int, str]]:
    """Heights for the curves' names: near their first points, and at least `gap` apart."""
    found: dict[float, tuple[int, str]] = {}
    order = sorted((curve.iloc[0], k, name) for k, (name, curve) in enumerate(curves.items()))
    last = -np.inf
    for value, k, name in order:
        last = max(value, last + gap, 0.6 * gap)
        found[last] = (k, name)
    return found


def paired(points: pd.DataFrame, names: tuple[str, str], group: str, end: float = 104) -> Figure:
    """A dot for each list of labels: its score by one way of learning, over that by another.

    Args:
        points: a row for each list, with columns `x`, `y` and that of `group`.
        names: of the two axes.
        group: dots of one value have one colour and a mark.
    """
    figure, axes = plt.subplots(figsize=(style.WIDTH, 4.2))
    axes.plot([0, end], [0, end], color=style.GREY, lw=1.2)
    _note(axes, 0.58 * end, 0.86 * end, f"{names[1].split(',')[0]} is better", "right")
    _note(axes, 0.99 * end, 0.46 * end, f"{names[0].split(',')[0]} is better", "right")
    paint = plt.get_cmap("viridis")(np.linspace(0, 0.85, points[group].nunique()))
    shapes = ("o", "s", "^", "D", "v", "P", "X", "p")
    for (value, own), colour, shape in zip(points.groupby(group), paint, shapes, strict=False):
        axes.plot(own["x"], own["y"], shape, color=colour, ms=6.5, label=f"{value:g} %")
    axes.set(xlabel=names[0], ylabel=names[1], xlim=(0, end), ylim=(0, end), aspect="equal")
    axes.legend(title=group, loc="lower right")
    return style.closed(figure)


def _note(axes: Axes, x: float, y: float, text: str, side: str) -> None:
    axes.text(x, y, text, color=style.GREY, ha=side, style="italic")


def sentences_below(
    images: UInt8[np.ndarray, "I H W 3"], rows: Mapping[str, Sequence[str]]
) -> Figure:
    """Images in two columns, and below each of them a line of text for each of the named rows.

    The number of images is even.
    """
    height = 0.72 * style.WIDTH / 2 + 0.17 * len(rows)
    size = (style.WIDTH, height * -(-len(images) // 2))
    figure, grid = plt.subplots(-(-len(images) // 2), 2, figsize=size, squeeze=False)
    for column, (axes, image) in enumerate(zip(grid.flat, images, strict=True)):
        axes.imshow(image)
        axes.set(xticks=[], yticks=[])
        axes.grid(False)
        texts = [f"{name}: {texts[column]}" for name, texts in rows.items()]
        axes.set_xlabel("\n".join(texts), loc="left")
    return style.closed(figure)

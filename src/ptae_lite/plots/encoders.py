"""Figures that compare image encoders: marks in rows, ranges over seeds, changes, use by PTAE."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ptae_lite.plots import style

COLOURS = (style.BLUE, style.ORANGE, style.GREEN, style.GREY)
MARKS = ("o", "s", "^", "D")


def marks(
    rows: Mapping[str, Mapping[str, float]], x_label: str, *, within=(0, 100), digits: int = 0
) -> Figure:
    """A row below each name, with a labelled mark for each of its named values.

    Args:
        rows: name of the row to values by series. All rows have the same series.
        within: ends of the horizontal axis.
        digits: of the values below the marks.
    """
    figure, axes = plt.subplots(figsize=(style.WIDTH, 0.62 * len(rows) + 0.8))
    series = list(next(iter(rows.values())))
    plain = style.SERIES if len(series) > 1 else COLOURS
    colours = [style.of_model(name, plain[k]) for k, name in enumerate(series)]
    wide = within[1] - within[0]
    for i, (name, row) in enumerate(rows.items()):
        values = list(row.values())
        start = min(values) if len(series) > 1 else within[0]
        axes.plot([start, max(values)], [i, i], color="#BBBBBB", lw=3 if len(series) == 1 else 1.6)
        axes.text(0, i - 0.3, name, va="center", transform=axes.get_yaxis_transform())
        places = _apart(values, (0.08 + 0.005 * digits) * wide)
        for k, (value, place) in enumerate(zip(values, places, strict=True)):
            look = {"color": colours[k], "ms": 9 - 1.5 * k}  # so that none hides another
            axes.plot(value, i, MARKS[k], zorder=3, label=None if i else series[k], **look)
            axes.annotate(f"{value:.{digits}f}", (place, i), (0, -6), textcoords="offset points",
                          ha="center", va="top", color=style.ink(colours[k]))  # fmt: skip
    axes.set(xlabel=x_label, xlim=(within[0] - 0.04 * wide, within[1] + 0.04 * wide), yticks=[])
    axes.set_ylim(len(rows) - 0.4, -0.55)
    axes.spines["left"].set_visible(False)
    if len(series) > 1:
        long = sum(map(len, series)) > 50
        figure.legend(loc="outside lower center", ncols=1 if long else len(series))
    return style.closed(figure)


def _apart(values: Sequence[float], least: float) -> np.ndarray:
    """Where texts of these values stand, each pair at least so far apart."""
    places, order = np.array(values, float), np.argsort(values, kind="stable")
    for _ in range(20):
        for one, other in pairwise(order):
            lacking = least - (places[other] - places[one])
            if lacking > 0:
                places[[one, other]] += -lacking / 2, lacking / 2
    return places


def ruler(levels: Mapping[str, float], x_label: str) -> Figure:
    """Named values on one line, each with its name, by turns above and below the line."""
    figure, axes = plt.subplots(figsize=(style.WIDTH, 2.2))
    values = sorted(levels.items(), key=lambda item: item[1])
    low, high = values[0][1], values[-1][1]
    axes.axhline(0, color=style.GREY, lw=1.2)
    for i, (name, value) in enumerate(values):
        up, colour = (-1) ** i, COLOURS[i % len(COLOURS)]
        far = 0.45 if i % 4 < 2 else 1.0  # so that neighbours do not touch
        axes.plot([value, value], [0, up * far], color=colour, lw=1)
        axes.plot(value, 0, MARKS[i % len(MARKS)], color=colour, ms=8)
        side = "left" if value < low + (high - low) / 3 else "right"
        text = {"ha": side, "va": "bottom" if up > 0 else "top", "color": style.ink(colour)}
        axes.annotate(f"{name}: {value:.3f}", (value, up * far), **text)
    axes.set(xlabel=x_label, ylim=(-1.5, 1.5), yticks=[])
    axes.set_xlim(low - 0.05 * (high - low), high + 0.05 * (high - low))
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    return style.closed(figure)


def ranges(rows: Mapping[str, pd.DataFrame], group: str, panels: Mapping[str, str]) -> Figure:
    """A panel for each column in `panels`: the mean of each group with its lowest and highest.

    Args:
        rows: named tables. They are drawn one below the other within a group: the first filled,
            the others hollow.
        group: the column of the groups, which are the rows of a panel, in their order.
        panels: column to title.
    """
    groups = list(dict.fromkeys(next(iter(rows.values()))[group]))
    height = -(-len(panels) // 2)
    size = (style.WIDTH, 0.5 + (0.65 + 0.34 * len(groups)) * height)
    figure, grid = plt.subplots(height, 2, figsize=size, sharey=True, squeeze=False)
    for axes, (column, title) in zip(grid.flat, panels.items(), strict=False):
        for k, table in enumerate(rows.values()):
            for i, name in enumerate(groups):
                own = table[table[group] == name][column]
                y = i + 0.3 * (k - (len(rows) - 1) / 2)
                look = {"color": COLOURS[min(i, len(COLOURS) - 1)], "zorder": 3}
                axes.plot([own.min(), own.max()], [y, y], lw=2.5, solid_capstyle="butt", **look)
                face = look["color"] if k == 0 else "white"
                axes.plot(own.mean(), y, MARKS[k], mfc=face, ms=6, **look)
        axes.set(title=title)
        axes.set_yticks(range(len(groups)), groups)
        axes.set_ylim(len(groups) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    if len(rows) > 1:
        for k, what in enumerate(rows):
            face = style.GREY if k == 0 else "white"
            grid[0, 0].plot([], [], MARKS[k], color=style.GREY, mfc=face, label=what)
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)


def changes(table: pd.DataFrame, limits: Mapping[str, float]) -> Figure:
    """What the last doubling changed, as a table in colours: green within the limit.

    Args:
        table: a row for each (group, thousand images), a column for each measure.
        limits: by column, the size of a change that is still small.
    """
    size = table.abs() / pd.Series(limits)
    shades = np.where(size < 1, 0, np.where(size < 2, 1, 2))
    colours = plt.matplotlib.colors.ListedColormap(["#A8DDC5", "#F6E3B4", "#F0B89A"])
    figure, axes = plt.subplots(figsize=(style.WIDTH, 0.27 * len(table) + 0.7))
    axes.imshow(shades, cmap=colours, vmin=0, vmax=2, aspect="auto")
    for (i, j), value in np.ndenumerate(table.to_numpy()):
        axes.text(j, i, f"{value:+.0f}", ha="center", va="center")
    axes.set_yticks(range(len(table)), [f"{name}, {length:,}" for name, length in table.index])
    axes.set_xticks(range(len(limits)), list(limits))
    groups = [name for name, _ in table.index]
    for i in range(1, len(groups)):
        if groups[i] != groups[i - 1]:
            axes.axhline(i - 0.5, color="white", lw=5)
    axes.tick_params(length=0, labeltop=True, labelbottom=False)
    axes.spines[:].set_visible(False)
    axes.grid(False)
    return style.closed(figure)


def in_use(
    stages: Mapping[str, pd.DataFrame], others: pd.DataFrame, x: str, y: str, labels, levels
) -> Figure:
    """Two scores of the network behind each encoder. Arrows lead from stage to stage.

    An arrow joins means over the seeds that its later stage has.

    Args:
        stages: tables with a column `encoder`, in the order of their lengths.
        others: encoders without a length, one mark each.
        labels: of the two axes.
        levels: named vertical lines at values of `x`.
    """
    figure, axes = plt.subplots(figsize=(style.WIDTH, 4.4))
    names = list(dict.fromkeys(next(iter(stages.values()))["encoder"]))
    for i, name in enumerate(names):
        path = [table[table["encoder"] == name] for table in stages.values()]
        means = [own[[x, y]].mean() for own in path]
        for own in path:
            axes.plot(own[x], own[y], MARKS[i], color=COLOURS[i], ms=3, alpha=0.45)
        axes.plot(*zip(*means, strict=True), MARKS[i], color=COLOURS[i], ms=7, label=name)
        for before, own, end in zip(path, path[1:], means[1:], strict=False):
            start = before.loc[before["seed"].isin(own["seed"]), [x, y]].mean()
            arrow = {"arrowstyle": "->", "color": COLOURS[i], "lw": 1.4}
            axes.annotate("", end, start, arrowprops=arrow)
    for k, (name, own) in enumerate(others.groupby("encoder", sort=False)):
        at = own[x].mean(), own[y].mean()
        axes.plot(*at, "X", color=style.GREY, ms=7, zorder=3)
        axes.annotate(name, at, (0, -16 if k % 2 else 7), textcoords="offset points", ha="center",
                      color=style.GREY, bbox=style.PLAIN)  # fmt: skip
    for name, level in levels.items():
        axes.axvline(level, color=style.GREY, ls=":")
        foot = axes.get_xaxis_transform()  # x in data, y in shares of the height
        axes.text(level, 0.02, f" {name} ", transform=foot, ha="right", color=style.GREY)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.margins(y=0.1)
    figure.legend(loc="outside lower center", ncols=2)
    return style.closed(figure)

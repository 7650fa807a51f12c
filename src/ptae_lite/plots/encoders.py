"""Figures that compare image encoders: marks in rows, ranges over seeds, changes, use by PTAE."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

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
    """A row for each name, with a labelled mark for each of its named values.

    Args:
        rows: name of the row to values by series. All rows have the same series.
        within: ends of the horizontal axis.
        digits: of the values beside the marks.
    """
    series = list(next(iter(rows.values())))
    below = -(-len(series) // 3) if len(series) > 1 else 0  # lines of the legend
    figure, axes = plt.subplots(figsize=(style.WIDTH, 0.5 * len(rows) + 0.7 + 0.2 * below))
    axes.set_ylim(len(rows) - 0.5, -0.7)
    near = 0.09 * (within[1] - within[0])  # numbers that are nearer would touch
    colours = [style.MODELS.get(name, COLOURS[k]) for k, name in enumerate(series)]
    for i, row in enumerate(rows.values()):
        axes.plot([min(row.values()), max(row.values())], [i, i], color="#BBBBBB", zorder=2)
        taken: dict[int, list[float]] = {7: [], -14: [], 17: []}  # heights in points
        for value, colour in zip(row.values(), colours, strict=True):
            free = (up for up, other in taken.items()
                    if all(abs(value - one) >= near for one in other))  # fmt: skip
            up = next(free, 7)
            taken[up].append(value)
            axes.annotate(f"{value:.{digits}f}", (value, i), (0, up), ha="center",
                          textcoords="offset points", color=style.ink(colour))  # fmt: skip
    for k, name in enumerate(series):
        values = [row[name] for row in rows.values()]
        look = {"color": colours[k], "ms": 9 - 1.5 * k}  # so that none hides another
        axes.plot(values, range(len(rows)), MARKS[k], zorder=3, label=name, **look)
    axes.set_yticks(range(len(rows)), [fill(name, 18) for name in rows])
    spare = 0.05 * (within[1] - within[0])
    axes.set(xlabel=x_label, xlim=(within[0] - spare, within[1] + spare))
    axes.tick_params(axis="y", length=0)
    if len(series) > 1:
        figure.legend(loc="outside lower center", ncols=min(len(series), 3), columnspacing=1)
    return style.closed(figure)


def ruler(levels: Mapping[str, float], x_label: str) -> Figure:
    """Named values on one line, each with its name, by turns above and below the line."""
    figure, axes = plt.subplots(figsize=(6.4, 1.9))
    values = sorted(levels.items(), key=lambda item: item[1])
    axes.axhline(0, color=style.GREY, lw=1.2)
    for i, (name, value) in enumerate(values):
        up, colour = (-1) ** i, COLOURS[i % len(COLOURS)]
        far = 0.45 if i % 4 < 2 else 1.0  # so that neighbours do not touch
        axes.plot([value, value], [0, up * far], color=colour, lw=1)
        axes.plot(value, 0, MARKS[i % len(MARKS)], color=colour, ms=7)
        text = {"ha": "center", "va": "bottom" if up > 0 else "top", "color": colour}
        axes.annotate(f"{name}: {value:.3f}", (value, up * far), **text)
    low, high = values[0][1], values[-1][1]
    axes.set(xlabel=x_label, ylim=(-1.5, 1.5), yticks=[])
    axes.set_xlim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    return style.closed(figure)


def ranges(
    rows: Mapping[str, pd.DataFrame], group: str, panels: Mapping[str, str], columns: int = 3
) -> Figure:
    """A panel for each column in `panels`: the mean of each group with its lowest and highest.

    Args:
        rows: named tables. They are drawn one below the other within a group: the first filled,
            the others hollow.
        group: the column of the groups, which are the rows of a panel, in their order.
        panels: column to title.
        columns: of panels.
    """
    groups = list(dict.fromkeys(next(iter(rows.values()))[group]))
    height = -(-len(panels) // columns)
    size = (0.9 + 2.0 * columns, 0.5 + (0.65 + 0.34 * len(groups)) * height)
    figure, grid = plt.subplots(height, columns, figsize=size, sharey=True, squeeze=False)
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
    figure, axes = plt.subplots(figsize=(5.6, 0.27 * len(table) + 0.7))
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

    Args:
        stages: tables with a column `encoder`, in the order of their lengths.
        others: encoders without a length, one mark each.
        labels: of the two axes.
        levels: named vertical lines at values of `x`.
    """
    figure, axes = plt.subplots(figsize=(6.4, 3.6))
    names = list(dict.fromkeys(next(iter(stages.values()))["encoder"]))
    for i, name in enumerate(names):
        path = []
        for table in stages.values():
            own = table[table["encoder"] == name]
            axes.plot(own[x], own[y], MARKS[i], color=COLOURS[i], ms=3, alpha=0.45)
            path.append((own[x].mean(), own[y].mean()))
        axes.plot(*zip(*path, strict=True), MARKS[i], color=COLOURS[i], ms=7, label=name)
        for start, end in zip(path, path[1:], strict=False):
            arrow = {"arrowstyle": "->", "color": COLOURS[i], "lw": 1.4}
            axes.annotate("", end, start, arrowprops=arrow)
    for name, own in others.groupby("encoder", sort=False):
        at = own[x].mean(), own[y].mean()
        axes.plot(*at, "X", color=style.PURPLE, ms=7)
        axes.annotate(name, at, (0, 7), textcoords="offset points", ha="center", color=style.PURPLE)
    for name, level in levels.items():
        axes.axvline(level, color=style.GREY, ls=":")
        foot = axes.get_xaxis_transform()  # x in data, y in shares of the height
        axes.text(level, 0.02, f" {name} ", transform=foot, ha="left", color=style.GREY)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.margins(y=0.1)
    axes.legend(loc="lower left")
    return style.closed(figure)

"""Figures of images and their codes: marked images, layers, components, scores of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure

from ptae_lite.errors import PTAEError
from ptae_lite.plots import style

LOOKS = (("-", "o"), ("--", "s"), ("-.", "^"), (":", "D"))


def dots_by_seed(
    rows: pd.DataFrame,
    group: str,
    x: str,
    panels: Mapping[str, str],
    x_label: str,
    levels: Mapping[str, pd.Series] | None = None,
    ticks: Sequence[float] | None = None,
) -> Figure:
    """A panel for each column in `panels` over the column `x`: a dot a seed, a line of means.

    Args:
        group: rows with the same value in this column have one colour.
        panels: column to label.
        levels: named rows without a value of `x`, drawn as horizontal lines.
        ticks: values shown on the x axis. It is then logarithmic above the smallest that is not 0.

    Raises:
        PTAEError: there are more groups than line styles.
    """
    groups = list(dict.fromkeys(rows[group]))
    if len(groups) > len(LOOKS):
        raise PTAEError(f"these panels distinguish {len(LOOKS)} groups, not {len(groups)}")
    size = (style.WIDTH, 2.1 * len(panels) + 0.7)
    figure, grid = plt.subplots(len(panels), 1, figsize=size, sharex=True, squeeze=False)
    for axes, (column, label) in zip(grid[:, 0], panels.items(), strict=True):
        for i, (name, (dash, mark)) in enumerate(zip(groups, LOOKS, strict=False)):
            own = rows[rows[group] == name]
            means = own.groupby(x)[column].mean()
            axes.plot(own[x], own[column], mark, color=f"C{i}", ms=3, alpha=0.6)
            axes.plot(means.index, means, dash, color=f"C{i}", marker=mark, ms=4, label=name)
        for k, (name, level) in enumerate((levels or {}).items()):
            colour = (style.GREY, style.PURPLE, style.SKY)[k % 3]
            axes.axhline(level[column], color=colour, ls=":", label=name)
        axes.set_title(label)
        if ticks is not None:
            axes.set_xscale("symlog", linthresh=min(tick for tick in ticks if tick))
            axes.set_xticks(ticks, [f"{tick:,g}" for tick in ticks])
            axes.set_xticks([], minor=True)
    grid[-1, 0].set_xlabel(x_label)
    handles = grid[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=2 if levels else 3)
    return style.closed(figure)


def marked(
    images: Sequence[np.ndarray], points: Mapping[str, np.ndarray], titles: Sequence[str]
) -> Figure:
    """Images in two columns, each with a mark for each of up to three names.

    Args:
        points: name to its places (column, row), one for each image, in pixels.
    """
    rows = -(-len(images) // 2)
    figure, grid = plt.subplots(rows, 2, figsize=(style.WIDTH, 1.85 * rows + 0.3))
    for i, (axes, image, title) in enumerate(zip(grid.flat, images, titles, strict=True)):
        axes.imshow(image)
        for (name, places), mark in zip(points.items(), "x+1", strict=False):
            axes.plot(*places[i], mark, color="black", ms=9, mew=3)
            axes.plot(*places[i], mark, color="white", ms=8, mew=1.3, label=name)
        axes.set(title=title, xlim=(0, 159), ylim=(119, 0), xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
    legend = {"loc": "outside lower center", "ncols": 3, "frameon": True, "labelcolor": "white"}
    figure.legend(*grid.flat[0].get_legend_handles_labels(), facecolor=style.GREY, **legend)
    return style.closed(figure)


def components(
    parts: Mapping[str, Float[np.ndarray, " K"]], curves: Mapping[str, tuple], y_label: str
) -> Figure:
    """Stacked bars of `parts` (% of all variance) by component, and below them `curves` (x, y)."""
    figure, (bars, plot) = plt.subplots(2, 1, figsize=(style.WIDTH, 4.4))
    base = 0
    for (name, part), colour in zip(parts.items(), (style.ORANGE, style.GREY), strict=False):
        bars.bar(np.arange(1, len(part) + 1), part, bottom=base, color=colour, label=name)
        base = base + part
    bars.set(xlabel="component", ylabel="% of all variance")
    for (name, (x, y)), look in zip(curves.items(), ("-o", "--s", "-.^"), strict=False):
        plot.plot(x, y, look, ms=3.5, label=name)
    plot.set(xlabel="components kept, from the largest", ylabel=y_label, ylim=(0, 105))
    for axes in (bars, plot):
        axes.legend()
    return style.closed(figure)


def squeezed(
    images: Sequence[np.ndarray],
    codes: Float[np.ndarray, "M F"],
    drawn: Sequence[np.ndarray],
    names: Sequence[str],
) -> Figure:
    """Images, below each its code as bars (ten a colour channel), below that the reconstruction.

    Args:
        names: of the three rows.
    """
    size = (style.WIDTH, 0.6 + 8.4 / len(images))
    figure, grid = plt.subplots(3, len(images), figsize=size, height_ratios=(1, 0.6, 1))
    channels = np.repeat([style.RED, style.GREEN, style.BLUE], codes.shape[1] // 3)
    for column, image, code, made in zip(grid.T, images, codes, drawn, strict=True):
        column[0].imshow(image)
        column[1].bar(range(len(code)), code, color=channels, width=0.8)
        column[1].axhline(0, color=style.GREY, lw=0.6)
        column[1].set_ylim(codes.min(), codes.max())
        column[2].imshow(made)
    for axes in grid.flat:
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
        axes.grid(False)
    for axes, name in zip(grid[:, 0], names, strict=True):
        axes.set_title(name, loc="left")
    return style.closed(figure)


def funnel(
    stages: Sequence[tuple[str, tuple[int, ...]]], first: np.ndarray, last: np.ndarray
) -> Figure:
    """Layers from top to bottom; the wider a bar, the more numbers leave the layer.

    Args:
        stages: what each layer is, and the shape of what leaves it. The first one is the image.
        first, last: the image above, and the one below.
    """
    counts = [int(np.prod(shape)) for _, shape in stages]
    widths = np.sqrt(counts) / np.sqrt(max(counts))
    code = int(np.argmin(counts))
    figure = plt.figure(figsize=(style.WIDTH, 0.235 * len(stages) + 1.9))
    top, axes, bottom = figure.subplots(3, 1, height_ratios=(0.9, 0.235 * len(stages), 0.9))
    for i, ((layer, shape), count, width) in enumerate(zip(stages, counts, widths, strict=True)):
        colour = style.ORANGE if i == code else style.BLUE if i < code else style.GREEN
        axes.barh(i, width, left=-width / 2, height=0.72, color=colour)
        axes.text(-0.55, i, layer, ha="right", va="center")
        size = " x ".join(map(str, shape))
        axes.text(0.55, i, f"{size} = {count:,}" if len(shape) > 1 else size, va="center")
    axes.set(xlim=(-1.5, 1.5), ylim=(len(stages) - 0.4, -0.6))
    axes.set_axis_off()
    for picture, image in ((top, first), (bottom, last)):
        picture.imshow(image, cmap="gray", vmin=0, vmax=1)
        picture.set_axis_off()
    return style.closed(figure)

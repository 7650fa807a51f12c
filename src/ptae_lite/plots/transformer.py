"""Figures of chapter 03: the network and its signals, attention, answers, errors on one ruler.

Each function returns a closed matplotlib figure. A notebook shows it once, if it is the last line
of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from ptae_lite.data import signals
from ptae_lite.plots import style

LANGUAGE, ACTION, SHARED = style.ORANGE, style.SKY, style.GREEN
# boxes of the network: x, y, what it is, its shape, colour
BOXES = [
    (0, 4, "query tokens", "6 × 28", LANGUAGE), (2, 4, "keys: video, joints", "100 × 35", ACTION),
    (0, 3, "embed + position", "6 × 256", LANGUAGE), (2, 3, "embed", "100 × 256", ACTION),
    (1, 2, "attention, 4 heads", "6 × 100", SHARED), (1, 1, "code h", "256", SHARED),
    (0, 0, "language decoder", "4 × 23", LANGUAGE), (2, 0, "action decoder", "99 × 5", ACTION),
]  # fmt: skip
ARROWS = [(0, 2), (1, 3), (2, 4), (3, 4), (4, 5), (5, 6), (5, 7)]


def network() -> Figure:
    """PTAE as boxes with the shapes of one sample, from top to bottom."""
    figure, axis = plt.subplots(figsize=(style.WIDTH, 4.6))
    arrow = {"arrowstyle": "->", "color": style.GREY}
    for start, end in ARROWS:
        (x0, y0), (x1, y1) = BOXES[start][:2], BOXES[end][:2]
        aside = 0.25 * (x1 - x0)  # where the two columns meet and part
        axis.annotate("", (x1 - aside, y1 + 0.31), (x0 + aside, y0 - 0.31), arrowprops=arrow)
    axis.annotate("", (2, -0.31), (2, -0.7), arrowprops=arrow)
    axis.text(2, -0.76, "a frame of video (30)\nand the last pose (5)", ha="center", va="top")
    for x, y, name, shape, colour in BOXES:
        axis.add_patch(FancyBboxPatch(
            (x - 0.44, y - 0.27), 0.88, 0.54, boxstyle="round,pad=0.03", facecolor=colour,
            alpha=0.25, edgecolor=style.GREY,
        ))  # fmt: skip
        axis.text(x, y + 0.13, name, ha="center", va="center")
        axis.text(x, y - 0.15, shape, ha="center", va="center", weight="bold")
    axis.set(xlim=(-0.5, 2.5), ylim=(-1.25, 4.35))
    axis.axis("off")
    return style.closed(figure)


def wiring(shots: Sequence[np.ndarray], text: str) -> Figure:
    """What each signal of PTAE sees and must answer, as pictures.

    Args:
        shots: some images of a clip, in order.
        text: its sentence.
    """
    figure, axes = plt.subplots(4, 2, figsize=(style.WIDTH, 5.6))
    first, last = [shots[0]] * len(shots), [shots[-1]] * len(shots)
    choose = {"clip": list(shots), "first": first, "last": last}
    words = {"eos": "end", "sentence": text}
    for row, signal in zip(axes, signals.PTAE_SIGNALS, strict=True):
        wires = signals.WIRING[signal]
        moves = "the motion" if wires.joints == "clip" else "hold still"
        row[0].set_title(signal, loc="left", weight="bold", color=style.BLUE)
        row[1].set_title(f"query: {words[wires.query]}", loc="left", fontsize=9)
        for axis, wire, name, out in (
            (row[0], wires.keys, "keys", f"words: {words[wires.words]}"),
            (row[1], wires.video, "decoder's video", f"joints: {moves}"),
        ):
            axis.imshow(np.hstack(choose[wire]))
            axis.set_xlabel(name, loc="left", color=style.GREY)
            axis.text(0, -0.52, out, va="top", transform=axis.transAxes)
            axis.set(xticks=[], yticks=[])
            axis.grid(False)
            axis.spines[:].set_visible(False)
    return style.closed(figure)


def bars(rows: Mapping[str, float], label: str, chance: Sequence[float] = ()) -> Figure:
    """Percentages as bars below their names; a mark at the `chance` of each."""
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.52 * len(rows) + 0.7))
    axis.barh(range(len(rows)), rows.values(), color=style.BLUE, height=0.36)
    for y, (name, value) in enumerate(rows.items()):
        axis.text(0, y - 0.38, name, va="center")
        axis.text(min(value, 100) + 1, y, f"{value:.1f} %".replace(".0", ""), va="center")
    for y, level in enumerate(chance):
        for colour, width in (("white", 5), ("black", 2)):
            axis.plot([level, level], [y - 0.22, y + 0.22], color=colour, lw=width,
                      solid_capstyle="butt")  # fmt: skip
    if chance:
        axis.plot([], [], "|", color="black", ms=10, mew=2, label="chance")
        figure.legend(loc="outside lower center")
    axis.set(xlabel=label, xlim=(0, 117), ylim=(len(rows) - 0.65, -0.65), yticks=[])
    axis.set_xticks(range(0, 101, 20))
    axis.spines["left"].set_visible(False)  # it would cut the names
    return style.closed(figure)


def weighing(weights: Float[np.ndarray, "N T"]) -> Figure:
    """The weights of each query over some frames, as bars."""
    figure, axes = plt.subplots(1, len(weights), figsize=(style.WIDTH, 2.0), sharey=True)
    for number, (axis, row) in enumerate(zip(axes, weights, strict=True), start=1):
        axis.bar(range(1, len(row) + 1), row, color=style.BLUE)
        for x, value in enumerate(row, start=1):
            axis.text(x, value + 0.02, f"{value:.3f}", ha="center")
        axis.set(
            title=f"query {number}", xlabel="frame", xticks=range(1, len(row) + 1), ylim=(0, 1.2)
        )
    axes[0].set_ylabel("weight")
    return style.closed(figure)


def learning(losses: Sequence[float], floor: float, said: Mapping[int, str], truth: str) -> Figure:
    """The language loss by step, its floor, and what the network says of one clip on its way."""
    figure, axis = plt.subplots(figsize=(style.WIDTH, 3.6))
    axis.plot(np.arange(1, len(losses) + 1), losses, color=style.BLUE)
    axis.axhline(floor, color=style.RED, linestyle=":")
    axis.text(0, floor - 0.04, "what no network can avoid", color=style.ink(style.RED), va="top")
    top = max(losses)
    for place, (step, text) in enumerate(said.items()):  # each on a line of its own
        height = top * (1.5 - 0.13 * place)
        axis.plot([step, step], [losses[step - 1], height], color=style.GREY, linewidth=0.8)
        axis.plot(step, losses[step - 1], "o", color=style.BLUE, markersize=4)
        left = step < 0.6 * len(losses)
        axis.text(step, height, f'  "{text}"  ', va="center", ha="left" if left else "right")
    axis.set(xlabel="update", ylabel="language loss", title=f'the clip shows "{truth}"',
             ylim=(0, 1.6 * top))  # fmt: skip
    return style.closed(figure)


def clip_attention(
    weights: Float[np.ndarray, "heads N T"], tokens: Sequence[str], frames: int,
    shots: Mapping[int, np.ndarray], padding: str = "zeros",
) -> Figure:  # fmt: skip
    """Attention of each head and token under thumbnails of the clip.

    Args:
        frames: length of the clip; what follows is padding.
        shots: images by frame number.
        padding: what it is.
    """
    heads, total = len(weights), weights.shape[2]
    rows = [(h, n) for h in range(heads) for n in range(len(tokens))]
    size = (style.WIDTH, 4.0)
    figure, (top, below) = plt.subplots(2, 1, figsize=size, height_ratios=(1, 5), sharex=True)
    wide = frames / len(shots)
    for place, image in enumerate(shots.values()):
        top.imshow(image, extent=(place * wide, (place + 1) * wide, 0, 1), aspect="auto")
    if frames < total:
        top.text((frames + total) / 2, 0.5, f"padding: {padding}", ha="center", va="center")
    shown = np.stack([weights[h, n] for h, n in rows])
    picture = below.imshow(shown, aspect="auto", cmap="Blues", vmin=0,
                           extent=(0, total, len(rows), 0))  # fmt: skip
    for y, behind in enumerate(shown[:, frames:].sum(1)):
        if behind > 0.05 and frames < total:
            below.text((frames + total) / 2, y + 0.5, f"{100 * behind:.0f} % of the weight",
                       ha="center", va="center")  # fmt: skip
    below.set_yticks(np.arange(len(rows)) + 0.5,
                     [f"{h + 1}, {tokens[n]}" for h, n in rows])  # fmt: skip
    for axis in (top, below):
        axis.axvline(frames, color=style.RED, linestyle=":")
        axis.set_xlim(0, total)
        axis.grid(False)
    top.set_yticks([])
    below.set(xlabel="frame", ylabel="head and token")
    figure.colorbar(picture, ax=below, label="weight", location="bottom", aspect=40)
    return style.closed(figure)


def ruler(knows: Mapping[str, float], taken: Mapping[str, float]) -> Figure:
    """NRMSE of references, of a model and of its controls, from the smallest to the largest.

    Args:
        knows: references, by what they know.
        taken: the model as trained, and with inputs taken away.
    """
    groups = (("without a network", "s", style.GREY, knows), ("PTAE", "o", style.BLUE, taken))
    rows = [(value, name, *look) for _, *look, group in groups for name, value in group.items()]
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.4 * len(rows) + 0.9))
    for y, (value, name, mark, colour) in enumerate(sorted(rows)):
        axis.text(0, y - 0.42, name, va="center", color=colour)
        axis.plot([0, value], [y, y], color=colour, lw=1.2)
        axis.plot(value, y, mark, color=colour, ms=6)
        axis.annotate(f"{value:.1f}", (value, y), (6, 0), textcoords="offset points", va="center",
                      color=colour)  # fmt: skip
    for label, mark, colour, _ in groups:
        axis.plot([], [], mark, color=colour, label=label)
    figure.legend(loc="outside lower center", ncols=2)
    axis.set(xlabel="NRMSE, % of each joint's range", ylim=(len(rows) - 0.6, -0.8), yticks=[],
             xlim=(0, 1.12 * max(rows)[0]))  # fmt: skip
    axis.spines["left"].set_visible(False)
    return style.closed(figure)


def reaching(reached: pd.DataFrame) -> Figure:
    """When describe accuracy came to stay at some levels: a dot for each seed, level and variant.

    Args:
        reached: `updates_to` of two variants, with the percentage asked for as `level`.
    """
    levels, variants = reached["level"].unique().tolist(), sorted(reached["variant"].unique())
    looks = ((0.15, "s"), (-0.15, "o"))
    size = (style.WIDTH, 0.5 * len(levels) + 1.2)
    figure, axes = plt.subplots(1, 2, figsize=size, sharey=True)
    for axis, column in zip(axes, ("updates", "seconds"), strict=True):
        for (shift, marker), name in zip(looks, variants, strict=True):
            rows = reached[reached["variant"] == name]
            axis.plot(rows[column], rows["level"].map(levels.index) + shift, marker, alpha=0.8,
                      color=style.of_model(name), markersize=6, label=name)  # fmt: skip
        axis.set(xlabel="updates" if column == "updates" else "seconds of one core", xlim=(0, None))
        axis.locator_params(axis="x", nbins=4)
    axes[0].set_yticks(range(len(levels)), [f"{level} %" for level in levels])
    axes[0].set(ylim=(len(levels) - 0.5, -0.5), ylabel="describe stays at")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)

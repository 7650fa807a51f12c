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
    (0, 2, "query tokens", "6 × 28", LANGUAGE), (0, 0, "keys: video, joints", "100 × 35", ACTION),
    (1, 2, "embed + position", "6 × 256", LANGUAGE), (1, 0, "embed", "100 × 256", ACTION),
    (2, 1, "attention", "4 heads\n6 × 100", SHARED), (3, 1, "code h", "256", SHARED),
    (4, 2, "language decoder", "4 × 23", LANGUAGE), (4, 0, "action decoder", "99 × 5", ACTION),
]  # fmt: skip
ARROWS = [(0, 2), (1, 3), (2, 4), (3, 4), (4, 5), (5, 6), (5, 7)]


def network() -> Figure:
    """PTAE as boxes with the shapes of one sample."""
    figure, axis = plt.subplots(figsize=(8.4, 3.3))
    for start, end in ARROWS:
        (x0, y0), (x1, y1) = BOXES[start][:2], BOXES[end][:2]
        axis.annotate("", (x1 - 0.4, y1), (x0 + 0.4, y0), arrowprops={
            "arrowstyle": "->", "color": style.GREY,
        })  # fmt: skip
    axis.annotate("", (4, -0.38), (4, -0.95), arrowprops={"arrowstyle": "->", "color": style.GREY})
    axis.text(4, -1.15, "a frame of video (30)\nand the last pose (5)", ha="center", va="center")
    for x, y, name, shape, colour in BOXES:
        axis.add_patch(FancyBboxPatch(
            (x - 0.38, y - 0.34), 0.76, 0.68, boxstyle="round,pad=0.02", facecolor=colour,
            alpha=0.25, edgecolor=style.GREY,
        ))  # fmt: skip
        axis.text(x, y + 0.1, name.replace(" ", "\n", 1), ha="center", va="center", fontsize=8.5)
        axis.text(x, y - 0.3, shape.split("\n")[-1], ha="center", va="bottom", weight="bold")
    axis.text(2, 1.42, "4 heads", ha="center", color=style.GREY)
    axis.set(xlim=(-0.5, 4.5), ylim=(-1.5, 2.5))
    axis.axis("off")
    return style.closed(figure)


def wiring(shots: Sequence[np.ndarray], text: str) -> Figure:
    """What each signal of PTAE sees and must answer, as pictures.

    Args:
        shots: some images of a clip, in order.
        text: its sentence.
    """
    columns = ("query", "keys", "decoder's video", "words out", "joints out")
    figure, axes = plt.subplots(4, 5, figsize=(7.4, 3.8), width_ratios=(1.1, 2, 2, 0.7, 0.9))
    first, last = [shots[0]] * len(shots), [shots[-1]] * len(shots)
    choose = {"clip": list(shots), "first": first, "last": last}
    words = {"eos": "end", "sentence": text.replace(" ", "\n")}
    for row, signal in zip(axes, signals.PTAE_SIGNALS, strict=True):
        wires = signals.WIRING[signal]
        query = text.replace(" ", "\n") if wires.query == "sentence" else "end"
        row[0].text(0.5, 1, signal, ha="center", va="top", weight="bold", color=style.BLUE)
        row[0].text(0.5, 0.8, query, ha="center", va="top")
        row[1].imshow(np.hstack(choose[wires.keys]))
        row[2].imshow(np.hstack(choose[wires.video]))
        row[3].text(0.5, 1, words[wires.words], ha="center", va="top")
        moves = "the motion" if wires.joints == "clip" else "hold still"
        row[4].text(0.5, 1, moves, ha="center", va="top")
        for axis in row:
            axis.set_anchor("N")
            axis.set(xticks=[], yticks=[])
            axis.grid(False)
            axis.spines[:].set_visible(False)
    for axis, name in zip(axes[0], columns, strict=True):
        axis.set_title(name)
    return style.closed(figure)


def bars(rows: Mapping[str, float], label: str, chance: Sequence[float] = ()) -> Figure:
    """Percentages as horizontal bars with their values; a dotted line at the `chance` of each."""
    figure, axis = plt.subplots(figsize=(7, 0.38 * len(rows) + 0.7))
    axis.barh(range(len(rows)), rows.values(), color=style.BLUE, height=0.6)
    for y, value in enumerate(rows.values()):
        axis.text(min(value, 100) + 1, y, f"{value:.1f} %".replace(".0", ""), va="center")
    for y, level in enumerate(chance):
        axis.plot([level, level], [y - 0.45, y + 0.45], color=style.RED, linestyle=":")
    axis.set_yticks(range(len(rows)), rows)
    axis.invert_yaxis()
    axis.set(xlabel=label, xlim=(0, 112))
    axis.grid(axis="y", visible=False)
    return style.closed(figure)


def weighing(weights: Float[np.ndarray, "N T"]) -> Figure:
    """The weights of each query over some frames, as bars."""
    figure, axes = plt.subplots(1, len(weights), figsize=(6, 1.9), sharey=True)
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
    figure, axis = plt.subplots(figsize=(7.4, 3.6))
    axis.plot(np.arange(1, len(losses) + 1), losses, color=style.BLUE)
    axis.axhline(floor, color=style.RED, linestyle=":")
    axis.text(0, floor - 0.04, "what no network can avoid", color=style.RED, va="top")
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
    shots: Mapping[int, np.ndarray],
) -> Figure:  # fmt: skip
    """Attention of each head and token under thumbnails of the clip.

    Args:
        frames: length of the clip; what follows is padding.
        shots: images by frame number.
    """
    heads, total = len(weights), weights.shape[2]
    rows = [(h, n) for h in range(heads) for n in range(len(tokens))]
    figure, (top, below) = plt.subplots(2, 1, figsize=(8, 3.8), height_ratios=(1, 2.6), sharex=True)
    wide = frames / len(shots)
    for place, image in enumerate(shots.values()):
        top.imshow(image, extent=(place * wide, (place + 1) * wide, 0, 1), aspect="auto")
    top.text((frames + total) / 2, 0.5, "padding: zeros", ha="center", va="center")
    shown = np.stack([weights[h, n] for h, n in rows])
    picture = below.imshow(shown, aspect="auto", cmap="Blues", vmin=0,
                           extent=(0, total, len(rows), 0))  # fmt: skip
    for y, behind in enumerate(shown[:, frames:].sum(1)):
        if behind > 0.05:
            below.text((frames + total) / 2, y + 0.5, f"{100 * behind:.0f} % of the weight",
                       ha="center", va="center")  # fmt: skip
    below.set_yticks(np.arange(len(rows)) + 0.5,
                     [f"head {h + 1}, {tokens[n]}" for h, n in rows])  # fmt: skip
    for axis in (top, below):
        axis.axvline(frames, color=style.RED, linestyle=":")
        axis.set_xlim(0, total)
        axis.grid(False)
    top.set_yticks([])
    below.set_xlabel("frame")
    figure.colorbar(picture, ax=below, label="weight")
    return style.closed(figure)


def ruler(knows: Mapping[str, float], taken: Mapping[str, float]) -> Figure:
    """NRMSE of references above one line, of a model and its controls below it.

    Args:
        knows: references, by what they know.
        taken: the model as trained, and with inputs taken away.
    """
    figure, axis = plt.subplots(figsize=(8.6, 4.4))
    axis.axhline(0, color=style.GREY, linewidth=1)
    for side, rows, colour in ((1, knows, style.GREY), (-1, taken, style.BLUE)):
        for level, (name, value) in enumerate(sorted(rows.items(), key=lambda row: -row[1])):
            height = side * (0.6 + 0.55 * level)
            axis.plot([value, value], [0, height], color=colour, linewidth=0.8)
            axis.plot(value, 0, "o", color=colour)
            right = value > 0.6 * max(*knows.values(), *taken.values())
            axis.text(value, height, f"  {name}, {value:.1f} %  ", color=colour, va="center",
                      ha="right" if right else "left")  # fmt: skip
    tallest = 0.9 + 0.55 * max(len(knows), len(taken))
    axis.text(0, tallest, "without a network", weight="bold", color=style.GREY)
    axis.text(0, -tallest, "PTAE, execute", weight="bold", color=style.BLUE)
    axis.set(xlabel="NRMSE, % of each joint's range", ylim=(-tallest - 0.3, tallest + 0.4),
             xlim=(0, None), yticks=[])  # fmt: skip
    axis.spines["left"].set_visible(False)
    axis.grid(axis="y", visible=False)
    return style.closed(figure)


def reaching(reached: pd.DataFrame) -> Figure:
    """When describe accuracy came to stay at some levels: a dot for each seed, level and variant.

    Args:
        reached: `updates_to` of two variants, with the percentage asked for as `level`.
    """
    levels, variants = reached["level"].unique().tolist(), sorted(reached["variant"].unique())
    looks = ((0.15, "s", style.ORANGE), (-0.15, "o", style.BLUE))
    figure, axes = plt.subplots(1, 2, figsize=(7.4, 0.5 * len(levels) + 1.2), sharey=True)
    for axis, column in zip(axes, ("updates", "seconds"), strict=True):
        for (shift, marker, colour), name in zip(looks, variants, strict=True):
            rows = reached[reached["variant"] == name]
            axis.plot(rows[column], rows["level"].map(levels.index) + shift, marker, color=colour,
                      alpha=0.8, markersize=6, label=name)  # fmt: skip
        axis.set(xlabel="updates" if column == "updates" else "seconds of one core", xlim=(0, None))
        axis.locator_params(axis="x", nbins=6)
    axes[0].set_yticks(range(len(levels)), [f"{level} %" for level in levels])
    axes[0].set(ylim=(len(levels) - 0.5, -0.5), ylabel="describe stays at")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return style.closed(figure)

"""Figures of the models: the family, joints, attention and learning.

Each function returns a closed matplotlib figure. A notebook shows it once, if it is the last line
of a cell.
"""

from __future__ import annotations

import textwrap

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from matplotlib.ticker import LogLocator, NullLocator

from ptae_lite.plots import style
from ptae_lite.plots.simulation import joint_panels

WORDS, CLIP, SHARED = style.ORANGE, style.SKY, style.GREEN
# For each model, oldest first: boxes (x, y, text, colour), arrows between them, and one sentence.
# x: 0 input, 1 encoder, 2 where the modalities meet, 3 decoder; y: 1 language, 0 action.
_ENCODERS = [(1, 1, "LSTM", WORDS), (1, 0, "LSTM", CLIP)]
_STRAIGHT = [((0, 1), (1, 1)), ((0, 0), (1, 0))]
_TO_DECODERS = [((2, 0.5), (3, 1)), ((2, 0.5), (3, 0))]
FAMILY = {
    "PRAE": (
        [*_ENCODERS, (2, 1, "code", WORDS), (2, 0, "code", CLIP)],
        [*_STRAIGHT, ((1, 1), (2, 1)), ((1, 0), (2, 0)), ((2, 1), (3, 1)), ((2, 0), (3, 0))],
        "Two autoencoders. Binding pulls the two codes of a pair together.",
    ),
    "PVAE": (
        [*_ENCODERS, (2, 1, "code\n± chance", WORDS), (2, 0, "code\n± chance", CLIP)],
        [*_STRAIGHT, ((1, 1), (2, 1)), ((1, 0), (2, 0)), ((2, 1), (3, 1)), ((2, 0), (3, 0))],
        "The same, but a code is a cloud: one clip may be said in eight ways.",
    ),
    "PGAE": (
        [*_ENCODERS, (2, 0.5, "gated\nunit", SHARED)],
        [*_STRAIGHT, ((1, 1), (2, 0.5)), ((1, 0), (2, 0.5)), *_TO_DECODERS],
        "One code. Gates mix the two sides; a signal word names the task.",
    ),
    "PTAE": (
        [(1, 1, "query", WORDS), (1, 0, "keys,\nvalues", CLIP), (2, 0.5, "attention", SHARED)],
        [*_STRAIGHT, ((1, 1), (2, 0.5)), ((1, 0), (2, 0.5)), *_TO_DECODERS],
        "Words query frames: attention replaces the gates and two LSTMs.",
    ),
}


def trajectories(
    truth: Float[np.ndarray, "T 5"], predicted: dict[str, np.ndarray], title: str = ""
) -> Figure:
    """The five joints over a clip, in degrees: the recorded ones in grey, predictions over them."""
    figure, axes = joint_panels("frame")
    looks = (("-", style.BLUE), ("--", style.ORANGE), (":", style.RED))
    for j, axis in enumerate(axes):
        axis.plot(np.degrees(truth[:, j]), color="#BBBBBB", linewidth=4, label="recorded")
        for (name, joints), (line, colour) in zip(predicted.items(), looks, strict=False):
            axis.plot(np.degrees(joints[: len(truth), j]), line, color=colour, label=name)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.suptitle(title, fontsize=10)
    return style.closed(figure)


def attention_map(
    weights: Float[np.ndarray, "heads N T"], tokens: list[str], frames: int, title: str = ""
) -> Figure:
    """Where each head attends: a picture for each head, tokens down, frames across.

    Args:
        frames: clip length; a dotted line marks it.
    """
    rows = -(-len(weights) // 2)
    figure, axes = plt.subplots(
        rows, 2, figsize=(style.WIDTH, 2.0 * rows + 0.7), sharex=True, sharey=True
    )
    for head, axis in enumerate(axes.flat):
        picture = axis.imshow(
            weights[head, : len(tokens)], aspect="auto", cmap="Blues", vmin=0, vmax=weights.max()
        )
        axis.axvline(frames - 0.5, color=style.RED, linewidth=1, linestyle=":")
        axis.set_title(f"head {head + 1}")
        axis.set_yticks(range(len(tokens)), tokens)
        axis.grid(False)
    for axis in axes[-1]:
        axis.set_xlabel("frame")
    figure.colorbar(picture, ax=axes, label="weight", location="bottom", aspect=40)
    figure.suptitle(title, fontsize=10)
    return style.closed(figure)


def learning_curve(history: Float[np.ndarray, "epochs 2"], title: str = "") -> Figure:
    """Language and action loss by epoch, on logarithmic scales."""
    figure, axes = plt.subplots(1, 2, figsize=(style.WIDTH, 2.4))
    for axis, values, name in zip(axes, np.asarray(history).T, ("language", "action"), strict=True):
        axis.semilogy(np.arange(1, len(values) + 1), values)
        axis.yaxis.set_major_locator(LogLocator(subs=(1, 3)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_locator(NullLocator())
        axis.set_title(f"{name} loss")
        axis.set_xlabel("epoch")
    figure.suptitle(title, fontsize=10)
    return style.closed(figure)


def family(sizes: dict[str, int] | None = None) -> Figure:
    """PRAE, PVAE, PGAE and PTAE as block diagrams.

    Args:
        sizes: number of parameters of each, to be written beside its name.
    """
    figure, axes = plt.subplots(4, 1, figsize=(style.WIDTH, 7.6))
    for axis, (name, (boxes, arrows, sentence)) in zip(axes.flat, FAMILY.items(), strict=True):
        signal = "\n+ signal" if name in ("PGAE", "PTAE") else ""
        ends = [(0, 1, f"words{signal}", WORDS), (0, 0, "video,\njoints", CLIP),
                (3, 1, "LSTM to\nwords", WORDS), (3, 0, "LSTM to\njoints", CLIP)]  # fmt: skip
        for start, end in arrows:
            axis.annotate("", end, start, arrowprops={
                "arrowstyle": "->", "color": style.GREY, "shrinkA": 26, "shrinkB": 28,
            })  # fmt: skip
        if name in ("PRAE", "PVAE"):
            axis.annotate("", (2, 0.25), (2, 0.75), arrowprops={
                "arrowstyle": "<->", "color": style.RED, "linestyle": "--",
            })  # fmt: skip
            axis.text(2.07, 0.5, "bound", color=style.RED, va="center")
        for x, y, text, colour in [*boxes, *ends]:
            axis.add_patch(FancyBboxPatch(
                (x - 0.34, y - 0.15), 0.68, 0.3, boxstyle="round,pad=0.02",
                facecolor=colour, alpha=0.3 if 0 < x < 3 else 0.12, edgecolor=style.GREY,
            ))  # fmt: skip
            axis.text(x, y, text, ha="center", va="center", fontsize=8.5)
        axis.set(xlim=(-0.45, 3.45), ylim=(-0.65, 1.35))
        axis.axis("off")
        axis.set_title(name, weight="bold", loc="left")
        if sizes:
            axis.set_title(f"{sizes[name]:,} parameters", loc="right", fontsize=9)
        axis.text(1.5, -0.3, textwrap.fill(sentence, 45), ha="center", va="top", color=style.GREY)
    return style.closed(figure)


def convergence(curves: pd.DataFrame, variants: list[str]) -> Figure:
    """Describe accuracy during training, by updates and by seconds of computing, a line a seed.

    Args:
        curves: the table `family_curves.csv`.
        variants: the ones to draw. A long training of a model drawn before it is dashed.
    """
    figure, axes = plt.subplots(2, 1, figsize=(style.WIDTH, 4.4), sharey=True)
    for axis, column in zip(axes, ("updates", "seconds"), strict=True):
        for k, name in enumerate(variants):
            colour = style.of_model(name)
            again = colour in map(style.of_model, variants[:k])
            lines = curves[curves["variant"] == name].groupby("seed")
            for i, (_, line) in enumerate(lines):
                axis.plot(line[column], line["describe_accuracy"], color=colour, alpha=0.8,
                          ls="--" if again else "-", linewidth=1.2,
                          label=None if i else name)  # fmt: skip
        axis.set_xlabel("updates" if column == "updates" else "seconds of one core")
        axis.set(ylabel="describe accuracy, %", ylim=(-3, 103))
        axis.locator_params(axis="x", nbins=6)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)


def choices(table: pd.DataFrame, variants: list[str]) -> Figure:
    """Describe accuracy and execute error of each variant: a dot a seed, a bar at the median.

    Arrows point to the better side.
    """
    size = (style.WIDTH, 0.5 * len(variants) + 0.7)
    figure, axes = plt.subplots(1, 2, figsize=size, sharey=True)
    figure.get_layout_engine().set(wspace=0.12)  # two axes, not one
    columns = {"describe_accuracy": "describe\naccuracy, % →",
               "execute_nrmse": "execute\nNRMSE, % ←"}  # fmt: skip
    for axis, (column, label) in zip(axes, columns.items(), strict=True):
        for y, name in enumerate(variants):
            values, colour = table[table["variant"] == name][column], style.of_model(name)
            axis.plot(values, [y] * len(values), "o", color=colour, alpha=0.6, markersize=6)
            axis.plot(values.median(), y, "|", color="black", markersize=14, markeredgewidth=2)
        axis.set(title=label, yticks=[], ylim=(len(variants) - 0.6, -0.8))
        axis.spines["left"].set_visible(axis is axes[1])
    for y, name in enumerate(variants):
        axes[0].text(0, y - 0.38, name, va="center", transform=axes[0].get_yaxis_transform())
    return style.closed(figure)

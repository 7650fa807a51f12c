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

from ptae_lite.plots import style
from ptae_lite.robot.arm import JOINT_NAMES

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
    figure, axes = plt.subplots(1, 5, figsize=(9.5, 2.2), sharex=True)
    looks = (("-", style.BLUE), ("--", style.ORANGE), (":", style.RED))
    for j, axis in enumerate(axes):
        axis.plot(np.degrees(truth[:, j]), color="#BBBBBB", linewidth=4, label="recorded")
        for (name, joints), (line, colour) in zip(predicted.items(), looks, strict=False):
            axis.plot(np.degrees(joints[: len(truth), j]), line, color=colour, label=name)
        axis.set_title(JOINT_NAMES[j])
    axes[0].set_ylabel("degrees")
    axes[2].set_xlabel("frame")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.suptitle(title, fontsize=10)
    return style.closed(figure)


def attention_map(
    weights: Float[np.ndarray, "heads N T"], tokens: list[str], frames: int, title: str = ""
) -> Figure:
    """Where each head attends: a picture for each head, tokens down, frames across.

    Args:
        frames: clip length; a dotted line marks it.
    """
    figure, axes = plt.subplots(1, len(weights), figsize=(8.2, 2), sharey=True)
    for head, axis in enumerate(axes):
        picture = axis.imshow(
            weights[head, : len(tokens)], aspect="auto", cmap="viridis", vmin=0, vmax=weights.max()
        )
        axis.axvline(frames - 0.5, color="white", linewidth=1, linestyle=":")
        axis.set_title(f"head {head + 1}")
        axis.set_xlabel("frame")
        axis.set_yticks(range(len(tokens)), tokens)
        axis.grid(False)
    figure.colorbar(picture, ax=axes, label="weight")
    figure.suptitle(title, fontsize=10)
    return style.closed(figure)


def learning_curve(history: Float[np.ndarray, "epochs 2"], title: str = "") -> Figure:
    """Language and action loss by epoch, on logarithmic scales."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.4))
    for axis, values, name in zip(axes, np.asarray(history).T, ("language", "action"), strict=True):
        axis.semilogy(np.arange(1, len(values) + 1), values)
        axis.set_title(f"{name} loss")
        axis.set_xlabel("epoch")
    figure.suptitle(title, fontsize=10)
    return style.closed(figure)


def family(sizes: dict[str, int] | None = None) -> Figure:
    """PRAE, PVAE, PGAE and PTAE as block diagrams.

    Args:
        sizes: number of parameters of each, to be written beside its name.
    """
    figure, axes = plt.subplots(2, 2, figsize=(8.2, 5.4))
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
            axis.text(2.07, 0.5, "bound", color=style.RED, va="center", fontsize=8)
        for x, y, text, colour in [*boxes, *ends]:
            axis.add_patch(FancyBboxPatch(
                (x - 0.3, y - 0.13), 0.6, 0.26, boxstyle="round,pad=0.02",
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


def convergence(curves: pd.DataFrame, variants: dict[str, str]) -> Figure:
    """Describe accuracy during training, by updates and by seconds of computing, a line a seed.

    Args:
        curves: the table `family_curves.csv`.
        variants: the variants to draw, each with its colour.
    """
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 2.9), sharey=True)
    for axis, column in zip(axes, ("updates", "seconds"), strict=True):
        for name, colour in variants.items():
            lines = curves[curves["variant"] == name].groupby("seed")
            for i, (_, line) in enumerate(lines):
                axis.plot(line[column], line["describe_accuracy"], color=colour, alpha=0.8,
                          linewidth=1.2, label=None if i else name)  # fmt: skip
        axis.set_xlabel("updates" if column == "updates" else "seconds of one core")
        axis.locator_params(axis="x", nbins=6)
    axes[0].set(ylabel="describe accuracy, %", ylim=(-3, 103))
    axes[0].legend()
    return style.closed(figure)


def choices(table: pd.DataFrame, variants: list[str]) -> Figure:
    """Describe accuracy and execute error of each variant: a dot a seed, a bar at the median."""
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 0.32 * len(variants) + 0.9), sharey=True)
    for axis, column in zip(axes, ("describe_accuracy", "execute_nrmse"), strict=True):
        for y, name in enumerate(variants):
            values = table[table["variant"] == name][column]
            axis.plot(values, [y] * len(values), "o", color=style.BLUE, alpha=0.6, markersize=5)
            axis.plot(values.median(), y, "|", color=style.RED, markersize=14, markeredgewidth=2)
    axes[0].set_yticks(range(len(variants)), variants)
    axes[0].invert_yaxis()
    axes[0].set_xlabel("describe accuracy, %")
    axes[1].set_xlabel("execute NRMSE, %")
    return style.closed(figure)

"""Figures of the family: what each model is made of, how it learns, and what the choices did."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from ptae_lite.plots import style

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
        "Words ask, frames answer: attention in place of the gates and of two LSTMs.",
    ),
}


def family() -> Figure:
    """PRAE, PVAE, PGAE and PTAE as block diagrams, one below the other's name."""
    figure, axes = plt.subplots(2, 2, figsize=(9.5, 5.2))
    for axis, (name, (boxes, arrows, sentence)) in zip(axes.flat, FAMILY.items(), strict=True):
        signal = "\n+ signal" if name in ("PGAE", "PTAE") else ""
        ends = [(0, 1, f"words{signal}", WORDS), (0, 0, "film,\njoints", CLIP),
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
            axis.text(x, y, text, ha="center", va="center", fontsize=7.5)
        axis.set(xlim=(-0.45, 3.45), ylim=(-0.55, 1.35))
        axis.axis("off")
        axis.set_title(name, weight="bold", loc="left")
        axis.text(1.5, -0.42, sentence, ha="center", fontsize=8, color=style.GREY)
    return style.closed(figure)


def convergence(curves: pd.DataFrame, variants: dict[str, str]) -> Figure:
    """Describe accuracy while training, by updates and by seconds of computing, a line a seed.

    Args:
        curves: the table `family_curves.csv`.
        variants: which to draw, each with its colour.
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

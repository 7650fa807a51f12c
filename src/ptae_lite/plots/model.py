"""Figures of joints, attention and learning.

Data in, a matplotlib figure out, off pyplot's list: a notebook shows it where it is a cell's last
line.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from ptae_lite.plots import style
from ptae_lite.robot.arm import JOINT_NAMES


def trajectories(
    truth: Float[np.ndarray, "T 5"], predicted: dict[str, np.ndarray], title: str = ""
) -> Figure:
    """The five joints over the clip, in degrees: the truth in grey, predictions over it."""
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
    """Where each head looks: one picture a head, tokens down, frames across."""
    figure, axes = plt.subplots(1, len(weights), figsize=(9.5, 1.7), sharey=True)
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

"""Figures of joints, attention, learning and results.

Data in, a matplotlib figure out, off pyplot's list: a notebook shows it where it is a cell's last
line.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from ptae_lite.display import style
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


def by_share(table: pd.DataFrame, paper: dict, chance: float) -> Figure:
    """Describe accuracy and execute error over the share of labelled samples.

    `paper` holds the numbers that the paper's text states, by share.
    """
    figure, axes = plt.subplots(1, 2, figsize=(7.5, 2.9))
    _draw_shares(axes, table, paper, chance)
    return style.closed(figure)


def share_card(table, said: pd.DataFrame, paper: dict, chance: float, share: float) -> Figure:
    """The figure of `by_share` with one share marked, and what its model says of some clips."""
    figure = plt.figure(figsize=(7.5, 4.6))
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 2))
    axes = [figure.add_subplot(grid[0, column]) for column in range(2)]
    _draw_shares(axes, table, paper, chance, mark=share)
    text = figure.add_subplot(grid[1, :])
    text.axis("off")
    for x, heading in ((0, "the clip shows"), (0.36, "the model says")):
        text.text(x, 0.95, heading, fontsize=8, color=style.GREY, transform=text.transAxes)
    for line, row in enumerate(said.itertuples(), start=1):
        look = {"family": "monospace", "fontsize": 8, "transform": text.transAxes}
        colour, verdict = (style.BLUE, "right") if row.right else (style.RED, "WRONG")
        y = 0.95 - line / (len(said) + 1.5)
        text.text(0, y, f"{row.truth}", **look)
        text.text(0.36, y, f"{verdict}   {row.said}", color=colour, **look)
    return style.closed(figure)


def _draw_shares(axes, table, paper, chance, mark: float | None = None) -> None:
    table = table.sort_values("share")
    for axis, column in zip(axes, ("describe_accuracy", "execute_nrmse"), strict=True):
        axis.plot(table["share"], table[column], "o-", label="ours, one seed")
        if mark is not None:
            here = table[table["share"] == mark]
            axis.plot(here["share"], here[column], "s", markersize=12, color=style.RED,
                      fillstyle="none", markeredgewidth=2)  # fmt: skip
        axis.set_xscale("log")
        axis.set_xticks(table["share"])
        axis.xaxis.set_major_formatter(ScalarFormatter())
        axis.minorticks_off()
        axis.set_xlabel("labelled samples, %")
    axes[0].plot(list(paper), [claim.value for claim in paper.values()], "^", color=style.GREY,
                 fillstyle="none", label="stated in the paper's text")  # fmt: skip
    axes[0].axhline(chance, color=style.GREY, linestyle=":", label="chance")
    axes[0].set(ylabel="describe accuracy, %", ylim=(-3, 105))
    axes[1].set(ylabel="execute NRMSE, %", ylim=(0, None))
    legend = axes[0].get_legend_handles_labels()
    axes[0].figure.legend(*legend, loc="outside upper center", ncols=3)


def by_conflicts(table: pd.DataFrame, paper: dict) -> Figure:
    """The four signals over the number of conflicts; small dots are single choices of aspects."""
    figure, axes = plt.subplots(2, 2, figsize=(7.5, 4.4), sharex=True)
    for axis, (signal, rows) in zip(axes.T.flat, table.groupby("signal", sort=False), strict=True):
        column = "accuracy" if rows["accuracy"].notna().all() else "nrmse"
        control = rows[rows["conflict_in"] == "congruent"]
        rows = rows.drop(control.index)
        mean = rows.groupby("conflicts")[column].mean()
        axis.plot(rows["conflicts"], rows[column], ".", color=style.SKY, label="one choice")
        axis.plot(mean.index, mean, "o-", color=style.BLUE, label="mean of choices")
        if len(control):
            axis.plot(0, control[column], "D", color=style.ORANGE, label="congruent extra input")
        axis.plot(3, paper[signal].value, "^", color=style.GREY, fillstyle="none",
                  label="paper's text, 3 conflicts")  # fmt: skip
        axis.set_title(f"{signal} (conflict in {rows['conflict_in'].iloc[-1]})")
        axis.set(ylabel="accuracy, %" if column == "accuracy" else "NRMSE, %",
                 ylim=(-3, 105) if column == "accuracy" else (0, None),
                 xticks=range(4))  # fmt: skip
    for axis in axes[-1]:
        axis.set_xlabel("conflicts")
    axes[0, 0].legend(fontsize=8, loc="lower left")
    return style.closed(figure)


def answer_card(heading: str, asked: str, answer: str, right: bool) -> Figure:
    """What was asked for and what was said, and whether it is right."""
    figure, axis = plt.subplots(figsize=(7.5, 1.5))
    axis.axis("off")
    axis.text(0, 0.85, heading, transform=axis.transAxes, fontsize=9, color=style.GREY)
    axis.text(0, 0.5, f"asked for   {asked}", transform=axis.transAxes, family="monospace")
    verdict = "right" if right else "wrong"
    axis.text(0, 0.18, f"answer      {answer or '(nothing)'}", transform=axis.transAxes,
              family="monospace", color=style.BLUE if right else style.RED)  # fmt: skip
    axis.text(1, 0.18, verdict, transform=axis.transAxes, ha="right", weight="bold",
              color=style.BLUE if right else style.RED)  # fmt: skip
    return style.closed(figure)

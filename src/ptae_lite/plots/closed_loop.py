"""Figures of the closed loop: success by model, success by joint error, and rows of images."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ptae_lite import artefacts
from ptae_lite.experiments.episodes import STRIPS
from ptae_lite.plots import style


def by_model(rates: pd.DataFrame, models: dict[str, str], references: dict[str, float]) -> Figure:
    """Success of each model: a dot for each training, a bar at the median.

    Args:
        rates: columns `model`, `seed` and `success` in percent.
        models: the models from top to bottom, with their labels.
        references: dotted lines: label to percent.
    """
    figure, axis = plt.subplots(figsize=(7.5, 0.42 * len(models) + 0.9))
    for y, model in enumerate(models):
        values = rates[rates["model"] == model]["success"].to_numpy()
        axis.barh(y, np.median(values), color=style.SKY, height=0.6)
        axis.plot(values, np.full(len(values), y), "o", color=style.BLUE, markersize=5)
    for (name, value), place in zip(references.items(), ("left", "right"), strict=False):
        axis.axvline(value, color=style.GREY, linestyle=":")
        axis.text(value, -0.75, f" {name} ", color=style.GREY, fontsize=8, ha=place)
    axis.set_yticks(range(len(models)), models.values())
    axis.set(xlim=(-1, 101), ylim=(len(models) - 0.5, -0.95), xlabel="success in the loop, %")
    axis.grid(axis="y", visible=False)
    return style.closed(figure)


def error_against_success(rates: pd.DataFrame, scores: pd.DataFrame) -> Figure:
    """Each training: its execute NRMSE as in chapter 03, and its success in the loop."""
    both = rates.merge(scores, on=["model", "seed"])
    figure, axis = plt.subplots(figsize=(6.2, 3.2))
    marks = "osD^vPX"
    for (model, rows), mark in zip(both.groupby("model", sort=False), marks, strict=False):
        axis.plot(rows["execute_nrmse"], rows["success"], mark, label=model.replace("_", " "),
                  markersize=7)  # fmt: skip
    axis.set(xlabel="execute NRMSE as in chapter 03, %", ylabel="success in the loop, %",
             xlim=(0, None), ylim=(-3, 104))  # fmt: skip
    figure.legend(loc="outside right center", fontsize=8)
    return style.closed(figure)


def ways(table: pd.DataFrame) -> Figure:
    """How far the named and the other cube moved, in mm: a dot an episode, a panel a condition.

    A cube that fell far away is drawn at the edge.
    """
    names = list(dict.fromkeys(table["condition"]))
    figure, axes = plt.subplots(1, len(names), figsize=(7.5, 2.5), sharex=True, sharey=True)
    for axis, name in zip(np.atleast_1d(axes), names, strict=True):
        rows = table[table["condition"] == name]
        other = rows["right_mm"].where(rows["side"] == "left", rows["left_mm"])
        x, y, good = rows["named_mm"].clip(-60, 120), other.clip(0, 120), rows["success"] == 1
        axis.plot(x[good], y[good], "o", color=style.BLUE, markersize=3, label="done")
        axis.plot(x[~good], y[~good], "x", color=style.RED, markersize=4, label="not done")
        axis.axvline(40, color=style.GREY, linestyle=":")
        axis.axhline(10, color=style.GREY, linestyle=":")
        axis.set(title=name.replace("_", " "), xlabel="named cube, mm")
    first = np.atleast_1d(axes)[0]
    first.set_ylabel("other cube, mm")
    figure.legend(*first.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return style.closed(figure)


def strips(path=None) -> Figure:
    """Rows of images of episodes, with the instruction and the result."""
    with np.load(path or artefacts.stored(f"results/{STRIPS}"), allow_pickle=False) as file:
        videos, texts = file["strips"], file["texts"].tolist()
    # layout by hand: the automatic one makes the first column as wide as the text over it
    figure, axes = plt.subplots(
        *videos.shape[:2], figsize=(7.5, 1.35 * len(videos)), layout="none",
        gridspec_kw={"left": 0, "right": 1, "bottom": 0, "top": 0.97, "wspace": 0.04,
                     "hspace": 0.3},
    )  # fmt: skip
    for row, video, text in zip(axes, videos, texts, strict=True):
        for axis, image in zip(row, video, strict=True):
            axis.imshow(image)
            axis.set_axis_off()
        row[0].set_title(text.replace("_", " "), loc="left", fontsize=8)
    return style.closed(figure)

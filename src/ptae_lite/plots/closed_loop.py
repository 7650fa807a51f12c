"""Figures of the closed loop: the loop, success by model and by joint error, how episodes end."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ptae_lite import artefacts
from ptae_lite.experiments.episodes import STRIPS
from ptae_lite.plots import style

ENDS = {  # how an episode ends, with its colour; what is not listed is "another reason"
    "done": style.BLUE,
    "the wrong speed": style.ORANGE,
    "the cube went too little that way": "#B9B9B9",
    "the other cube was moved": style.RED,
}
OTHER_END = ("another reason", "#555555")
REWORDED = {"the cube went too little that way": "named cube moved too little"}


def loop() -> Figure:
    """The loop of camera, network, motors and table, and where the recorded video came in."""
    figure, axes = plt.subplots(figsize=(style.WIDTH, 3.4))
    boxes = {
        "camera": (0.12, 0.6), "image\nencoder": (0.43, 0.6), "action\ndecoder": (0.8, 0.6),
        "motors": (0.8, 0.1), "arm and cubes\n(physics)": (0.15, 0.1),
    }  # fmt: skip
    for name, place in boxes.items():
        axes.text(*place, name, ha="center", va="center",
                  bbox={"boxstyle": "round,pad=0.45", "fc": "white", "ec": style.BLUE})  # fmt: skip
    arrow = {"arrowstyle": "-|>", "color": style.BLUE, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    for start, end in (
        ((0.22, 0.6), (0.33, 0.6)), ((0.53, 0.6), (0.7, 0.6)), ((0.8, 0.49), (0.8, 0.18)),
        ((0.7, 0.1), (0.32, 0.1)), ((0.12, 0.21), (0.12, 0.53)), ((0.29, 0.21), (0.69, 0.51)),
        ((0.8, 0.84), (0.8, 0.71)),
    ):  # fmt: skip
        axes.annotate("", end, start, arrowprops=arrow)
    red = arrow | {"color": style.RED, "linestyle": "--"}
    axes.annotate("", (0.7, 0.7), (0.53, 0.84), arrowprops=red)
    for text, place, own in (
        ("measured\njoints", (0.5, 0.27), {}), ("next\njoints", (0.82, 0.34), {}),
        ("what the arm\nhas done", (0.14, 0.39), {}),
        ("code: sentence\nand first image", (0.8, 0.91), {"ha": "center"}),
        ("chapter 03: video of the\nright motion, and its length", (0.02, 0.91),
         {"color": style.ink(style.RED)}),
    ):  # fmt: skip
        axes.text(*place, text, va="center", **{"color": style.BLUE} | own)
    axes.set(xlim=(0, 1), ylim=(0, 1))
    axes.set_axis_off()
    return style.closed(figure)


def by_model(rates: pd.DataFrame, models: dict[str, str], references: dict[str, float]) -> Figure:
    """Success of each model: a dot for each training, a bar at the median, a line for each seed.

    Args:
        rates: columns `model`, `seed` and `success` in percent.
        models: the models from top to bottom, with their labels.
        references: dotted lines: label to percent.
    """
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.42 * len(models) + 0.9))
    for y, model in enumerate(models):
        values = rates[rates["model"] == model]["success"].to_numpy()
        axis.barh(y, np.median(values), color=style.SKY, height=0.6)
        axis.plot(values, np.full(len(values), y), "o", color=style.BLUE, markersize=5)
    for _, own in rates[rates["model"].isin(list(models))].groupby("seed"):
        values = own.set_index("model")["success"].reindex(list(models))
        axis.plot(values, range(len(models)), "-", color=style.BLUE, linewidth=0.7, alpha=0.6)
    for (name, value), place in zip(references.items(), ("left", "right"), strict=False):
        axis.axvline(value, color=style.GREY, linestyle=":")
        axis.text(value, -0.75, f" {name} ", color=style.GREY, ha=place)
    axis.set_yticks(range(len(models)), models.values())
    axis.set(xlim=(-1, 101), ylim=(len(models) - 0.5, -0.95), xlabel="success in the loop, %")
    axis.grid(axis="y", visible=False)
    return style.closed(figure)


def error_against_success(
    rates: pd.DataFrame, scores: pd.DataFrame, models: Mapping[str, str], left: tuple[str, ...] = ()
) -> Figure:
    """Each training: its execute NRMSE as in chapter 03, and its success in the loop.

    Args:
        rates: columns `model`, `seed` and `success` in percent.
        scores: `model`, `seed` and `execute_nrmse`.
        models: the models that are drawn, with the names beside their marks.
        left: models whose names stand to the left.
    """
    both = rates.merge(scores, on=["model", "seed"])
    figure, axis = plt.subplots(figsize=(style.WIDTH, 3.6))
    colours = (style.BLUE, style.SKY, style.GREY, style.RED, style.PURPLE, "black", style.GREEN)
    for (model, name), mark, colour in zip(models.items(), "osD^v+x", colours, strict=False):
        rows = both[both["model"] == model].sort_values("execute_nrmse", ascending=model in left)
        axis.plot(rows["execute_nrmse"], rows["success"], mark, color=colour, markersize=7,
                  mfc="none", mew=1.6)  # hollow, so that none hides another  # fmt: skip
        last = rows.iloc[0]
        way, side = (-10, "right") if model in left else (10, "left")
        axis.annotate(name, (last["execute_nrmse"], last["success"]), (way, 0), ha=side,
                      textcoords="offset points", va="center",
                      color=style.ink(colour))  # fmt: skip
    axis.set(xlabel="execute NRMSE as in chapter 03, %", ylabel="success in the loop, %",
             ylim=(-3, 104), xlim=(0, 1.28 * both["execute_nrmse"].max()))  # fmt: skip
    return style.closed(figure)


def endings(table: pd.DataFrame, models: Mapping[str, str]) -> Figure:
    """How the episodes of each model ended: a bar of 100 % in parts.

    Args:
        table: a row an episode, with `model` and `reason`.
        models: the models from top to bottom, with their labels.
    """
    rare, grey = OTHER_END
    reasons = table["reason"].where(table["reason"].isin(list(ENDS)), rare)
    shares = pd.crosstab(table["model"], reasons, normalize="index") * 100
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.42 * len(models) + 1.3))
    start = np.zeros(len(models))
    for reason, colour in (ENDS | {rare: grey}).items():
        if reason not in shares:
            continue
        part = shares[reason].reindex(list(models)).fillna(0).to_numpy()
        bars = axis.barh(range(len(models)), part, left=start, height=0.66, color=colour,
                         edgecolor="white", label=REWORDED.get(reason, reason))  # fmt: skip
        texts = [f"{share:.0f}" if share >= 6 else "" for share in part]
        dark = colour in (style.ORANGE, style.RED, "#B9B9B9")
        axis.bar_label(bars, texts, label_type="center", color="black" if dark else "white")
        start += part
    axis.set_yticks(range(len(models)), models.values())
    axis.set(xlim=(0, 100), ylim=(len(models) - 0.5, -0.5), xlabel="episodes, %")
    axis.grid(visible=False)
    figure.legend(loc="outside lower center", ncols=2, handlelength=1, columnspacing=0.8)
    return style.closed(figure)


def seed_by_seed(panels: Mapping[str, pd.DataFrame], y_label: str) -> Figure:
    """Lines that join the trainings of one seed: a panel for each table.

    Args:
        panels: title to a table with a row for each seed and a column for each model.
    """
    figure, axes = plt.subplots(
        len(panels), 1, figsize=(style.WIDTH, 0.6 + 2.0 * len(panels)), sharey=True
    )
    for axis, (title, table) in zip(np.atleast_1d(axes), panels.items(), strict=True):
        places = np.arange(table.shape[1])
        for seed, values in zip(table.index, table.to_numpy(), strict=True):
            colour = (style.BLUE, style.ORANGE, style.GREEN)[seed % 3]
            axis.plot(places, values, "-" + "os^"[seed % 3], color=colour, label=f"seed {seed}")
        axis.set_xticks(places, [name.replace(" ", "\n", 1) for name in table.columns])
        axis.set(title=title, ylabel=y_label, xlim=(-0.4, len(places) - 0.6))
    first = np.atleast_1d(axes)[0]
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return style.closed(figure)


def shares(groups: Mapping[str, Mapping[str, float]], x_label: str) -> Figure:
    """A dot for each named share in percent, with its value; groups are set apart.

    The axis begins at the ten below the smallest share.

    Args:
        groups: name of the group to shares by name.
    """
    rows = [(kind, name, value) for kind, named in groups.items() for name, value in named.items()]
    kinds = list(groups)
    places = [i + 0.5 * kinds.index(kind) for i, (kind, *_) in enumerate(rows)]
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.26 * len(rows) + 0.9))
    for y, (kind, _, value) in zip(places, rows, strict=True):
        colour = (style.BLUE, style.RED, style.GREEN, style.GREY)[kinds.index(kind) % 4]
        axis.plot(value, y, "osD^"[kinds.index(kind) % 4], color=colour, markersize=7)
        axis.annotate(f"{value:.0f}", (value, y), (8, 0), textcoords="offset points", va="center")
    axis.set_yticks(places, [name for _, name, _ in rows])
    low = 10 * np.floor(min(value for *_, value in rows) / 10)
    axis.set(xlim=(low - 1, 100 + 0.1 * (100 - low)), ylim=(places[-1] + 0.7, -0.7), xlabel=x_label)
    axis.tick_params(axis="y", length=0)
    return style.closed(figure)


def ways(table: pd.DataFrame) -> Figure:
    """How far the named and the other cube moved, in mm: a dot an episode, a panel a condition.

    A cube that fell far away is drawn at the edge.
    """
    names = list(dict.fromkeys(table["condition"]))
    figure, axes = plt.subplots(
        len(names), 1, figsize=(style.WIDTH, 0.8 + 1.6 * len(names)), sharex=True, sharey=True
    )
    for axis, name in zip(np.atleast_1d(axes), names, strict=True):
        rows = table[table["condition"] == name]
        other = rows["right_mm"].where(rows["side"] == "left", rows["left_mm"])
        x, y, good = rows["named_mm"].clip(-60, 120), other.clip(0, 120), rows["success"] == 1
        axis.plot(x[~good], y[~good], "x", color=style.RED, markersize=4, label="not done")
        axis.plot(x[good], y[good], "o", color=style.BLUE, markersize=3, label="done")
        axis.axvline(40, color=style.GREY, linestyle=":")
        axis.axhline(10, color=style.GREY, linestyle=":")
        axis.set(title=f"{name.replace('_', ' ')}: {100 * good.mean():.0f} % done")
        axis.set_ylabel("other cube, mm")
    first, last = np.atleast_1d(axes)[[0, -1]]
    last.set_xlabel("named cube, mm")
    figure.legend(*first.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return style.closed(figure)


def strips(names: Mapping[str, str] | None = None, path=None) -> Figure:
    """Rows of images of episodes, with the model, the instruction and the result.

    Args:
        names: of models, as the figure shows them.
    """
    with np.load(path or artefacts.stored(f"results/{STRIPS}"), allow_pickle=False) as file:
        videos, texts = file["strips"], file["texts"].tolist()
    # layout by hand: the automatic one makes the first column as wide as the text over it
    figure, axes = plt.subplots(
        *videos.shape[:2], figsize=(style.WIDTH, 1.02 * len(videos)), layout="none",
        gridspec_kw={"left": 0, "right": 1, "bottom": 0, "top": 0.94, "wspace": 0.04,
                     "hspace": 0.5},
    )  # fmt: skip
    for row, video, text in zip(axes, videos, texts, strict=True):
        for axis, image in zip(row, video, strict=True):
            axis.imshow(image)
            axis.set_axis_off()
        model, rest = text.split(": ", 1)
        for reason, words in REWORDED.items():
            rest = rest.replace(reason, words)
        shown = (names or {}).get(model, model).removeprefix("+ ").removeprefix("or ")
        row[0].set_title(fill(f"{shown}: {rest}", 68), loc="left", fontsize=9)
    return style.closed(figure)

"""Figures of the policy that watches: success by condition and amount, the hand's correction."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure

from ptae_lite import artefacts
from ptae_lite.experiments.episodes import StoredEpisode
from ptae_lite.experiments.watching_shown import STRIPS
from ptae_lite.plots import style
from ptae_lite.plots.simulation import grid
from ptae_lite.robot import arm
from ptae_lite.robot.closed_loop import TRAVEL_MM
from ptae_lite.robot.disturbances import LOW_M
from ptae_lite.robot.scene import CUBE_EDGE_M, TABLE_TOP_M

MARKS = ("o", "s", "D", "^")
COLOURS = (style.BLUE, style.ORANGE, style.GREY, style.SERIES[1])
WITHIN = (-0.6, 1.6)  # of corrections; what lies beyond is drawn at the edge


def by_condition(
    rates: pd.DataFrame, models: Mapping[str, str], conditions: Mapping[str, str]
) -> Figure:
    """Success of several models under each condition: a mark at the median, a line over the seeds.

    Args:
        rates: columns `model`, `condition`, `seed` and `success` in percent.
        models: the models with their labels, at most four.
        conditions: the conditions from top to bottom, with their labels.
    """
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.46 * len(conditions) + 1.2))
    for k, (model, label) in enumerate(models.items()):
        own = rates[rates["model"] == model].groupby("condition")["success"]
        spread = own.agg(["min", "median", "max"]).reindex(list(conditions))
        y = np.arange(len(conditions)) + 0.16 * (k - (len(models) - 1) / 2)
        look = {"color": COLOURS[k], "zorder": 3 - 0.1 * k}
        axis.hlines(y, spread["min"], spread["max"], lw=1.6, **look)
        axis.plot(spread["median"], y, MARKS[k], ms=6, label=label, ls="none", **look)
    axis.set_yticks(range(len(conditions)), conditions.values())
    axis.set(xlim=(-3, 103), ylim=(len(conditions) - 0.5, -0.5), xlabel="success in the loop, %")
    axis.tick_params(axis="y", length=0)
    figure.legend(loc="outside lower center", ncols=2, handletextpad=0.2)
    return style.closed(figure)


def correction(table: pd.DataFrame) -> Float[np.ndarray, " R"]:
    """The part of the named cube's displacement that the hand went along with, for each episode.

    With d the displacement of the cube and h that of the place where the hand came down, both from
    the scene before the move, it is `h . d / d . d`: 0 if the hand came down where the cube was, 1
    if where it is. It is nan where the hand never came down or the cube was not moved.
    """
    cube = table[["move_mm_x", "move_mm_y"]].to_numpy(float)
    hand = table[["hand_mm_x", "hand_mm_y"]].to_numpy(float)
    far = (cube**2).sum(1)
    return (hand * cube).sum(1) / np.where(far > 0, far, np.nan)


def corrections(table: pd.DataFrame, models: Mapping[str, str]) -> Figure:
    """The hand's correction over the cube's displacement: a dot an episode, a row a model.

    Args:
        table: a row an episode, with the columns of `correction`, `model` and `success`.
        models: the models from top to bottom, with their labels.
    """
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.6 * len(models) + 1.2))
    rng = np.random.default_rng(0)  # to spread the dots of a row
    for y, model in enumerate(models):
        rows = table[table["model"] == model]
        share, good = correction(rows), (rows["success"] == 1).to_numpy()
        height = y + rng.uniform(-0.26, 0.26, len(rows))
        for some, mark, colour, label in (
            (~good, "x", style.RED, "not done"), (good, "o", style.BLUE, "done"),
        ):  # fmt: skip
            axis.plot(share[some].clip(*WITHIN), height[some], mark, ms=3, color=colour, alpha=0.5,
                      mew=0.8, label=None if y else label)  # fmt: skip
        axis.plot([np.nanmedian(share)] * 2, [y - 0.36, y + 0.36], color="black", lw=2)
    for place, text in ((0, "where the cube was"), (1, "where it is")):
        axis.axvline(place, color=style.GREY, ls=":", zorder=0)
        axis.text(place, -0.6, text, ha="center", va="bottom", color=style.GREY)
    axis.set_yticks(range(len(models)), models.values())
    axis.set(xlim=(WITHIN[0] - 0.05, WITHIN[1] + 0.05), ylim=(len(models) - 0.5, -0.6),
             xlabel="correction of the hand over displacement of the cube")  # fmt: skip
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)
    figure.legend(loc="outside lower center", ncols=2, handletextpad=0.2)
    return style.closed(figure)


def amounts(rates: pd.DataFrame, clips: Mapping[str, str], controls: Mapping[str, str]) -> Figure:
    """Success over the amount of corrected clips, and below it that of other trainings.

    A hollow dot is a training. A line joins the medians over the amounts.

    Args:
        rates: columns `model`, `seed` and `success` in percent.
        clips: the models from no corrected clips to all, with their labels.
        controls: the other models, with their labels.
    """
    clips, controls = (
        {model: label for model, label in named.items() if model in set(rates["model"])}
        for named in (clips, controls)
    )
    rows = len(clips) + len(controls)
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.32 * rows + 1.1))
    places = [*range(len(clips)), *(len(clips) + 0.6 + i for i in range(len(controls)))]
    values = {model: rates[rates["model"] == model]["success"].to_numpy()
              for model in (*clips, *controls)}  # fmt: skip
    for (model, own), y in zip(values.items(), places, strict=True):
        colour = style.BLUE if model in clips else style.SERIES[1]
        axis.plot(own, np.full(len(own), y), "o", ms=5, color=colour, mfc="none")
        axis.plot(np.median(own), y, "|", ms=13, mew=2, color=colour)
    axis.plot([np.median(values[model]) for model in clips], places[: len(clips)], "-",
              color=style.BLUE, lw=1)  # fmt: skip
    axis.axhline(len(clips) - 0.2, color=style.GREY, lw=0.8)
    axis.set_yticks(places, [*clips.values(), *controls.values()])
    axis.set(xlim=(-3, 103), ylim=(places[-1] + 0.6, -0.6),
             xlabel="success where a cube is moved, %")  # fmt: skip
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)
    return style.closed(figure)


def distances(table: pd.DataFrame, models: Mapping[str, str]) -> Figure:
    """How far the named cube went as commanded, in mm: thick for half of the episodes.

    Args:
        table: a row an episode, with `model` and `named_mm`.
        models: the models from top to bottom, with their labels.
    """
    figure, axis = plt.subplots(figsize=(style.WIDTH, 0.36 * len(models) + 0.9))
    for y, model in enumerate(models):
        far = table[table["model"] == model]["named_mm"].clip(-20, 120)
        low, quarter, middle, most, high = far.quantile([0.05, 0.25, 0.5, 0.75, 0.95])
        axis.plot([low, high], [y, y], color=style.SKY, lw=1.4)
        axis.plot([quarter, most], [y, y], color=style.SKY, lw=6, solid_capstyle="butt")
        axis.plot(middle, y, "|", color="black", ms=12, mew=2)
    axis.axvline(TRAVEL_MM, color=style.GREY, ls=":")
    axis.set_yticks(range(len(models)), models.values())
    axis.set(ylim=(len(models) - 0.5, -0.5), xlabel="way of the named cube, mm")
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)
    return style.closed(figure)


def draws(table: pd.DataFrame) -> Figure:
    """How many moves were drawn until one was hard: a bar a number, and one for none at all.

    Args:
        table: a row a scene, with `draws` and `valid`.
    """
    hard = table["valid"] == 1
    counts = table["draws"][hard].value_counts()
    numbers = range(1, int(table["draws"].max()) + 1)
    figure, axis = plt.subplots(figsize=(style.WIDTH, 2.4))
    bars = axis.bar(numbers, counts.reindex(numbers, fill_value=0), color=style.SKY, width=0.7)
    axis.bar_label(bars)
    axis.bar_label(axis.bar(numbers[-1] + 1.5, (~hard).sum(), color=style.GREY, width=0.7))
    axis.set_xticks([*numbers, numbers[-1] + 1.5], [*numbers, "none"])
    axis.set(xlabel="draws until a move was hard", ylabel="test scenes")
    axis.grid(axis="x", visible=False)
    return style.closed(figure)


def ways_above(acted: Mapping[str, StoredEpisode]) -> Figure:
    """The table from above: the ways of the fingertips, and the cubes before and after a move.

    The way is thick where the hand is down at the table. The robot is below the picture.

    Args:
        acted: label to an episode. All have the same scene and the same move.
    """
    figure, axis = plt.subplots(figsize=(style.WIDTH, 3.6))
    one, edge = next(iter(acted.values())), CUBE_EDGE_M
    for frame, moved in ((0, False), (one.episode.event, True)):
        for pose, colour in zip(one.episode.cubes[frame], one.stage.colours, strict=True):
            corner = (-pose[1] - edge / 2, pose[0] - edge / 2)
            axis.add_patch(plt.Rectangle(
                corner, edge, edge, angle=-np.degrees(2 * np.arctan2(pose[5], pose[6])),
                rotation_point="center", fill=moved, ec="black", fc=colour, alpha=0.5,
                ls="-" if moved else "--", lw=1.2))  # fmt: skip
    for (label, kept), colour in zip(acted.items(), COLOURS, strict=False):
        x, y, z = arm.fingertip(kept.episode.joints_rad).T
        low = np.where(z < TABLE_TOP_M + LOW_M, x, np.nan)
        axis.plot(-y, x, color=colour, lw=1)
        axis.plot(-y, low, color=colour, lw=3.5, label=label)
    axis.set(aspect="equal", xlabel="to the right, m", ylabel="away from the robot, m",
             xlim=(-0.30, 0.10), ylim=(0.28, 0.52))  # fmt: skip
    figure.legend(loc="outside lower center", ncols=2)
    return style.closed(figure)


def strips(path=None) -> Figure:
    """Rows of images of corrected clips, each with its sentence and what happened."""
    with np.load(path or artefacts.stored(f"results/{STRIPS}"), allow_pickle=False) as file:
        return grid(dict(zip(file["texts"].tolist(), file["strips"], strict=True)))

"""Figures of limited supervision: the paper's figures, drawn from our tables.

They are drawn from the tables of `experiments.supervision`, whatever rows these have.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ptae_lite.evaluation import CHANCE
from ptae_lite.experiments.supervision_grid import REGULAR, SHARES, VARIANTS
from ptae_lite.paper import reported
from ptae_lite.plots import style

LOOKS = {  # colour, line style, mark; the paper's points have the same colour
    "ptae": (style.MODELS["PTAE"], "-", "o"),
    "pgae": (style.MODELS["PGAE"], "--", "s"),
    "pvae": (style.MODELS["PVAE"], "-.", "D"),
    "linear": (style.MODELS["linear baseline"], ":", "v"),
}
NAMES = {"ptae": "PTAE", "pgae": "PGAE", "pvae": "PVAE", "linear": "linear baseline"}
WHAT = {"samples": "labelled samples, %", "iterations": "supervised iterations, %"}
LABELS = {"describe_accuracy": "describe accuracy, %", "execute_nrmse": "execute NRMSE, %"}
MAIN = ("paper", "random")  # the variant of a network's curve, and of the linear baseline's
LONGER = {  # hollow marks of longer trainings: their label and size
    "long": (f"{VARIANTS['long'].times} times as long", 6),
    "paper-length": ("as long as the paper's", 9),
}
KINDS = {  # of trainings in `by_samples_seen`, with their labels
    "all labels": "all labels",
    "iterations, paper": "iterations",
    **{f"iterations, {variant}": f"iterations, {label}" for variant, (label, _) in LONGER.items()},
    "samples, balanced": "samples, half of each batch",
    "samples, paper": "samples, once an epoch",
}
PAPER = "the paper's text"
ALL_MODELS = (*(label for label, _ in LONGER.values()), PAPER)  # in each one's colour
PAPERS = (  # the three figures of the paper
    ("describe_accuracy", "iterations"), ("describe_accuracy", "samples"),
    ("execute_nrmse", "samples"),
)  # fmt: skip


def rows_of(table: pd.DataFrame, model: str, mode: str, variant: str | None = None) -> pd.DataFrame:
    """The rows of one curve, with those of the regular training. None for the main variant."""
    mine = table[(table["model"] == model) & (table["mode"] == mode)]
    regular = mine["share"] == REGULAR[mode]
    there = set(mine["variant"][~regular])
    own = variant or next((name for name in MAIN if name in there), None)
    return mine[regular | (mine["variant"] == own)]


def by_share(table: pd.DataFrame) -> Figure:
    """The paper's figures: describe by iterations and by samples, execute by samples.

    A point is the mean over the seeds, and its bar goes from the worst to the best of them; one
    seed has no bar. Hollow marks are the longer trainings. Triangles are the numbers in the paper's
    text, in the model's colour.
    """
    figure, axes = plt.subplots(3, 1, figsize=(style.WIDTH, 7.6))
    for axis, (column, mode) in zip(axes, PAPERS, strict=True):
        draw_measure(axis, table, column, mode)
        axis.set_title(f"{column.split('_')[0]} by {mode}")
    shared_legend(figure, axes)
    return style.closed(figure)


def by_samples_seen(table: pd.DataFrame) -> Figure:
    """Describe accuracy of PTAE by how many samples were shown with a label: a mark a training.

    The numbers are shares in percent, where there is room for them. Only variants in which the
    number of labels, or of their uses, is all that differs are shown.
    """
    mine = table[table["model"] == "ptae"]
    regular = mine["share"] == mine["mode"].map(REGULAR)
    kind = (mine["mode"] + ", " + mine["variant"]).mask(regular, "all labels")
    figure, axis = plt.subplots(figsize=(style.WIDTH, 4.6))
    points, free = ["supervised_samples_seen", "describe_accuracy"], []
    for k, (name, label) in enumerate(KINDS.items()):
        rows, full = mine[kind == name], "full" if name == "all labels" else "none"
        if len(rows):
            axis.plot(*(rows[column] for column in points), "os^vD<"[k], color=f"C{k}",
                      fillstyle=full, label=label)  # fmt: skip
        for share, own in () if name == "all labels" else rows.groupby("share"):
            x, y = own[points].mean()
            if all(abs(np.log(x / u)) > 0.25 or abs(y - v) > 5 for u, v in free):
                free.append((x, y))  # numbers of crowded marks would cover each other
                axis.annotate(f"{share:g}", (x, y), (5, 3), textcoords="offset points")
    axis.axhline(CHANCE, color=style.GREY, linestyle=":", label="chance")
    axis.set(xscale="log", xlim=(300, 60_000), ylim=(-3, 105), ylabel=LABELS["describe_accuracy"],
             xlabel="samples shown with a label, in the whole training")  # fmt: skip
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)


def draw_measure(axis: Axes, table: pd.DataFrame, column: str, mode: str) -> None:
    """One score in one experiment: every model, the paper's points, and chance."""
    for model, (colour, dash, mark) in LOOKS.items():
        rows = rows_of(table, model, mode)
        found = rows[rows[column].notna()].groupby("share")[column].agg(["mean", "min", "max"])
        if len(found):
            reach = [found["mean"] - found["min"], found["max"] - found["mean"]]
            several = (reach[0] + reach[1]).where(lambda r: r > 0)  # one seed has no bar
            bars = [side.where(several.notna()) for side in reach]
            axis.errorbar(found.index, found["mean"], yerr=bars, color=colour, linestyle=dash,
                          marker=mark, markersize=4, capsize=2, label=NAMES[model])  # fmt: skip
        own = table[(table["model"] == model) & (table["mode"] == mode)]
        for variant, (label, size) in LONGER.items():
            longer = own[own["variant"] == variant].groupby("share")[column].mean()
            if len(longer):
                axis.plot(longer, mark, color=colour, fillstyle="none", markersize=size,
                          label=label)  # fmt: skip
        paper = reported.BY_SHARE.get((model, column, mode))
        if paper:
            axis.plot(list(paper), [claim.value for claim in paper.values()], "^", color=colour,
                      fillstyle="none", label=PAPER)  # fmt: skip
    if mode == "iterations":  # every sample has a label here, so the baseline uses all labels
        sums = rows_of(table, "linear", "samples")
        sums = sums[sums["share"] == REGULAR["samples"]][column].mean()
        if pd.notna(sums):
            colour, dash, _ = LOOKS["linear"]
            axis.axhline(sums, color=colour, linestyle=dash, label=NAMES["linear"])
    if column == "describe_accuracy":
        axis.axhline(CHANCE, color=style.GREY, linestyle=":", label="chance")
    reach = (0.85 * min(SHARES[mode]), max(SHARES[mode]) / 0.85)
    axis.set(ylabel=LABELS[column], xlabel=WHAT[mode], xscale="log", xlim=reach)
    axis.set_ylim(*((-3, 106) if column == "describe_accuracy" else (0, None)))
    ticks = SHARES[mode]  # the last two are too close for two labels
    axis.set_xticks(ticks, ["" if tick == ticks[-2] else f"{tick:g}" for tick in ticks])
    axis.minorticks_off()


def shared_legend(figure: Figure, axes) -> None:
    """One legend for all axes, with each label once."""
    found: dict = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            grey = label in ALL_MODELS
            found.setdefault(label, _in_grey(handle) if grey else handle)
    figure.legend(found.values(), found, loc="outside upper center", ncols=2)


def _in_grey(line: Line2D) -> Line2D:
    return Line2D([], [], color=style.GREY, marker=line.get_marker(), ls="", fillstyle="none")

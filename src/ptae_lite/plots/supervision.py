"""Limited supervision to look at: the paper's figures from our table, and their slider.

Everything is drawn from the stored tables of `studies.supervision`, whatever rows they have. Only
the button of `workshop` computes something.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import CHANCE
from ptae_lite.language import SYNONYMS, Meaning
from ptae_lite.paper import reported
from ptae_lite.plots import style
from ptae_lite.studies.supervision import (
    REGULAR,
    SHARES,
    VARIANTS,
    Job,
    examples,
    fit,
    scores,
)  # fmt: skip
from ptae_lite.training import RECIPES
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.train_button import Workshop

LOOKS = {  # colour, dash, mark; and of the paper's points
    "ptae": (style.BLUE, "-", "o"),
    "pgae": (style.ORANGE, "--", "s"),
    "pvae": (style.GREEN, "-.", "D"),
    "linear": (style.PURPLE, ":", "v"),
}
NAMES = {"ptae": "PTAE", "pgae": "PGAE", "pvae": "PVAE", "linear": "weighted sums"}
WHAT = {"samples": "labelled samples, %", "iterations": "supervised iterations, %"}
LABELS = {"describe_accuracy": "describe accuracy, %", "execute_nrmse": "execute NRMSE, %"}
MAIN = {"samples": ("balanced", "random"), "iterations": ("paper",)}  # variants in the figures
PAPERS = (  # the three figures of the paper
    ("describe_accuracy", "iterations"), ("describe_accuracy", "samples"),
    ("execute_nrmse", "samples"),
)  # fmt: skip


def rows_of(table: pd.DataFrame, model: str, mode: str, variant: str | None = None) -> pd.DataFrame:
    """The rows of one curve, the regular training's among them; of the main variant if None."""
    mine = table[(table["model"] == model) & (table["mode"] == mode)]
    wanted = MAIN[mode] if variant is None else (variant,)
    return mine[mine["variant"].isin(wanted) | (mine["share"] == REGULAR[mode])]


def by_share(table: pd.DataFrame) -> Figure:
    """The paper's figures: describe by iterations and by samples, execute by samples.

    A point is the mean over the seeds, its bar reaches from the worst to the best of them; one
    seed has no bar. Hollow marks are the longer trainings with few iterations, triangles the
    numbers that the paper's text states, in the model's colour.
    """
    figure, axes = plt.subplots(1, 3, figsize=(9.5, 3.3))
    for axis, (column, mode) in zip(axes, PAPERS, strict=True):
        _draw(axis, table, column, mode)
        axis.set_title(f"{column.split('_')[0]} by {mode}")
    _legend(figure, axes)
    return style.closed(figure)


def by_presentations(table: pd.DataFrame) -> Figure:
    """Describe accuracy of PTAE over how often a label was shown; a mark a training.

    Numbers are the shares in percent. Variants of what is labelled or told are left out.
    """
    mine = table[(table["model"] == "ptae") & ~table["variant"].isin(["covering", "unpaired"])]
    regular = mine["share"] == mine["mode"].map(REGULAR)
    kind = (mine["mode"] + ", " + mine["variant"]).mask(regular, "all labels")
    figure, axis = plt.subplots(figsize=(7, 3.2))
    for (name, rows), mark in zip(mine.groupby(kind), "os^Dv<>p", strict=False):
        points = ("supervised_presentations", "describe_accuracy")
        axis.plot(*(rows[column] for column in points), mark, fillstyle="none", label=name)
        for share, own in () if name == "all labels" else rows.groupby("share"):
            axis.annotate(f"{share:g}", own[list(points)].mean(), textcoords="offset points",
                          xytext=(5, 3), fontsize=7)  # fmt: skip
    axis.axhline(CHANCE, color=style.GREY, linestyle=":", label="chance")
    axis.set(xscale="log", xlim=(300, 60_000), ylim=(-3, 105), ylabel=LABELS["describe_accuracy"],
             xlabel="how often a sample was shown with its label")  # fmt: skip
    figure.legend(*axis.get_legend_handles_labels(), loc="outside right upper")
    return style.closed(figure)


def card(table, said, mode: str, model: str, share: float, live=None) -> Figure:
    """Where a model stands with a share, and what it says of some clips.

    `live` may be the rows and sentences of a training that was just run; they are shown instead.
    Where the table has no such training, the figure says so.
    """
    here = rows_of(table, model, mode)
    here = here[here["share"] == share]
    figure = plt.figure(figsize=(8.2, 4.9))
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 2))
    axes = [figure.add_subplot(grid[0, column]) for column in range(2)]
    for axis, column in zip(axes, LABELS, strict=True):
        _draw(axis, table, column, mode)
        if len(here):
            axis.plot(share, here[column].mean(), "s", markersize=12, color=style.RED,
                      fillstyle="none", markeredgewidth=2, label="here")  # fmt: skip
        if live is not None:
            axis.plot(share, live[0][column].iloc[0], "*", markersize=13, color=style.RED,
                      label="trained just now")  # fmt: skip
    _legend(figure, axes)
    text = figure.add_subplot(grid[1, :])
    text.axis("off")
    if live is None and here.empty:
        text.text(0, 0.8, describe(table, said, mode, model, share), transform=text.transAxes)
    else:
        _sentences(text, _answers(said, mode, model, share) if live is None else live[1])
    return style.closed(figure)


def describe(table, said, mode: str, model: str, share: float) -> str:
    """What `card` shows, in words; or that the table has no such training."""
    here = rows_of(table, model, mode)
    here = here[here["share"] == share]
    if here.empty:
        there = ", ".join(f"{s:g}" for s in sorted(rows_of(table, model, mode)["share"].unique()))
        has = f"it has {there} %" if there else "it has none with this model"
        return f"The table has no {NAMES[model]} with {share:g} % of the {mode}; {has}."
    accuracy, error = (here[column].mean() for column in LABELS)
    answers = "; ".join(
        f"{row.truth}: {'right' if row.right else 'wrong'}, {_words(row.said)}"
        for row in _answers(said, mode, model, share).itertuples()
    )
    return (
        f"{NAMES[model]}, {share:g} % of the {mode} with a label ({_seeds(len(here))}): describe "
        f"is right for {accuracy:.1f} % of the test clips, and execute has an NRMSE of "
        f"{error:.2f} %. It says of some clips: {answers}."
    )


def panel(table: pd.DataFrame, said: pd.DataFrame, **start) -> Panel:
    """The slider over the shares, with a choice of experiment and model; begins at `start`."""
    return Panel(
        partial(card, table, said),
        {"mode": list(SHARES), "model": ["ptae", "pgae", "pvae"], "share": list(SHARES["samples"])},
        "Results by the share of labels",
        start=start,
        labels={"mode": "limited are the", "share": "with a label, %"},
        describe=partial(describe, table, said),
    )


def workshop(samples, table, said, epochs: int = 15, seed: int = 0, **start) -> Workshop:
    """The panel, and a button that trains the chosen model for a few epochs and marks its place."""

    def work(mode: str, model: str, share: float, tell) -> Figure | str:
        def told(numbers) -> Iterator[int]:
            for number in numbers:
                tell(f"training {NAMES[model]}: epoch {number} of {epochs}")
                yield number

        job = Job(model, mode, MAIN[mode][0], share, seed)
        try:
            trained = fit(samples, job, replace(RECIPES[model], epochs=epochs), progress=told)
        except ConfigError as error:
            return str(error)
        tell("trained; now it is asked about the test clips")
        live = pd.DataFrame([scores(trained, samples)]), examples(trained, samples)
        steps, shown = (trained.about[n] for n in ("steps", "supervised_presentations"))
        tell(f"trained: {steps} steps, {shown} samples shown with their label")
        return card(table, said, mode, model, share, live=live)

    title = f"train it now ({epochs} epochs, about a minute)"
    return Workshop(panel(table, said, **start), work, title)


def _answers(said: pd.DataFrame, mode: str, model: str, share: float) -> pd.DataFrame:
    """What the model of the first seed said."""
    rows = rows_of(said, model, mode)
    rows = rows[rows["share"] == share]
    return rows[rows["seed"] == rows["seed"].min()]


def _words(said) -> str:
    return said if isinstance(said, str) and said else "(nothing)"


def marked(truth: str, said) -> list[tuple[str, bool]]:
    """The words that were said, and whether each is the right one for its place, or its synonym."""
    wanted = truth.split()
    words = [word for word in _words(said).split()]
    return [
        (word, i < len(Meaning._fields) and word in (wanted[i], SYNONYMS[wanted[i]]))
        for i, word in enumerate(words)
    ]


def _sentences(text: Axes, rows: pd.DataFrame) -> None:
    """Lines of text: the truth, the verdict, and the words, wrong ones in red and in brackets."""
    look = {"family": "monospace", "fontsize": 8, "transform": text.transAxes}
    columns = {0: "the clip shows", 0.36: "the model says ([ ]: a wrong word)"}
    for x, heading in columns.items():
        text.text(x, 0.95, heading, fontsize=8, color=style.GREY, transform=text.transAxes)
    for line, row in enumerate(rows.itertuples(), start=1):
        y = 0.95 - line / (len(rows) + 1.5)
        words = marked(row.truth, row.said)
        shown = [word if right else f"[{word}]" for word, right in words]
        # two texts over each other, letter by letter: one has the right words, one the wrong ones
        layers = {"black": True, style.RED: False}
        text.text(0, y, row.truth, **look)
        text.text(0.36, y, "right" if row.right else "WRONG", color="black", **look)
        for colour, kind in layers.items():
            own = [s if r == kind else " " * len(s) for s, (_, r) in zip(shown, words, strict=True)]
            if any(map(str.strip, own)):
                text.text(0.36, y, " " * 8 + " ".join(own), color=colour, **look)


def _draw(axis: Axes, table: pd.DataFrame, column: str, mode: str) -> None:
    """One measure in one experiment: every model, the paper's points, chance."""
    for model, (colour, dash, mark) in LOOKS.items():
        rows = rows_of(table, model, mode)
        found = rows[rows[column].notna()].groupby("share")[column].agg(["mean", "min", "max"])
        if len(found):
            reach = [found["mean"] - found["min"], found["max"] - found["mean"]]
            several = (reach[0] + reach[1]).where(lambda r: r > 0)  # no bar where there is one
            bars = [side.where(several.notna()) for side in reach]
            axis.errorbar(found.index, found["mean"], yerr=bars, color=colour, linestyle=dash,
                          marker=mark, markersize=4, capsize=2, label=NAMES[model])  # fmt: skip
        longer = table[(table["model"] == model) & (table["mode"] == mode)]
        longer = longer[longer["variant"] == "long"].groupby("share")[column].mean()
        if len(longer):
            axis.plot(longer, mark, color=colour, fillstyle="none", markersize=6,
                      label=f"{NAMES[model]}, {VARIANTS['long'].times} times as long")  # fmt: skip
        paper = reported.BY_SHARE.get((model, column, mode))
        if paper:
            axis.plot(list(paper), [claim.value for claim in paper.values()], "^", color=colour,
                      fillstyle="none", label=f"{NAMES[model]} in the paper's text")  # fmt: skip
    if mode == "iterations":  # where every sample has a label, the sums have them all
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


def _legend(figure: Figure, axes) -> None:
    """One legend of all axes, each label once."""
    found: dict = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    figure.legend(found.values(), found, loc="outside upper center", ncols=4, fontsize=8)


def _seeds(count: int) -> str:
    return "one training" if count == 1 else f"mean of {count} trainings"

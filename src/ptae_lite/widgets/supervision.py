"""A panel over the shares of labels, and a button that trains a model.

The panel is drawn from the stored tables of `experiments.supervision`. Only the button trains.
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
from ptae_lite.experiments.supervision import SHARES, Job, examples, fit, scores
from ptae_lite.language import SYNONYMS, Meaning
from ptae_lite.models import MODELS
from ptae_lite.plots import style
from ptae_lite.plots.supervision import LABELS, MAIN, NAMES, draw_measure, rows_of, shared_legend
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.train_button import TrainButton


def card(table, said, mode: str, model: str, share: float, live=None) -> Figure:
    """The scores of a model with a share of the labels, and what it says of some clips.

    Args:
        live: rows and sentences of a training that was just run; they are shown instead.
    """
    here = rows_of(table, model, mode)
    here = here[here["share"] == share]
    figure = plt.figure(figsize=(8.2, 4.9))
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 2))
    axes = [figure.add_subplot(grid[0, column]) for column in range(2)]
    for axis, column in zip(axes, LABELS, strict=True):
        draw_measure(axis, table, column, mode)
        if len(here):
            axis.plot(share, here[column].mean(), "s", markersize=12, color=style.RED,
                      fillstyle="none", markeredgewidth=2, label="here")  # fmt: skip
        if live is not None:
            axis.plot(share, live[0][column].iloc[0], "*", markersize=13, color=style.RED,
                      label="trained just now")  # fmt: skip
    shared_legend(figure, axes)
    text = figure.add_subplot(grid[1, :])
    text.axis("off")
    if live is None and here.empty:
        text.text(0, 0.8, describe(table, said, mode, model, share), transform=text.transAxes)
    else:
        _sentences(text, _answers(said, mode, model, share) if live is None else live[1])
    return style.closed(figure)


def describe(table, said, mode: str, model: str, share: float) -> str:
    """What `card` shows, in words."""
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
    """The slider over the shares, with a choice of experiment and model.

    Args:
        start: first values of the controls.
    """
    return Panel(
        partial(card, table, said),
        {"mode": list(SHARES), "model": ["ptae", "pgae", "pvae"], "share": list(SHARES["samples"])},
        "Results by the share of labels",
        start=start,
        labels={"mode": "limited are the", "share": "with a label, %"},
        describe=partial(describe, table, said),
    )


def train_panel(samples, table, said, epochs: int = 15, seed: int = 0, **start) -> TrainButton:
    """The panel, and a button that trains the chosen model for a few epochs.

    Its scores are then shown in the figure.
    """

    def work(mode: str, model: str, share: float, tell) -> Figure | str:
        def counted(numbers) -> Iterator[int]:
            for number in numbers:
                tell(f"training {NAMES[model]}: epoch {number} of {epochs}")
                yield number

        job = Job(model, mode, MAIN[mode][0], share, seed)
        try:
            recipe = replace(MODELS[model].recipe, epochs=epochs)
            trained = fit(samples, job, recipe, progress=counted)
        except ConfigError as error:
            return str(error)
        tell("trained; now it is scored on the test clips")
        live = pd.DataFrame([scores(trained, samples)]), examples(trained, samples)
        steps, shown = (trained.about[n] for n in ("steps", "supervised_samples_seen"))
        tell(f"trained: {steps} steps, {shown} samples shown with their label")
        return card(table, said, mode, model, share, live=live)

    title = f"train it now ({epochs} epochs, about a minute)"
    return TrainButton(panel(table, said, **start), work, title)


def _answers(said: pd.DataFrame, mode: str, model: str, share: float) -> pd.DataFrame:
    """What the model of the first seed said."""
    rows = rows_of(said, model, mode)
    rows = rows[rows["share"] == share]
    return rows[rows["seed"] == rows["seed"].min()]


def _words(said) -> str:
    return said if isinstance(said, str) and said else "(nothing)"


def marked(truth: str, said) -> list[tuple[str, bool]]:
    """The words that were said, and whether each (or its synonym) is right for its place."""
    wanted = truth.split()
    words = [word for word in _words(said).split()]
    return [
        (word, i < len(Meaning._fields) and word in (wanted[i], SYNONYMS[wanted[i]]))
        for i, word in enumerate(words)
    ]


def _sentences(text: Axes, rows: pd.DataFrame) -> None:
    """Lines of text: the truth, the verdict, and the words; wrong ones are red and in brackets."""
    look = {"family": "monospace", "fontsize": 8, "transform": text.transAxes}
    columns = {0: "the clip shows", 0.36: "the model says ([ ]: a wrong word)"}
    for x, heading in columns.items():
        text.text(x, 0.95, heading, fontsize=8, color=style.GREY, transform=text.transAxes)
    for line, row in enumerate(rows.itertuples(), start=1):
        y = 0.95 - line / (len(rows) + 1.5)
        words = marked(row.truth, row.said)
        shown = [word if right else f"[{word}]" for word, right in words]
        # two texts over each other: one has the right words, the other the wrong ones
        layers = {"black": True, style.RED: False}
        text.text(0, y, row.truth, **look)
        text.text(0.36, y, "right" if row.right else "WRONG", color="black", **look)
        for colour, kind in layers.items():
            own = [s if r == kind else " " * len(s) for s, (_, r) in zip(shown, words, strict=True)]
            if any(map(str.strip, own)):
                text.text(0.36, y, " " * 8 + " ".join(own), color=colour, **look)


def _seeds(count: int) -> str:
    return "one training" if count == 1 else f"mean of {count} trainings"

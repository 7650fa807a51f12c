"""A panel over the shares of labels, and a button that trains a model.

The panel is drawn from the stored tables of `experiments.supervision`. Only the button trains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from html import escape

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from ptae_lite.errors import ConfigError
from ptae_lite.experiments.supervision import examples, fit, scores
from ptae_lite.experiments.supervision_grid import SHARES, Job
from ptae_lite.language import SYNONYMS, Meaning
from ptae_lite.models import MODELS
from ptae_lite.plots import style
from ptae_lite.plots.supervision import LABELS, NAMES, draw_measure, rows_of, shared_legend
from ptae_lite.widgets.panel_frames import as_html
from ptae_lite.widgets.panels import Panel
from ptae_lite.widgets.train_button import TrainButton

CELL = 'style="padding:.15em .5em;text-align:left"'
WRONG = "text-decoration:underline double #D55E00"


@dataclass(frozen=True, eq=False)
class Card:
    """Scores as a figure, and below it what a model says of some clips, as HTML."""

    figure: Figure
    text: str  # for those who cannot see the figure
    answers: pd.DataFrame | None  # None where the table has no such model

    def _repr_html_(self) -> str:
        shown = as_html(self.figure, self.text)
        if self.answers is None:
            return f"{shown}<p>{escape(self.text)}</p>"
        rows = "".join(
            f"<tr><td {CELL}>{'right' if row.right else 'wrong'}</td><td {CELL}>{row.truth}</td>"
            f"<td {CELL}>{_judged(row.truth, row.said)}</td></tr>"
            for row in self.answers.itertuples()
        )
        heads = "".join(f"<th {CELL}>{name}</th>" for name in ("", "the clip shows", "it says"))
        return f'{shown}<table style="margin:1em 0;font-size:.9em"><tr>{heads}</tr>{rows}</table>'


def card(table, said, mode: str, model: str, share: float, live=None) -> Card:
    """The scores of a model with a share of the labels, and what it says of some clips.

    Args:
        live: rows and sentences of a training that was just run; they are shown instead.
    """
    here = rows_of(table, model, mode)
    here = here[here["share"] == share]
    figure, axes = plt.subplots(2, 1, figsize=(style.WIDTH, 5.4))
    for axis, column in zip(axes, LABELS, strict=True):
        draw_measure(axis, table, column, mode)
        if len(here):
            axis.plot(share, here[column].mean(), "H", markersize=14, color=style.RED,
                      fillstyle="none", markeredgewidth=2, label="here")  # fmt: skip
        if live is not None:
            axis.plot(share, live[0][column].iloc[0], "*", markersize=13, color=style.RED,
                      label="trained just now")  # fmt: skip
    shared_legend(figure, axes)
    text = describe(table, said, mode, model, share)
    if live is not None:
        return Card(style.closed(figure), text, live[1])
    answers = None if here.empty else _answers(said, mode, model, share)
    return Card(style.closed(figure), text, answers)


def describe(table, said, mode: str, model: str, share: float) -> str:
    """What `card` shows, in words."""
    here = rows_of(table, model, mode)
    here = here[here["share"] == share]
    if here.empty:
        there = ", ".join(f"{s:g}" for s in sorted(rows_of(table, model, mode)["share"].unique()))
        has = f"it has {there} %" if there else "it has none with this model"
        return f"The table has no {NAMES[model]} with {share:g} % of the {mode}; {has}."
    accuracy, error = (here[column].mean() for column in LABELS)
    return (
        f"{NAMES[model]}, {share:g} % of the {mode} with a label ({_seeds(len(here))}): describe "
        f"is right for {accuracy:.1f} % of the test clips, and execute has an NRMSE of "
        f"{error:.2f} %."
    )


def panel(table: pd.DataFrame, said: pd.DataFrame, **start) -> Panel:
    """The slider over the shares, with a choice of experiment and model.

    Args:
        start: first values of the controls.
    """
    return Panel(
        lambda mode, model, share: card(table, said, mode, model.lower(), share),
        {"mode": list(SHARES), "model": ["PTAE", "PGAE", "PVAE"], "share": list(SHARES["samples"])},
        "Results by the share of labels",
        start=start,
        labels={"mode": "limited are the", "share": "with a label, %"},
    )


def train_panel(samples, table, said, epochs: int = 15, seed: int = 0, **start) -> TrainButton:
    """The panel, and a button that trains the chosen model for a few epochs.

    Its scores are then shown in the figure.
    """

    def work(mode: str, model: str, share: float, tell) -> Card | str:
        model = model.lower()

        def counted(numbers) -> Iterator[int]:
            for number in numbers:
                tell(f"training {NAMES[model]}: epoch {number} of {epochs}")
                yield number

        job = Job(model, mode, "paper", share, seed)
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


def _judged(truth: str, said) -> str:
    """The words that were said; wrong ones are underlined, and in brackets."""
    return " ".join(
        escape(word) if right else f'<b style="{WRONG}">[{escape(word)}]</b>'
        for word, right in marked(truth, said)
    )


def _seeds(count: int) -> str:
    return "one training" if count == 1 else f"mean of {count} trainings"

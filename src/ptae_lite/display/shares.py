"""Limited supervision to look at: results by the share of labelled samples, and their slider.

Everything is drawn from the stored tables of `studies.supervision`; nothing is computed here.
"""

from __future__ import annotations

from functools import partial

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from ptae_lite import published
from ptae_lite.display import style
from ptae_lite.display.panels import Panel
from ptae_lite.evaluation import CHANCE

SCORES = ("describe_accuracy", "execute_nrmse")


def by_share(table: pd.DataFrame) -> Figure:
    """Describe accuracy and execute error over the share of labelled samples.

    Beside ours stand chance and the numbers that the paper's text states.
    """
    figure, axes = plt.subplots(1, 2, figsize=(7.5, 2.9))
    _draw(axes, table)
    return style.closed(figure)


def card(table: pd.DataFrame, said: pd.DataFrame, share: float) -> Figure:
    """The figure of `by_share` with one share marked, and what its model says of some clips."""
    figure = plt.figure(figsize=(7.5, 4.6))
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 2))
    _draw([figure.add_subplot(grid[0, column]) for column in range(2)], table, mark=share)
    text = figure.add_subplot(grid[1, :])
    text.axis("off")
    for x, heading in ((0, "the clip shows"), (0.36, "the model says")):
        text.text(x, 0.95, heading, fontsize=8, color=style.GREY, transform=text.transAxes)
    rows = _first_seed(said, share)
    for line, row in enumerate(rows.itertuples(), start=1):
        look = {"family": "monospace", "fontsize": 8, "transform": text.transAxes}
        colour, verdict = (style.BLUE, "right") if row.right else (style.RED, "WRONG")
        y = 0.95 - line / (len(rows) + 1.5)
        text.text(0, y, row.truth, **look)
        text.text(0.36, y, f"{verdict}   {_words(row.said)}", color=colour, **look)
    return style.closed(figure)


def describe(table: pd.DataFrame, said: pd.DataFrame, share: float) -> str:
    """What `card` shows, in words."""
    here = table[table["share"] == share]
    accuracy, error = (here[column].mean() for column in SCORES)
    answers = "; ".join(
        f"{row.truth}: {'right' if row.right else 'wrong'}, {_words(row.said)}"
        for row in _first_seed(said, share).itertuples()
    )
    return (
        f"With {share:g} % of the training samples labelled ({here['labelled'].iloc[0]}), describe "
        f"is right for {accuracy:.1f} % of the test clips, and execute has an NRMSE of "
        f"{error:.2f} %. The model says of some clips: {answers}."
    )


def panel(table: pd.DataFrame, said: pd.DataFrame, start: float | None = None) -> Panel:
    """The slider over the shares in the stored tables; it begins at `start`, or the smallest."""
    shares = sorted({float(share) for share in table["share"]})
    shares = [int(share) if share.is_integer() else share for share in shares]
    return Panel(
        partial(card, table, said),
        {"share": shares},
        "Results by the share of labelled samples",
        start=None if start is None else {"share": start},
        labels={"share": "labelled samples, %"},
        describe=partial(describe, table, said),
    )


def _first_seed(said: pd.DataFrame, share: float) -> pd.DataFrame:
    rows = said[said["share"] == share]
    return rows[rows["seed"] == rows["seed"].min()]


def _words(said) -> str:
    return said if isinstance(said, str) and said else "(nothing)"


def _draw(axes, table: pd.DataFrame, mark: float | None = None) -> None:
    mean = table.groupby("share")[list(SCORES)].mean()
    seeds = int(table.groupby("share").size().max())
    for axis, column in zip(axes, SCORES, strict=True):
        axis.plot(mean.index, mean[column], "o-", label=f"ours, {_seeds(seeds)}")
        if seeds > 1:
            axis.plot(table["share"], table[column], ".", color=style.SKY, label="one seed")
        if mark is not None:
            axis.plot(mark, mean.loc[mark, column], "s", markersize=12, color=style.RED,
                      fillstyle="none", markeredgewidth=2, label="here")  # fmt: skip
        axis.set_xscale("log")
        axis.set_xticks(mean.index)
        axis.xaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{share:g}"))
        axis.minorticks_off()
        axis.set_xlabel("labelled samples, %")
    paper = published.DESCRIBE_BY_SAMPLES
    axes[0].plot(list(paper), [claim.value for claim in paper.values()], "^", color=style.GREY,
                 fillstyle="none", label="stated in the paper's text")  # fmt: skip
    axes[0].axhline(CHANCE, color=style.GREY, linestyle=":", label="chance")
    axes[0].set(ylabel="describe accuracy, %", ylim=(-3, 105))
    axes[1].set(ylabel="execute NRMSE, %", ylim=(0, None))
    legend = axes[0].get_legend_handles_labels()
    axes[0].figure.legend(*legend, loc="outside upper center", ncols=4)


def _seeds(count: int) -> str:
    return "one seed" if count == 1 else f"mean of {count} seeds"

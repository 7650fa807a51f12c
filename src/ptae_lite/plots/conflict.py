"""Figures that compare conflicts: what they cost, one by one, turned round, and where heads look.

All but `attention` are drawn from the table of `experiments.incongruence_table`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float, UInt8
from matplotlib.figure import Figure

from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT, PLACES
from ptae_lite.plots import style
from ptae_lite.plots.incongruence import MODELS, SHOWN

KINDS = (("words", SHOWN[:2], "points of accuracy"), ("motion", SHOWN[2:], "points of NRMSE"))
CUBE = {"language": "colour", "action": "position"}  # the aspect of the cube


def price(paid: pd.DataFrame) -> Figure:
    """What the format costs (hollow) and what three conflicts cost on top (filled), by seed.

    Args:
        paid: the table of `incongruence_table.damage`, of one or more models.
    """
    models = [name for name in MODELS if name in set(paid["model"])]
    figure, panels = plt.subplots(2, 1, figsize=(style.WIDTH, 1.7 + 1.3 * len(models)))
    for axes, (_, signals, label) in zip(panels, KINDS, strict=True):
        for y, (signal, model) in enumerate((s, m) for s in signals for m in models):
            own = paid[(paid["signal"] == signal) & (paid["model"] == model)]
            name, colour, _, mark = MODELS[model]
            look = {"color": colour, "ms": 6, "ls": "none", "marker": mark}
            axes.plot(own["format"], [y] * len(own), mfc="white", **look)
            axes.plot(own["conflict"], [y] * len(own), label=name, **look)
            at = own["conflict"].mean(), y
            axes.annotate(f"{at[0]:.1f}" if at[0] < 20 else f"{at[0]:.0f}", at, (0, 6),
                          textcoords="offset points", ha="center",
                          color=style.ink(colour))  # fmt: skip
        axes.axvline(0, color=style.GREY, lw=1)
        axes.axhline(len(models) - 0.6, color="#BBBBBB", lw=0.8)
        middle = (len(models) - 1) / 2
        axes.set_yticks([middle, middle + len(models)], signals)
        axes.set_ylim(2 * len(models) - 0.5, -0.8)
        axes.margins(x=0.06)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel(f"cost, {label}")
    lines = panels[0].get_legend_handles_labels()[0][: len(models)] if len(models) > 1 else []
    grey = {"color": style.GREY, "ls": "none", "marker": "o"}
    lines += panels[0].plot([], [], mfc="white", label="the format alone", **grey)
    lines += panels[0].plot([], [], label="three conflicts on top", **grey)
    figure.legend(handles=lines, loc="outside lower center", ncols=2)
    return style.closed(figure)


def turned(table: pd.DataFrame) -> Figure:
    """A false sentence against a false clip, for each model: words in three panels, motion in one.

    A line falls where the false clip does more harm to words, and rises where it does more to
    motion. Small marks are seeds. No conflict here is one of speed.
    """
    figure, axes = plt.subplots(2, 2, figsize=(style.WIDTH, 5.4))
    asked = [(("describe", "repeat language"), aspects, "right, %")
             for aspects in (("action",), ("colour",), ("action", "colour"))]  # fmt: skip
    asked.append((("repeat action", "execute"), ("action",), "NRMSE, %"))
    for axis, (signals, aspects, label) in zip(axes.flat, asked, strict=True):
        for k, name in enumerate(name for name in MODELS if name in set(table["model"])):
            model, colour, dash, mark = MODELS[name]
            own = table[table["model"] == name]
            seeds = [_false(own, signal, aspects) for signal in signals]
            for x, values in enumerate(seeds):
                at = x + 0.04 * (k - 1)
                axis.plot([at] * len(values), values, mark, color=colour, ms=3, alpha=0.5)
            means = [values.mean() for values in seeds]
            ends = [0.04 * (k - 1), 1 + 0.04 * (k - 1)]
            axis.plot(ends, means, dash, marker=mark, color=colour, label=model)
        words = signals[0] in ANSWERS_WORDS
        title = f"{'words' if words else 'motion'}: false {' and '.join(aspects)}"
        axis.set(title=title, ylabel=label, xlim=(-0.3, 1.3))
        axis.set_ylim(*((-4, 106) if words else (0, None)))
        labels = ("sentence", signals[0]), ("clip", signals[1].replace(" ", "\n"))
        axis.set_xticks([0, 1], [f"false {what}\n({signal})" for what, signal in labels])
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)


def _false(rows: pd.DataFrame, signal: str, aspects: Sequence[str]) -> np.ndarray:
    """The seeds' scores of a signal with these aspects false in all of its extra input."""
    place = EXTRA_INPUT[signal]
    names = " ".join(CUBE[place] if aspect == "colour" else aspect for aspect in aspects)
    rows = rows[(rows["signal"] == signal) & (rows["conflict_in"] == place)]
    score = "accuracy" if signal in ANSWERS_WORDS else "nrmse"
    return rows[rows["aspects"] == names].sort_values("seed")[score].to_numpy()


def single(table: pd.DataFrame) -> Figure:
    """One conflict at a time, as two tables in colours: the darker, the more harm."""
    figure, panels = plt.subplots(2, 1, figsize=(style.WIDTH, 4.2))
    for axes, (kind, signals, _) in zip(panels, KINDS, strict=True):
        words, rows = kind == "words", {}
        for signal in signals:
            own = table[table["signal"] == signal]
            score = own["accuracy" if words else "nrmse"]
            for place in PLACES[EXTRA_INPUT[signal]]:
                of = {"vision": "video", "proprioception": "joints", "action": "clip",
                      "language": "sentence"}[place]  # fmt: skip
                calm = score[own["conflict_in"] == "congruent"].mean()
                here = own["conflict_in"] == place
                rows[f"{signal}, {of}"] = [calm] + [
                    score[here & (own["aspects"] == aspect)].mean()
                    for aspect in ("action", CUBE[EXTRA_INPUT[signal]], "speed")]  # fmt: skip
        values = np.array(list(rows.values()))
        shade = 100 - values if words else values - values.min()
        axes.imshow(shade, cmap="Oranges", vmin=0, vmax=1.4 * shade.max(), aspect="auto")
        for (i, j), value in np.ndenumerate(values):
            axes.text(j, i, f"{value:.0f}" if words else f"{value:.1f}", ha="center", va="center")
        axes.set_yticks(range(len(rows)), list(rows))
        axes.set_xticks(range(4), ["nothing", "action", "colour or\nposition", "speed"])
        axes.set_title("right, %" if words else "NRMSE, %")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.grid(False)
    return style.closed(figure)


def attention(
    weights: Mapping[str, Mapping[str, Float[np.ndarray, "heads T"]]],
    shots: UInt8[np.ndarray, "shots height width 3"],
) -> Figure:
    """Where each head attends over a clip: a column for each signal, a line for each input.

    Args:
        weights: signal to input to the share of each frame.
        shots: pictures from the first to the last frame, shown above each column.
    """
    heads = len(next(iter(next(iter(weights.values())).values())))
    strip = np.concatenate(list(shots), axis=1)
    figure, grid = plt.subplots(
        1 + heads, len(weights), figsize=(style.WIDTH, 1.2 + 1.1 * heads), squeeze=False,
        sharex="col", gridspec_kw={"height_ratios": [0.55, *[1] * heads]},
    )  # fmt: skip
    looks = ((style.GREY, ":"), (style.ORANGE, "--"), (style.BLUE, "-"))
    for column, (signal, inputs) in zip(grid.T, weights.items(), strict=True):
        last = next(iter(inputs.values())).shape[1]
        column[0].imshow(strip, extent=(0, last, 0, 1), aspect="auto")
        column[0].set(title=signal, yticks=[])
        column[0].tick_params(length=0)
        column[0].spines[:].set_visible(False)
        column[0].grid(False)
        for head, axis in enumerate(column[1:]):
            for (name, shares), (colour, dash) in zip(inputs.items(), looks, strict=False):
                axis.plot(100 * shares[head], dash, color=colour, label=name)
            if signal == next(iter(weights)):
                axis.set_ylabel(f"head {head + 1}, %")
        column[-1].set_xlabel("frame")
    figure.legend(*grid[1, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return style.closed(figure)

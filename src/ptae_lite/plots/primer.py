"""The pictures of the primer: convolution, LSTM, softmax, ridge regression, NRMSE.

Each function returns a matplotlib figure that is off pyplot's list.
"""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

from ptae_lite.plots import style

EDGE = np.array([[-1.0, 0.0, 1.0]] * 3)  # answers to a vertical edge, dark to light
ARROW = {"arrowstyle": "-|>", "color": style.GREY, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}


def convolution(image: Float[np.ndarray, "rows columns"]) -> Figure:
    """An image with one window marked, the weights, and the answer at every place."""
    windows = np.lib.stride_tricks.sliding_window_view(image, (3, 3))
    answer = (windows * EDGE).sum((2, 3))
    row, column = np.unravel_index(answer.argmax(), answer.shape)
    figure, (left, middle, right) = plt.subplots(
        1, 3, figsize=(style.WIDTH, 2.5), width_ratios=(1.3, 0.6, 1.3)
    )
    left.imshow(image, cmap="gray")
    left.add_patch(Rectangle((column - 0.5, row - 0.5), 3, 3, fill=False, ec=style.ORANGE, lw=2))
    middle.imshow(EDGE, cmap="PuOr_r", vmin=-2, vmax=2)
    for (r, c), weight in np.ndenumerate(EDGE):
        middle.text(c, r, f"{weight:.0f}", ha="center", va="center")
    far = np.abs(answer).max()
    right.imshow(answer, cmap="PuOr_r", vmin=-far, vmax=far)
    right.plot(column, row, "s", ms=7, mfc="none", mec="black", mew=2)
    for axes, title in zip((left, middle, right), ("image", "weights", "answer"), strict=True):
        axes.set(title=title, xticks=[], yticks=[])
        axes.grid(False)
    return style.closed(figure)


def lstm(inputs=("frame 1", "frame 2", "frame 3"), outputs=("", "", "answer")) -> Figure:
    """One cell, drawn once for each step, with the state that it hands on to itself."""
    figure, axes = plt.subplots(figsize=(style.WIDTH, 2.5))
    for i, (given, said) in enumerate(zip(inputs, outputs, strict=True)):
        x = 2.4 * i
        box = FancyBboxPatch(
            (x, 0), 1.3, 0.8, boxstyle="round,pad=0.05", fc="#DCEBF5", ec=style.BLUE
        )
        axes.add_patch(box)
        axes.text(x + 0.65, 0.4, "LSTM\nsame weights", ha="center", va="center")
        axes.annotate("", (x + 0.65, -0.06), (x + 0.65, -0.55), arrowprops=ARROW)
        axes.text(x + 0.65, -0.75, given, ha="center", va="center")
        if said:
            axes.annotate("", (x + 0.65, 1.4), (x + 0.65, 0.86), arrowprops=ARROW)
            axes.text(x + 0.65, 1.57, said, ha="center", va="center")
        if i + 1 < len(inputs):
            axes.annotate("", (x + 2.34, 0.4), (x + 1.37, 0.4), arrowprops=ARROW)
            axes.text(x + 1.85, 0.62, "state", ha="center", color=style.GREY)
    axes.set(xlim=(-0.2, 2.4 * len(inputs) - 0.8), ylim=(-1.0, 1.8))
    axes.set_axis_off()
    return style.closed(figure)


def softmax(scores: Mapping[str, float]) -> Figure:
    """Scores of some words, and the probabilities that softmax makes of them."""
    values = np.array(list(scores.values()))
    shares = np.exp(values) / np.exp(values).sum()
    figure, row = plt.subplots(1, 2, figsize=(style.WIDTH, 2.0), sharey=True)
    for axes, lengths, form in zip(row, (values, shares), ("{:.1f}", "{:.2f}"), strict=True):
        bars = axes.barh(list(scores), lengths, color=style.SKY)
        axes.bar_label(bars, [form.format(v) for v in lengths], padding=3)
        axes.margins(x=0.3)
    row[0].set(title="scores: any numbers")
    row[1].set(title="probabilities: sum 1")
    row[0].invert_yaxis()
    return style.closed(figure)


def ridge(strengths=(0.0, 0.03, 10.0), powers: int = 9, seed: int = 50) -> Figure:
    """Ten noisy points and the same curve fitted with a weak, a fair and a strong penalty."""
    rng = np.random.default_rng(seed)
    x, dense = np.linspace(-1, 1, powers + 1), np.linspace(-1, 1, 200)
    y = np.sin(2.5 * x) + rng.normal(0, 0.25, len(x))
    features, grid = (np.vander(points, powers + 1) for points in (x, dense))
    figure, row = plt.subplots(1, len(strengths), figsize=(style.WIDTH, 2.2), sharey=True)
    for axes, strength in zip(row, strengths, strict=True):
        penalty = strength * np.eye(powers + 1)
        weights = np.linalg.solve(features.T @ features + penalty, features.T @ y)
        axes.plot(dense, np.sin(2.5 * dense), "--", color=style.GREY, lw=1)
        axes.plot(dense, grid @ weights, color=style.BLUE)
        axes.plot(x, y, "o", ms=4, color=style.ORANGE)
        axes.set(title=f"$\\lambda$ = {strength:g}", ylim=(-2, 2))
    return style.closed(figure)


def nrmse(
    track_deg: Float[np.ndarray, " T"], answer_deg: Float[np.ndarray, " T"], range_deg: float
) -> Figure:
    """A joint's angle and an answer to it, the error between them, and the range it is held to."""
    figure, axes = plt.subplots(figsize=(style.WIDTH, 2.5))
    frames = np.arange(len(track_deg))
    axes.fill_between(frames, track_deg, answer_deg, color=style.ORANGE, alpha=0.35, lw=0)
    axes.plot(track_deg, color=style.BLUE)
    axes.plot(answer_deg, "--", color=style.RED)
    last = len(track_deg) - 1
    low = min(track_deg.min(), answer_deg.min())
    x = 1.06 * last
    axes.annotate("", (x, low + range_deg), (x, low), arrowprops=ARROW | {"arrowstyle": "<->"})
    axes.text(1.08 * last, low + range_deg / 2, "range", va="center")
    half = len(track_deg) // 2
    middle = half // 2 + int(np.abs(track_deg - answer_deg)[half // 2 : -half // 2].argmax())
    axes.text(middle, track_deg[middle], "recorded   ", ha="right", va="center", color=style.BLUE)
    axes.text(middle, answer_deg[middle], "     answer", va="center", color=style.RED)
    top = max(low + range_deg, track_deg.max(), answer_deg.max())
    axes.set(xlabel="frame", ylabel="degrees", xlim=(0, 1.22 * last), ylim=(low - 2, top + 2))
    return style.closed(figure)

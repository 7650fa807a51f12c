"""Panels of a study's table: each seed is seen, and the mean of the seeds."""

import pandas as pd
import pytest

from ptae_lite.errors import PTAEError
from ptae_lite.plots.vision import dots_by_seed

ROWS = pd.DataFrame({
    "encoder": ["a"] * 4 + ["b"], "seed": [0, 1, 0, 1, 0], "n": [10, 10, 20, 20, 10],
    "right": [50, 60, 70, 90, 5], "error": [5, 4, 3, 1, 9],
})  # fmt: skip


def test_each_panel_has_dots_means_and_levels():
    level = pd.Series({"right": 99, "error": 2})
    panels = {"right": "right, %", "error": "error, mm"}
    figure = dots_by_seed(ROWS, "encoder", "n", panels, "shown", {"PCA": level})
    assert [axes.get_title() for axes in figure.axes] == list(panels.values())
    right = figure.axes[0]
    dots, mean, _, other, flat = (line.get_xydata().tolist() for line in right.lines)
    assert dots == [[10, 50], [10, 60], [20, 70], [20, 90]]
    assert mean == [[10, 55], [20, 80]] and other == [[10, 5]]
    assert [y for _, y in flat] == [99, 99]
    assert figure.axes[-1].get_xlabel() == "shown"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b", "PCA"]


def test_with_ticks_each_doubling_is_a_step_of_the_same_width():
    rows = ROWS.assign(n=[0, 10, 20, 40, 80])
    (axes,) = dots_by_seed(rows, "encoder", "n", {"right": "%"}, "shown", ticks=[0, 10, 1000]).axes
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0", "10", "1,000"]
    assert not len(axes.get_xticks(minor=True))
    places = axes.transData.transform([(n, 0) for n in (0, 10, 20, 40, 80)])[:, 0]
    steps = [b - a for a, b in zip(places, places[1:], strict=False)]
    assert min(steps) > 0 and steps[1:] == pytest.approx([steps[1]] * 3)


def test_more_groups_than_can_be_told_apart_are_refused():
    rows = pd.DataFrame({"encoder": list("abcde"), "n": 1, "right": 2})
    with pytest.raises(PTAEError, match="distinguish 4 groups, not 5"):
        dots_by_seed(rows, "encoder", "n", {"right": "%"}, "shown")

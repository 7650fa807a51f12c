"""The figures of the closed loop show the values they are given."""

import pandas as pd
import pytest

from ptae_lite.plots import closed_loop


def test_the_parts_of_a_bar_are_the_ends_of_the_episodes():
    table = pd.DataFrame({
        "model": ["a"] * 4 + ["b"],
        "reason": ["done", "done", "the wrong speed", "a joint at its limit", "done"],
    })  # fmt: skip
    (axis,) = closed_loop.endings(table, {"b": "B", "a": "A"}).axes
    widths = {bars.get_label(): [bar.get_width() for bar in bars] for bars in axis.containers}
    assert widths == {"done": [100, 50], "the wrong speed": [0, 25], "another reason": [0, 25]}
    assert [label.get_text() for label in axis.get_yticklabels()] == ["B", "A"]


def test_a_line_joins_the_trainings_of_one_seed():
    table = pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, 5.0]}, index=[0, 1])
    figure = closed_loop.seed_by_seed({"one": table, "two": 2 * table}, "success")
    drawn = [[list(line.get_ydata()) for line in axis.lines] for axis in figure.axes]
    assert drawn == [[[1, 3], [2, 5]], [[2, 6], [4, 10]]]


def test_a_share_stands_beside_its_dot():
    (axis,) = closed_loop.shares({"a": {"x": 40.2, "y": 60}, "b": {"z": 9.7}}, "%").axes
    assert [text.get_text() for text in axis.texts] == ["40", "60", "10"]
    assert [line.get_xdata()[0] for line in axis.lines] == [40.2, 60, 9.7]


@pytest.mark.parametrize(("left", "at"), [((), 1.0), (("a",), 0.5)])
def test_each_model_is_named_beside_one_of_its_marks(left, at):
    rates = pd.DataFrame({"model": ["a", "a", "b"], "seed": [0, 1, 0], "success": [10, 20, 30]})
    scores = rates.assign(execute_nrmse=[1.0, 0.5, 3.0])[["model", "seed", "execute_nrmse"]]
    (axis,) = closed_loop.error_against_success(rates, scores, {"a": "A", "b": "B"}, left).axes
    assert {text.get_text(): text.xy[0] for text in axis.texts} == {"A": at, "B": 3}


def test_a_success_is_joined_with_that_of_the_same_seed():
    rates = pd.DataFrame(
        {"model": ["a", "a", "b", "b"], "seed": [0, 1, 1, 0], "success": [10, 20, 40, 30]}
    )
    (axis,) = closed_loop.by_model(rates, {"b": "B", "a": "A"}, {}).axes
    lines = [list(line.get_xdata()) for line in axis.lines if line.get_linestyle() == "-"]
    assert lines == [[30, 10], [40, 20]]

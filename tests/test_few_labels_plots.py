"""Figures of chapter 04 show the values that they were given."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.plots import encoders as encoder_plots
from ptae_lite.plots import few_labels as plots


def texts(axes):
    return [text.get_text() for text in axes.texts]


def test_a_strip_shows_each_value_and_the_mean():
    rows = {"few": [1.0, 3.0], "many": [8.0, 10.0, 12.0]}
    left, right = plots.strips({"one": rows, "other": {**rows, "few": [5.0]}}, "%").axes
    dots = [line for line in left.lines if line.get_linestyle() == "None"]
    assert [list(dot.get_xdata()) for dot in dots] == list(rows.values())
    assert texts(left) == ["mean 2", "mean 10"] and texts(right) == ["mean 5", "mean 10"]
    assert left.get_xlim()[1] > 12 and left.get_title() == "one"
    (axes,) = plots.strips({"": rows}, "%", chance=3.0).axes
    dotted = [line for line in axes.lines if line.get_linestyle() == ":"]
    assert [list(line.get_xdata()) for line in dotted] == [[3, 3]]
    assert " chance" in texts(axes)


def test_curves_are_named_and_their_names_keep_apart():
    curves = {name: pd.Series({1: 10.0, 100: end}) for name, end in (("a", 20.0), ("b", 90.0))}
    (axes,) = plots.by_share({"%": curves}, "share", levels={"chance": 3.0}).axes
    named = {text.get_text(): text.get_position()[1] for text in axes.texts}
    assert set(named) == {"a", "b", "chance"} and abs(named["a"] - named["b"]) > 5
    assert [list(line.get_ydata()) for line in axes.lines[:2]] == [[10, 20], [10, 90]]
    four = {name: curves["a"] for name in "abcd"}
    legend = plots.by_share({"%": four}, "share").axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == list("abcd")


def test_a_tile_is_red_where_a_count_must_not_be():
    wrong = np.array([[False, True]])
    counts = {"clean": np.array([[3, 0]]), "leak": np.array([[3, 1]])}
    clean, leak = plots.tiles(counts, ["label"], ["describe", "repeat"], wrong).axes
    paint = [axes.images[0].get_array().tolist() for axes in (clean, leak)]
    assert paint == [[[1, 0]], [[1, 2]]] and texts(leak) == ["3", "1"]


def test_a_mark_a_list_with_one_colour_a_share():
    points = pd.DataFrame({"x": [1.0, 2, 50], "y": [2.0, 1, 60], "labelled": [1, 1, 10]})
    (axes,) = plots.paired(points, ("baseline, %", "network, %"), "labelled").axes
    diagonal, few, many = axes.lines
    assert list(few.get_xdata()) == [1, 2] and list(many.get_ydata()) == [60]
    assert few.get_color() is not many.get_color()
    assert list(diagonal.get_xdata()) == list(diagonal.get_ydata())
    assert texts(axes) == ["network is better", "baseline is better"]


def test_schedules_are_dark_where_a_sentence_is_used():
    used = np.eye(3, dtype=bool)
    axes = plots.schedules({"left": used, "right": ~used}).axes
    assert (axes[0].images[0].get_array() == ~used).all()
    assert (axes[1].images[0].get_array() == used).all()


def test_sentences_stand_below_their_images():
    images = np.zeros((2, 4, 6, 3), np.uint8)
    first, second = plots.sentences_below(images, {"own": ["a", "b"], "other": ["c", "d"]}).axes
    assert first.get_xlabel() == "own: a\nother: c" and second.get_xlabel() == "own: b\nother: d"


@pytest.mark.parametrize(("value", "moved"), [(50.0, False), (98.0, True)])
def test_numbers_of_marks_do_not_touch(value, moved):
    (axes,) = encoder_plots.marks({"row": {"a": 97.0, "b": value}}, "%").axes
    places = [text.xy[0] for text in axes.texts if hasattr(text, "xy")]
    assert abs(places[0] - places[1]) > 5
    assert (places != [97.0, value]) == moved

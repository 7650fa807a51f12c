"""The figures that compare image encoders show the values they are given."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.plots import encoders, vision


def test_a_change_within_its_limit_is_green():
    index = [("a", 64), ("a", 128), ("b", 64)]
    table = pd.DataFrame({"error": [-30.0, -9.0, 15.0], "colours": [2.9, 3.1, -7.0]}, index)
    image = encoders.changes(table, {"error": 10, "colours": 3}).axes[0].images[0]
    np.testing.assert_array_equal(image.get_array(), [[2, 0], [0, 1], [1, 2]])


def test_a_range_goes_from_the_lowest_seed_to_the_highest():
    rows = pd.DataFrame({"encoder": ["a", "a", "b"], "score": [1.0, 4.0, 2.0]})
    lines = encoders.ranges({"all": rows}, "encoder", {"score": "score"}).axes[0].lines
    assert [list(line.get_xdata()) for line in lines] == [[1, 4], [2.5], [2, 2], [2]]


def test_numbers_of_marks_that_touch_are_moved_apart():
    axes = encoders.marks({"row": {"a": 50.0, "b": 50.0, "c": 90.0}}, "%").axes[0]
    values = [(text.get_text(), text.xy[0]) for text in axes.texts[1:]]
    assert [text for text, _ in values] == ["50", "50", "90"]
    places = [place for _, place in values]
    assert places[1] - places[0] > 5 and sum(places[:2]) / 2 == pytest.approx(50)
    assert places[2] == 90


def test_a_ruler_has_each_value_with_its_name():
    axes = encoders.ruler({"floor": 0.5, "mean": 0.75}, "loss").axes[0]
    assert [text.get_text() for text in axes.texts] == ["floor: 0.500", "mean: 0.750"]


def test_an_arrow_leads_from_each_stage_to_the_next():
    def stage(**by_seed):
        rows = [("a", seed, x, y) for seed, (x, y) in by_seed.items()]
        return pd.DataFrame(rows, columns=["encoder", "seed", "x", "y"])

    stages = {
        "short": stage(s0=(1.0, 8.0), s1=(3.0, 12.0)),
        "long": stage(s0=(0.5, 18.0), s1=(1.5, 22.0)),
        "longest": stage(s1=(0.4, 30.0)),
    }
    figure = encoders.in_use(stages, stage(), "x", "y", ("x", "y"), {})
    arrows = [(tuple(arrow.xyann), tuple(arrow.xy)) for arrow in figure.axes[0].texts]
    assert all(arrow.arrow_patch is not None for arrow in figure.axes[0].texts)
    # The last one joins a seed with itself: the longest training has only that one.
    assert arrows == [((2, 10), (1, 20)), ((1.5, 22), (0.4, 30))]


def test_the_code_is_the_narrowest_bar_of_the_funnel():
    stages = [("image", (1, 4, 4)), ("code", (2,)), ("image", (1, 4, 4))]
    bars = vision.funnel(stages, np.zeros((4, 4)), np.ones((4, 4))).axes[1].patches
    widths = [bar.get_width() for bar in bars]
    assert widths == pytest.approx([1, np.sqrt(2 / 16), 1])
    assert bars[1].get_facecolor() != bars[0].get_facecolor()

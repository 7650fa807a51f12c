"""The figures of the watching policy show the values they are given."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.experiments import episodes
from ptae_lite.plots import watching as plots
from ptae_lite.robot.closed_loop import Episode


def test_the_correction_is_0_where_the_cube_was_and_1_where_it_is():
    table = pd.DataFrame({
        "move_mm_x": [30, 30, 0, 30, 0], "move_mm_y": [0, 40, 20, 0, 0],
        "hand_mm_x": [0, 30, 5, np.nan, 3], "hand_mm_y": [9, 40, 10, np.nan, 3],
    })  # fmt: skip
    np.testing.assert_allclose(plots.correction(table), [0, 1, 0.5, np.nan, np.nan])


def test_a_mark_is_the_median_and_a_line_the_range_of_the_trainings():
    rates = pd.DataFrame({
        "model": ["a"] * 3 + ["b"], "condition": ["x"] * 4, "seed": [0, 1, 2, 0],
        "success": [90, 70, 80, 30],
    })  # fmt: skip
    (axis,) = plots.by_condition(rates, {"a": "A", "b": "B"}, {"x": "X", "y": "Y"}).axes
    marks = [line.get_xdata().tolist() for line in axis.lines]
    np.testing.assert_equal(marks, [[80, np.nan], [30, np.nan]])
    assert axis.collections[0].get_segments()[0][:, 0].tolist() == [70, 90]


def test_each_episode_is_a_mark_and_the_line_their_median():
    table = pd.DataFrame({
        "model": ["a"] * 3, "success": [1, 0, 1], "move_mm_x": 10, "move_mm_y": 0,
        "hand_mm_x": [10, 0, 90], "hand_mm_y": 0,
    })  # fmt: skip
    (axis,) = plots.corrections(table, {"a": "A"}).axes
    bad, good, median = (line.get_xdata() for line in axis.lines[:3])
    assert list(bad) == [0] and list(good) == [1, plots.WITHIN[1]] and list(median) == [1, 1]


def test_a_line_joins_the_amounts_and_not_the_controls():
    rates = pd.DataFrame({
        "model": ["none", "none", "none", "all", "blind"], "seed": [0, 1, 2, 0, 0],
        "success": [50, 60, 40, 90, 30],
    })  # fmt: skip
    (axis,) = plots.amounts(rates, {"none": "no clips", "all": "all"}, {"blind": "blind"}).axes
    (joined,) = [line for line in axis.lines if list(line.get_xdata()) == [50, 90]]
    assert joined.get_linestyle() == "-"
    assert [label.get_text() for label in axis.get_yticklabels()] == ["no clips", "all", "blind"]


def test_bars_count_the_draws_and_the_scenes_without_a_hard_move():
    table = pd.DataFrame({"draws": [1, 1, 3, 3], "valid": [1, 1, 1, 0]})
    (axis,) = plots.draws(table).axes
    assert [bar.get_height() for bar in axis.patches] == [2, 0, 1, 1]
    assert axis.get_xticklabels()[-1].get_text() == "none"


@pytest.fixture
def snatched():
    """An episode in which the left cube goes 30 mm away while the arm rests at home."""
    stage = next(iter(episodes.stages().values()))
    cubes = np.zeros((30, 2, 7))
    cubes[:, :, :2], cubes[:, :, 2], cubes[:, :, 6] = stage.places_m, 1, 1
    cubes[10:, 0, 0] += 0.03
    episode = Episode(np.zeros((30, 5)), cubes, "home", 10)
    return episodes.StoredEpisode(stage, "push red fast", episode, None)


def test_cubes_are_drawn_before_and_after_the_move(snatched):
    (axis,) = plots.ways_above({"way": snatched}).axes
    before, after = axis.patches[0], axis.patches[2]
    assert after.get_y() - before.get_y() == pytest.approx(0.03)
    assert not before.get_fill() and after.get_fill()
    assert axis.patches[1].get_y() == axis.patches[3].get_y()

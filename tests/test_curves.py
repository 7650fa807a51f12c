"""Figures of joints, attention and learning: each draws its numbers."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ptae_lite.plots import model as model_plots
from ptae_lite.robot.arm import JOINT_NAMES


def line(axes, label):
    (found,) = [one for one in axes.lines if one.get_label() == label]
    return found.get_xdata(), found.get_ydata()


def drawn(figure):
    """The figure, when it can be drawn and no notebook would show it a second time."""
    assert isinstance(figure, Figure) and plt.get_fignums() == []
    figure.canvas.draw()
    return figure


def test_trajectories_are_in_degrees_over_the_recorded_ones():
    truth = np.radians(np.arange(50)[:, None] + 10 * np.arange(5))
    made = {"one": np.zeros((99, 5)), "two": np.radians(np.full((99, 5), 7.0))}
    figure = drawn(model_plots.trajectories(truth, made, "title"))
    assert [axes.get_title() for axes in figure.axes] == list(JOINT_NAMES)
    for j, axes in enumerate(figure.axes):
        np.testing.assert_allclose(line(axes, "recorded")[1], np.arange(50) + 10 * j)
        np.testing.assert_allclose(line(axes, "two")[1], [7] * 50)  # cut to the clip
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["recorded", "one", "two"]


def test_an_attention_map_has_a_picture_for_each_head():
    weights = np.random.default_rng(0).random((4, 6, 100))
    figure = drawn(model_plots.attention_map(weights, ["describe", "<eos>"], 50))
    pictures = [axes.images[0] for axes in figure.axes if axes.images]
    assert len(pictures) == 4
    for head, picture in enumerate(pictures):
        np.testing.assert_array_equal(picture.get_array(), weights[head, :2])
        assert picture.get_clim() == (0, weights.max())


def test_a_learning_curve_has_a_point_for_each_epoch():
    history = np.array([[3.0, 0.1], [2.0, 0.05], [1.0, 0.01]])
    figure = drawn(model_plots.learning_curve(history))
    for axes, column in zip(figure.axes, history.T, strict=True):
        assert axes.get_yscale() == "log"
        assert axes.lines[0].get_xdata().tolist() == [1, 2, 3]
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), column)

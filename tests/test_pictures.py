"""The figures of the first chapters can be drawn, show what they were given, and stay closed."""

import io

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from ptae_lite.errors import PTAEError
from ptae_lite.plots import simulation as simulation_plots
from ptae_lite.plots import style
from ptae_lite.plots import vision as vision_plots
from ptae_lite.robot import arm
from ptae_lite.robot.inverse import home_rad


def image(value):
    return np.full((12, 16, 3), value, np.uint8)


@pytest.fixture
def cubes():
    made = np.zeros((2, 7))
    made[:, :3], made[:, 6] = [[0.40, 0.17, 0.585], [0.40, 0.03, 0.585]], 1
    return made


def drawn(figure):
    """The figure, when it can be drawn and no notebook would show it a second time."""
    assert isinstance(figure, Figure) and plt.get_fignums() == []
    figure.canvas.draw()
    return figure


def test_a_grid_holds_every_image_at_its_place_below_the_name_of_its_row():
    rows = {"a": [image(v) for v in (10, 20, 30)], "b": [image(v) for v in (40, 50, 60)]}
    (axes,) = drawn(simulation_plots.grid(rows, ["x", "y", "z"])).axes
    sheet = axes.images[0].get_array()
    gap = simulation_plots.GAP_PX
    assert sheet.shape[1:] == (3 * 16 + 2 * gap, 4)  # with a channel: it is opaque
    tops = (0, len(sheet) - 12)
    for top, values in zip(tops, ((10, 20, 30), (40, 50, 60)), strict=True):
        for c, value in enumerate(values):
            left = c * (16 + gap)
            assert (sheet[top : top + 12, left : left + 16, :3] == value).all()
    assert tops[1] > 12 + gap and (sheet[12 : tops[1]] == 255).all()
    assert [text.get_text() for text in axes.texts] == ["a", "b"]
    for text, top in zip(axes.texts, tops, strict=True):
        assert top - 12 < text.get_position()[1] <= top
    assert [label.get_text() for label in axes.get_xticklabels()] == ["x", "y", "z"]


def test_groups_of_a_grid_have_a_wider_gap_and_a_heading_each():
    (axes,) = drawn(simulation_plots.grid({"a": [image(9)] * 3}, ["x", "y"], groups=[2, 1])).axes
    sheet = axes.images[0].get_array()
    assert sheet.shape[1] == 3 * 16 + simulation_plots.GAP_PX + simulation_plots.GROUP_GAP_PX
    assert axes.get_xticks().tolist() == [18.5, 65]


@pytest.mark.parametrize(
    ("rows", "groups"),
    [
        ({"a": [image(1)] * 3, "b": [image(1)] * 2}, None),
        ({"a": [image(1)] * 2, "b": [image(1)] * 3}, None),
        ({"a": [image(1)] * 3}, [2]),
        ({"a": [image(1)] * 3}, [2, 2]),
    ],
)
def test_a_ragged_grid_is_refused(rows, groups):
    with pytest.raises(PTAEError, match=r"each row of this grid must have \d images"):
        simulation_plots.grid(rows, groups=groups)


def test_marked_images_have_their_marks():
    points = {name: np.array([[10, 20], [30, 40]]) + i for i, name in enumerate("abc")}
    figure = drawn(vision_plots.marked([image(0)] * 2, points, ["one", "two"]))
    for i, axes in enumerate(figure.axes):
        places = {one.get_label(): one.get_xydata().tolist() for one in axes.lines}
        assert [places[name] for name in points] == [[points[name][i].tolist()] for name in points]


def test_the_arm_is_drawn_with_a_path_and_other_poses(cubes):
    pose = home_rad()
    path = arm.fingertip(pose + np.linspace(0, 0.1, 20)[:, None])
    bare = drawn(simulation_plots.arm_drawing(pose, cubes, ("red", "blue")))
    full = drawn(
        simulation_plots.arm_drawing(
            pose, cubes, ("red", "blue"), path_m=path, sticks_rad=[pose] * 2
        )
    )
    assert len(bare.axes[0].lines) == 0 and len(full.axes[0].lines) == 3
    np.testing.assert_allclose(np.transpose(full.axes[0].lines[0].get_data_3d()), path)


def test_lines_have_their_names():
    curve, dot = (np.arange(3), np.arange(3)), ([1], [2])
    figure = drawn(simulation_plots.lines({"a": curve, "b": curve}, "x", "y", dots={"c": dot}))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a", "b", "c"]


def test_lines_can_have_the_colours_of_what_they_show():
    curve = (np.arange(3), np.arange(3))
    figure = drawn(simulation_plots.lines({"a": curve, "b": curve}, "", "", colours=["red", "b"]))
    assert [line.get_color() for line in figure.axes[0].lines] == ["red", "b"]


def test_joints_are_in_degrees_over_seconds():
    track = np.radians(np.arange(50)[:, None] + np.zeros(5))
    figure = drawn(simulation_plots.joints({"slow": [track, track], "fast": [track]}))
    assert [axes.get_title() for axes in figure.axes] == list(arm.JOINT_NAMES)
    for axes in figure.axes:
        assert len(axes.lines) == 3
        np.testing.assert_allclose(axes.lines[0].get_ydata(), np.arange(50))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["slow", "fast"]


def test_travel_has_a_dot_for_each_sample():
    rows = {"push": {"named": np.arange(9.0), "other": np.zeros(9)}, "pull": {"named": np.ones(4)}}
    (axes,) = drawn(simulation_plots.travel(rows)).axes
    assert [len(one.get_xdata()) for one in axes.lines] == [9, 9, 4]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["push", "pull"]


def test_a_png_is_small_and_the_same_bytes_each_time(cubes, monkeypatch):
    monkeypatch.setitem(plt.rcParams, "figure.constrained_layout.use", True)  # as in a chapter
    figure = simulation_plots.arm_drawing(home_rad(), cubes, ("red", "blue"))
    made = style.png(figure)
    assert made == style.png(figure) and len(made) < 100_000
    assert Image.open(io.BytesIO(made)).format == "PNG"


def test_a_chart_is_the_small_png():
    figure = simulation_plots.lines({"a": ([0, 1], [2, 3])}, "x", "y")
    shown = style.chart(figure)
    assert shown.format == "png" and shown.data == style.png(figure)


def test_a_photo_is_a_jpeg_of_the_figure():
    shown = style.photo(simulation_plots.grid({"a": [image(90)]}))
    assert Image.open(io.BytesIO(shown.data)).format == "JPEG"


def test_components_are_stacked():
    parts = {"colour": np.array([1.0, 2.0]), "rest": np.array([60.0, 37.0])}
    bars, plot = drawn(vision_plots.components(parts, {"left": ([1, 2], [30, 99])}, "%")).axes
    tops = [patch.get_y() + patch.get_height() for patch in bars.patches]
    assert tops == [1, 2, 61, 39]
    assert plot.lines[0].get_ydata().tolist() == [30, 99]


def test_a_chart_is_a_drawing_on_the_site_unless_it_has_pictures(monkeypatch):
    def chart(picture=False):
        with plt.rc_context(style.RC):
            figure, (left, right) = plt.subplots(1, 2)
            left.plot([0, 1])
            if picture:
                right.imshow([[0, 1]])
            return style.chart(figure).data

    assert chart()[:4] == b"\x89PNG"
    monkeypatch.setattr(style, "for_site", lambda: True)
    assert "<svg" in chart() and chart() == chart()
    assert chart(picture=True)[:4] == b"\x89PNG"

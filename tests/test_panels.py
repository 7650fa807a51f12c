"""Panels: the live and the static face show the same, and both can be used without a mouse."""

import base64
import re
import zlib
from html import unescape
from itertools import product

import ipywidgets
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from ptae_lite.errors import PTAEError
from ptae_lite.widgets.panels import Panel

SHARES = [1, 10, 66.6]
SIGNALS = ["describe", "execute"]


def draw(share, signal):
    figure, axes = plt.subplots(figsize=(3, 2))
    axes.plot(np.linspace(0, share, 5), label=signal)
    axes.legend()
    return figure


def describe(share, signal):
    return f'A "rising" line to {share:g} for {signal}.'


def panel(**changes):
    values = {"share": SHARES, "signal": SIGNALS}
    given = {"values": values, "label": "A line", "describe": describe} | changes
    return Panel(draw, **given)


def frames_in(html):
    """The frames of a static page, and which of them is shown."""
    found = re.findall(r"<div data-frame( hidden)?>(.*?)</div>", html)
    return [frame for _, frame in found], [not hidden for hidden, _ in found]


def unpacked(frame):
    """A frame with its drawing as it was before it was laid away."""

    def drawing(found):
        drawn = zlib.decompress(base64.b64decode(found[1]))
        return f'src="data:image/svg+xml;base64,{base64.b64encode(drawn).decode()}"'

    return re.sub('data-packed="(.*?)"', drawing, frame)


def controls_of(view):
    return {one.description: one for one in view.children if one.description}


def frame_of(view):
    """What the widget shows below its controls."""
    return view.children[len(controls_of(view))]


@pytest.fixture
def static(monkeypatch):
    monkeypatch.setenv("PTAE_STATIC", "1")


def test_live_and_static_agree_at_every_position():
    frames, _ = frames_in(panel().html())
    view = panel().widget()
    controls = controls_of(view)
    assert len(frames) == len(SHARES) * len(SIGNALS)
    for frame, (share, signal) in zip(frames, product(SHARES, SIGNALS), strict=True):
        controls["share"].value, controls["signal"].value = share, signal
        assert frame_of(view).value == unpacked(frame)


def test_hidden_drawings_are_packed_and_the_first_is_not():
    made = panel().html()
    frames, shown = frames_in(made)
    assert [("data-packed" in frame) for frame in frames] == [not one for one in shown]
    assert len(made) < 0.6 * len(unpacked(made))


def test_frames_are_scalable_pictures_with_their_own_alternative_text():
    frames, _ = frames_in(panel().html())
    for frame, (share, signal) in zip(frames, product(SHARES, SIGNALS), strict=True):
        assert unescape(re.search('alt="(.*?)"', frame).group(1)) == describe(share, signal)
        picture = re.search('src="data:image/svg\\+xml;base64,(.*?)"', unpacked(frame)).group(1)
        assert b"<svg" in base64.b64decode(picture)
    assert len(set(frames)) == len(frames)


def test_a_figure_with_pictures_is_no_drawing():
    def show(n):
        figure, axes = plt.subplots(figsize=(3, 3))
        axes.imshow(np.random.default_rng(n).random((200, 200, 3)))
        return figure

    frames, _ = frames_in(Panel(show, [1, 2], "Pictures").html())
    assert all('src="data:image/webp;base64,' in frame for frame in frames)
    assert frames == frames_in(Panel(show, [1, 2], "Pictures").html())[0]


def test_positions_that_show_the_same_share_a_frame():
    def show(share, signal):
        return "always" if signal == "execute" else f"{share:g}"

    made = Panel(show, {"share": SHARES, "signal": SIGNALS}, "Shared",
                 start={"share": 10, "signal": "execute"})  # fmt: skip
    frames, shown = frames_in(made.html())
    assert [re.sub("<.*?>", "", frame) for frame in frames] == ["1", "always", "10", "66.6"]
    assert shown == [False, True, False, False]
    assert 'data-order="[0, 1, 2, 1, 3, 1]"' in made.html()


class Scene:
    """Stands for a scene: what a browser loads even where it is hidden."""

    def __init__(self, name):
        self.name = name

    def _repr_html_(self):
        return f"<iframe title={self.name}></iframe>"


def test_scenes_out_of_sight_are_laid_away():
    frames, shown = frames_in(Panel(Scene, {"name": ["one", "two"]}, "Scenes").html())
    assert shown == [True, False]
    assert frames[0] == "<iframe title=one></iframe>"
    assert frames[1] == "<template><iframe title=two></iframe></template>"


def test_the_static_page_is_the_same_bytes_each_time():
    assert panel().html() == panel().html()


def test_moving_a_control_changes_the_picture():
    view = panel().widget()
    before = frame_of(view).value
    controls_of(view)["share"].index = 1
    assert frame_of(view).value != before


def test_the_static_page_can_be_used_with_keyboard_and_screen_reader():
    html = panel(start={"share": 10}).html()
    assert re.match('<div data-ptae-embed="panel" role="group" aria-label="A line" oninput=', html)
    assert re.search(
        '<label>share <input type="range" min="0" max="2" step="1" value="1" aria-valuetext="10"',
        html,
    )
    assert re.search("<label>signal <select", html)
    assert '<option value="0" selected>describe</option>' in html
    assert "<output>10</output>" in html
    assert "<script" not in html and "://" not in re.sub('base64,[^"]*', "", html)
    assert frames_in(html)[1] == [False, False, True, False, False, False]


def test_with_a_kernel_there_is_a_widget_and_a_picture(monkeypatch):
    monkeypatch.delenv("PTAE_STATIC", raising=False)
    drawn = []
    made = Panel(lambda share: drawn.append(share) or draw(share, "x"), SHARES, "share (%)")
    bundle = made._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle and "text/html" not in bundle
    assert base64.b64decode(bundle["image/png"]).startswith(b"\x89PNG")
    assert bundle["text/plain"] == "Panel('share (%)', share=1)"
    assert drawn == [1]  # the other frames wait until they are asked for


def test_without_a_kernel_there_is_html_alone(static):
    bundle = panel()._repr_mimebundle_()
    assert set(bundle) == {"text/html", "text/plain"}
    assert len(frames_in(bundle["text/html"])[0]) == 6


def test_numbers_make_a_slider_and_words_a_choice():
    controls = controls_of(panel().widget())
    assert isinstance(controls["share"], ipywidgets.SelectionSlider)
    assert isinstance(controls["signal"], ipywidgets.Dropdown)


def test_one_control_takes_its_values_and_label_directly():
    made = Panel(lambda count: f"{count} < 10", range(3), "how many", start=2)
    assert made.frame(count=1) == "1 < 10"
    assert made.face(count=1) == "<pre>1 &lt; 10</pre>"
    assert made.description(count=1) == "how many = 1"
    assert list(controls_of(made.widget())) == ["how many"]
    assert frames_in(made.html())[1] == [False, False, True]
    assert "image/png" not in made._repr_mimebundle_()


def test_without_a_description_the_values_stand_for_the_picture():
    expected = "A line: share = 66.6, signal = execute"
    assert panel(describe=None).description(share=66.6, signal="execute") == expected


def test_objects_that_are_html_stay_html():
    class Table:
        def _repr_html_(self):
            return "<table></table>"

    assert Panel(lambda row: Table(), [1], "row").face(row=1) == "<table></table>"


def test_frames_are_figures_that_no_notebook_shows_twice():
    assert isinstance(panel().frame(share=10, signal="execute"), Figure)
    assert not plt.get_fignums()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"share": 2, "signal": "execute"}, "share = 2 is not in this panel; it has 1, 10, 66.6"),
        ({"share": 1, "signal": "sing"}, "signal = sing .* it has describe, execute"),
        ({"share": 1}, "takes share, signal"),
    ],
)
def test_other_values_are_refused_with_those_there_are(values, message):
    with pytest.raises(PTAEError, match=message):
        panel().frame(**values)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": {"share": 7}}, "share = 7 is not in this panel"),
        ({"start": {"shore": 1}}, "takes share, signal"),
        ({"values": {"share": [], "signal": SIGNALS}}, "at least one value"),
        ({"values": {"share": [1, 1], "signal": SIGNALS}}, "each only once"),
    ],
)
def test_a_panel_that_makes_no_sense_is_refused(changes, message):
    with pytest.raises(PTAEError, match=message):
        panel(**changes)


def test_a_function_that_returns_nothing_to_show_is_refused():
    with pytest.raises(PTAEError, match="returned NoneType"):
        Panel(lambda share: None, SHARES, "share")


def inverse(share):
    return f"{1 / (share - 10)}"


def test_an_error_at_the_start_fails_the_cell():
    with pytest.raises(ZeroDivisionError):
        Panel(inverse, SHARES, "share", start=10)


def test_an_error_later_is_shown_and_raised_and_goes_away():
    view = Panel(inverse, SHARES, "share").widget()
    slider, shown, *_ = view.children
    with pytest.raises(ZeroDivisionError):
        slider.value = 10
    assert 'role="alert"' in shown.value and "ZeroDivisionError" in shown.value
    slider.value = 66.6
    assert "ZeroDivisionError" not in shown.value


def test_an_error_at_any_position_fails_the_static_build(static):
    with pytest.raises(ZeroDivisionError):
        Panel(inverse, SHARES, "share")

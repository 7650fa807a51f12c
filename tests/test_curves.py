"""Figures of results: each draws its numbers, at every position of its slider."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from ptae_lite import published
from ptae_lite.display import curves
from ptae_lite.evaluation import target_poses
from ptae_lite.robot.arm import JOINT_NAMES
from ptae_lite.signals import Source
from ptae_lite.studies import incongruence
from ptae_lite.studies.incongruence import ANSWERS_WORDS, EXTRA_INPUT, conflict_sets

SHARES = (2, 10, 66.6, 100)
CHANCE = 2.78


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture
def shares():
    return pd.DataFrame({
        "share": SHARES, "describe_accuracy": [20.0, 60.0, 95.0, 99.0],
        "execute_nrmse": [9.0, 5.0, 3.0, 2.0],
    }).sample(frac=1, random_state=0)  # fmt: skip


@pytest.fixture
def said():
    return pd.DataFrame({
        "truth": ["push red slowly", "pull blue fast"], "said": ["push red slowly", ""],
        "right": [True, False],
    })  # fmt: skip


@pytest.fixture
def conflicts():
    """A table as `incongruence.run` makes it: 100 - 10 x conflicts for words, conflicts else."""
    rows = []
    for signal, place in EXTRA_INPUT.items():
        words = signal in ANSWERS_WORDS
        for count in range(4):
            for aspects in conflict_sets(signal, count):
                wheres = [place] if count else ["none", "congruent"]
                for where in wheres:
                    value = 100.0 - 10 * count if words else float(count)
                    rows.append({
                        "signal": signal, "conflict_in": where, "conflicts": count,
                        "aspects": " ".join(aspects), "accuracy": value if words else np.nan,
                        "nrmse": np.nan if words else value,
                    })  # fmt: skip
    return pd.DataFrame(rows)


def line(axes, label):
    (found,) = [one for one in axes.lines if one.get_label() == label]
    return found.get_xdata(), found.get_ydata()


def marks(figure):
    """Where a figure has its square mark: (title or column, x, y)."""
    return [
        (axes.get_title() or axes.get_ylabel(), *map(float, np.ravel(one.get_xydata())))
        for axes in figure.axes
        for one in axes.lines
        if one.get_marker() == "s"
    ]


def drawn(figure):
    """The figure, when it can be drawn and no notebook would show it a second time."""
    assert isinstance(figure, Figure) and plt.get_fignums() == []
    figure.canvas.draw()
    return figure


def test_trajectories_are_in_degrees_over_the_recorded_ones():
    truth = np.radians(np.arange(50)[:, None] + 10 * np.arange(5))
    made = {"one": np.zeros((99, 5)), "two": np.radians(np.full((99, 5), 7.0))}
    figure = drawn(curves.trajectories(truth, made, "title"))
    assert [axes.get_title() for axes in figure.axes] == list(JOINT_NAMES)
    for j, axes in enumerate(figure.axes):
        np.testing.assert_allclose(line(axes, "recorded")[1], np.arange(50) + 10 * j)
        np.testing.assert_allclose(line(axes, "two")[1], [7] * 50)  # cut to the clip
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["recorded", "one", "two"]


def test_an_attention_map_has_a_picture_for_each_head():
    weights = np.random.default_rng(0).random((4, 6, 100))
    figure = drawn(curves.attention_map(weights, ["describe", "<eos>"], 50))
    pictures = [axes.images[0] for axes in figure.axes if axes.images]
    assert len(pictures) == 4
    for head, picture in enumerate(pictures):
        np.testing.assert_array_equal(picture.get_array(), weights[head, :2])
        assert picture.get_clim() == (0, weights.max())


def test_a_learning_curve_has_a_point_for_each_epoch():
    history = np.array([[3.0, 0.1], [2.0, 0.05], [1.0, 0.01]])
    figure = drawn(curves.learning_curve(history))
    for axes, column in zip(figure.axes, history.T, strict=True):
        assert axes.get_yscale() == "log"
        assert axes.lines[0].get_xdata().tolist() == [1, 2, 3]
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), column)


def test_results_by_share_stand_beside_what_the_paper_states(shares):
    figure = drawn(curves.by_share(shares, published.DESCRIBE_BY_SAMPLES, CHANCE))
    accuracy, error = figure.axes
    x, y = line(accuracy, "ours, one seed")
    assert x.tolist() == list(SHARES) and y.tolist() == [20, 60, 95, 99]
    assert line(error, "ours, one seed")[1].tolist() == [9, 5, 3, 2]
    x, y = line(accuracy, "stated in the paper's text")
    assert dict(zip(x, y, strict=True)) == {1: 33, 10: 81, 20: 100, 50: 100, 100: 100}
    assert line(accuracy, "chance")[1] == [CHANCE] * 2
    assert not marks(figure)


@pytest.mark.parametrize("share", SHARES)
def test_every_share_of_the_slider_is_marked_with_its_sentences(shares, said, share):
    paper = published.DESCRIBE_BY_SAMPLES
    figure = drawn(curves.share_card(shares, said, paper, CHANCE, share))
    row = shares[shares["share"] == share].iloc[0]
    assert marks(figure) == [
        ("describe accuracy, %", share, row["describe_accuracy"]),
        ("execute NRMSE, %", share, row["execute_nrmse"]),
    ]
    texts = [text.get_text() for text in figure.axes[2].texts]
    assert texts[:2] == ["the clip shows", "the model says"]
    assert texts[2:] == ["push red slowly", "right   push red slowly", "pull blue fast", "WRONG   "]


def test_results_by_conflicts_have_each_choice_their_mean_and_the_control(conflicts):
    figure = drawn(curves.by_conflicts(conflicts, published.THREE_CONFLICTS))
    titles = {axes.get_title().split(" (")[0]: axes for axes in figure.axes}
    assert set(titles) == set(EXTRA_INPUT)
    for signal, axes in titles.items():
        assert f"(conflict in {EXTRA_INPUT[signal]})" in axes.get_title()
        words = signal in ANSWERS_WORDS
        assert axes.get_ylabel() == ("accuracy, %" if words else "NRMSE, %")
        x, y = line(axes, "mean of choices")
        wanted = [100, 90, 80, 70] if words else [0, 1, 2, 3]
        assert x.tolist() == [0, 1, 2, 3] and y.tolist() == wanted
        assert len(line(axes, "one choice")[0]) == 8
        assert line(axes, "congruent extra input")[1].tolist() == wanted[:1]
        (value,) = line(axes, "paper's text, 3 conflicts")[1]
        assert value == published.THREE_CONFLICTS[signal].value


def test_without_the_control_there_is_none(conflicts):
    table = conflicts[conflicts["conflict_in"] != "congruent"]
    figure = drawn(curves.by_conflicts(table, published.THREE_CONFLICTS))
    labels = {one.get_label() for axes in figure.axes for one in axes.lines}
    assert "congruent extra input" not in labels and "mean of choices" in labels


@pytest.mark.parametrize("count", range(4))
@pytest.mark.parametrize("signal", EXTRA_INPUT)
def test_every_position_of_the_conflict_sliders_can_be_shown(trained, samples, signal, count):
    """A card for words, trajectories for actions, of one sample under so many conflicts."""
    source, fast = Source(trained.dataset(samples)), 863
    told = incongruence.story(trained, source, fast, signal, conflict_sets(signal, count)[0])
    if signal in ANSWERS_WORDS:
        figure = curves.answer_card(told["sample"], told["asked"], told["answer"], told["right"])
        shown = figure.axes[0].texts[2].get_text()
        assert shown.endswith(told["answer"] or "(nothing)")
    else:
        truth = target_poses(samples, np.array([fast]), signal)[0, :49]
        figure = curves.trajectories(truth, {"answer": told["joints"]}, told["sample"])
        made = [line(axes, "answer")[1] for axes in figure.axes]
        np.testing.assert_allclose(np.transpose(made), np.degrees(told["joints"][:49]))
    drawn(figure)


@pytest.mark.parametrize(
    ("answer", "right", "shown"),
    [("push red fast", True, ["push red fast", "right"]), ("", False, ["(nothing)", "wrong"])],
)
def test_an_answer_card_says_what_was_said_and_whether_it_is_right(answer, right, shown):
    figure = drawn(curves.answer_card("heading", "push red fast", answer, right))
    heading, asked, said, verdict = (text.get_text() for text in figure.axes[0].texts)
    assert heading == "heading" and asked.endswith("push red fast")
    assert said.endswith(shown[0]) and verdict == shown[1]

"""Figures of incongruence: every mean, every spread and every stack is the table's."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.experiments.answer_source import SOURCES
from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT, PLACES, conditions
from ptae_lite.experiments.incongruence_table import damage
from ptae_lite.paper import reported
from ptae_lite.plots import conflict as conflict_plots
from ptae_lite.plots import incongruence as incongruence_plots

SPREAD = (-1.0, 0.0, 2.0)  # of the three seeds about their value


def value(signal, place, count):
    offset = {"congruent": 5, "congruent_other": 6, "vision": 3, "proprioception": 2}.get(place, 0)
    return (90 if signal in ANSWERS_WORDS else 10) - 2 * count - offset


LABELS = {label: model for model, (label, *_) in incongruence_plots.MODELS.items()}


@pytest.fixture
def table():
    rows = []
    for k, model in enumerate(LABELS.values()):
        for seed, spread in enumerate(SPREAD):
            for condition in (c for signal in EXTRA_INPUT for c in conditions(signal)):
                signal, place, aspects = condition
                score = value(signal, place, len(aspects)) + spread + 0.5 * k
                words = signal in ANSWERS_WORDS
                shares = (80 - 10 * len(aspects), 10, 10 * len(aspects), 10)
                rows.append({
                    "model": model, "seed": seed, "signal": signal, "conflict_in": place,
                    "conflicts": len(aspects), "aspects": " ".join(aspects),
                    "accuracy": score if words else np.nan, "nrmse": np.nan if words else score,
                } | dict(zip(SOURCES, shares, strict=True)))  # fmt: skip
    return pd.DataFrame(rows)


def bars(axes):
    """Each line with error bars by its label: places, means, lowest and highest."""
    found = {}
    for container in axes.containers:
        line, _, (segments,) = container.lines
        ends = np.array([segment[:, 1] for segment in segments.get_segments()])
        x, mean = (np.asarray(part, dtype=float) for part in line.get_data())
        found[container.get_label()] = (x, mean, ends.min(1), ends.max(1))
    return found


def test_four_charts_words_above_and_motions_below(table):
    figure = incongruence_plots.by_conflicts(table[table["model"] == "ptae_adam"])
    titles = [axes.get_title().split("\n")[0] for axes in figure.axes]
    assert titles == ["describe", "repeat language", "repeat action", "execute"]
    for axes, signal in zip(figure.axes, titles, strict=True):
        words = signal in ANSWERS_WORDS
        assert axes.get_ylabel() == ("accuracy, %" if words else "NRMSE, %")
        found = bars(axes)
        places = {"conflict": EXTRA_INPUT[signal]}
        places |= {f"in {p} only": p for p in PLACES[EXTRA_INPUT[signal]][1:]}
        for label, place in places.items():
            x, mean, low, high = found.pop(label)
            counts = [0, 1, 2, 3] if place == EXTRA_INPUT[signal] else [1, 2, 3]
            assert np.round(x).astype(int).tolist() == counts
            wanted = np.array([value(signal, place, n) for n in counts])
            np.testing.assert_allclose(mean, wanted + np.mean(SPREAD))
            np.testing.assert_allclose([low, high], [wanted - 1, wanted + 2])
        for label, place in (("congruent", "congruent"), ("congruent, another", "congruent_other")):
            np.testing.assert_allclose(
                found.pop(label)[1], value(signal, place, 0) + np.mean(SPREAD)
            )
        assert not found
        (paper,) = [line for line in axes.lines if line.get_label() == "paper's text"]
        wanted = {count: claim.value for count, claim in reported.CONFLICTS[signal].items()}
        assert dict(zip(*paper.get_data(), strict=True)) == wanted


def test_models_are_compared_in_every_signal(table):
    figure = incongruence_plots.compared(table)
    for axes in figure.axes:
        signal = axes.get_title().split("\n")[0]
        found = bars(axes)
        assert list(found) == list(LABELS)
        for k, (x, mean, _, _) in enumerate(found.values()):
            assert np.round(x).astype(int).tolist() == [0, 1, 2, 3, 4]
            places = [("none", 0), ("congruent", 0), *((EXTRA_INPUT[signal], n) for n in (1, 2, 3))]
            wanted = np.array([value(signal, *place) for place in places])
            np.testing.assert_allclose(mean, wanted + np.mean(SPREAD) + 0.5 * k)
    only = incongruence_plots.compared(table[table["model"] != "ptae_two_way"])
    assert list(bars(only.axes[0])) == [
        "trained with Adam alone", "chapter 03's", "trained with extra input",
    ]  # fmt: skip


def test_a_stack_for_each_condition_adds_up(table):
    figure = incongruence_plots.followed(table[table["model"] == "ptae_adam"])
    for axes, signal in zip(figure.axes, incongruence_plots.SHOWN, strict=True):
        assert axes.get_title() == signal
        names = [label.get_text() for label in axes.get_yticklabels()]
        count = {"language": 6, "action": 12}[EXTRA_INPUT[signal]] + (signal == "execute")
        assert len(names) == len(set(names)) == count
        assert [c.get_label() for c in axes.containers] == list(SOURCES)
        widths = np.array([[bar.get_width() for bar in stack] for stack in axes.containers])
        np.testing.assert_allclose(widths.sum(axis=0), 110 - 10 + 0 * widths[0])
        assert len({stack[0].get_hatch() for stack in axes.containers}) == 4
        three = [i for i, name in enumerate(names) if name.startswith("3")]
        np.testing.assert_allclose(widths[:, three].T, [[50, 10, 30, 10]] * len(three))


def test_parts_of_a_clip_can_be_left_out(table):
    own = table[table["model"] == "ptae_adam"]
    for axes in incongruence_plots.by_conflicts(own, parts=False).axes:
        assert set(bars(axes)) == {"conflict", "congruent", "congruent, another"}
    rows = [len(axes.get_yticks()) for axes in incongruence_plots.followed(own, False).axes]
    assert rows == [6, 6, 6, 7]


def test_attention_has_a_column_a_signal_and_a_line_an_input():
    shares = np.arange(12).reshape(4, 3) / 12
    looks = {
        "describe": {"regular": shares, "conflict": shares / 2},
        "execute": {"regular": shares},
    }
    shots = np.zeros((6, 6, 8, 3), np.uint8)
    grid = np.reshape(conflict_plots.attention(looks, shots).axes, (5, 2))
    assert [axes.get_title() for axes in grid[0]] == list(looks)
    assert all(len(axes.images) == 1 for axes in grid[0])
    for head, axes in enumerate(grid[1:, 0]):
        lines = {line.get_label(): line.get_ydata() for line in axes.lines}
        np.testing.assert_allclose(lines["regular"], 100 * shares[head])
        np.testing.assert_allclose(lines["conflict"], 50 * shares[head])


def drawn(axes):
    """The lines of a panel that have more than one point."""
    return [line for line in axes.lines if len(line.get_xdata()) == len(SPREAD)]


def test_a_cost_is_drawn_for_each_seed(table):
    paid = damage(table)
    for axes, signals in zip(conflict_plots.price(paid).axes, (("describe", "repeat language"),
                                                               ("repeat action", "execute")),
                             strict=True):  # fmt: skip
        assert [label.get_text() for label in axes.get_yticklabels()] == list(signals)
        wanted = [paid[(paid["signal"] == s) & (paid["model"] == m)][what].tolist()
                  for s in signals for m in LABELS.values()
                  for what in ("format", "conflict")]  # fmt: skip
        found = [line.get_xdata().tolist() for line in drawn(axes)]
        np.testing.assert_allclose(found, wanted)


def test_the_same_falsehood_by_a_sentence_and_by_a_clip(table):
    def seeds(model, signal, aspects):
        rows = table[(table["model"] == model) & (table["aspects"] == aspects)]
        rows = rows[(rows["signal"] == signal) & (rows["conflict_in"] == EXTRA_INPUT[signal])]
        return rows["accuracy"].fillna(rows["nrmse"]).tolist()

    asked = [
        (("describe", word), ("repeat language", clip))
        for word, clip in (
            ("action", "action"),
            ("colour", "position"),
            ("action colour", "action position"),
        )
    ]
    asked.append((("repeat action", "action"), ("execute", "action")))
    for axes, pair in zip(conflict_plots.turned(table).axes, asked, strict=True):
        found = [line.get_ydata() for line in drawn(axes)]
        wanted = [seeds(model, *one) for model in LABELS.values() for one in pair]
        np.testing.assert_allclose(found, wanted)
        lines = [line for line in axes.lines if len(line.get_xdata()) == 2]
        ends = np.reshape(np.mean(wanted, axis=1), (-1, 2))
        np.testing.assert_allclose([line.get_ydata() for line in lines], ends)


def test_one_conflict_at_a_time_is_written_into_its_cell(table):
    own = table[table["model"] == "ptae_adam"]
    words, motion = conflict_plots.single(own).axes
    assert [len(axes.get_yticks()) for axes in (words, motion)] == [4, 4]
    shown = np.reshape([text.get_text() for text in words.texts], (4, 4))
    first = value("describe", "congruent", 0) + np.mean(SPREAD)
    one = value("describe", "language", 1) + np.mean(SPREAD)
    assert shown[0].tolist() == [f"{first:.0f}", *[f"{one:.0f}"] * 3]
    joints = value("repeat language", "proprioception", 1) + np.mean(SPREAD)
    assert shown[3, 1] == f"{joints:.0f}"

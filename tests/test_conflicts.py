"""Figures of incongruence: every mean, every spread and every stack is the table's."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.experiments.answer_source import SOURCES
from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT, PLACES, conditions
from ptae_lite.paper import reported
from ptae_lite.plots import incongruence as incongruence_plots

SPREAD = (-1.0, 0.0, 2.0)  # of the three seeds about their value


def value(signal, place, count):
    offset = {"congruent": 5, "congruent_other": 6, "vision": 3, "proprioception": 2}.get(place, 0)
    return (90 if signal in ANSWERS_WORDS else 10) - 2 * count - offset


@pytest.fixture
def table():
    rows = []
    for k, model in enumerate(incongruence_plots.MODELS):
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
    figure = incongruence_plots.by_conflicts(table[table["model"] == "ptae"])
    titles = [axes.get_title().split(" (")[0] for axes in figure.axes]
    assert titles == ["describe", "repeat language", "repeat action", "execute"]
    for axes, signal in zip(figure.axes, titles, strict=True):
        words = signal in ANSWERS_WORDS
        assert axes.get_ylabel() == ("accuracy, %" if words else "NRMSE, %")
        found = bars(axes)
        places = {"conflict in all of the extra input": EXTRA_INPUT[signal]}
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
        signal = axes.get_title().split(" (")[0]
        found = bars(axes)
        assert list(found) == [label for label, *_ in incongruence_plots.MODELS.values()]
        for k, (x, mean, _, _) in enumerate(found.values()):
            assert np.round(x).astype(int).tolist() == [0, 1, 2, 3, 4]
            places = [("none", 0), ("congruent", 0), *((EXTRA_INPUT[signal], n) for n in (1, 2, 3))]
            wanted = np.array([value(signal, *place) for place in places])
            np.testing.assert_allclose(mean, wanted + np.mean(SPREAD) + 0.5 * k)
    only = incongruence_plots.compared(table[table["model"] != "ptae_two_way"])
    assert list(bars(only.axes[0])) == ["regular", "trained with extra input"]


def test_a_stack_for_each_condition_adds_up(table):
    figure = incongruence_plots.followed(table[table["model"] == "ptae"])
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


def test_attention_has_a_row_a_signal_and_a_line_an_input():
    shares = np.arange(12).reshape(4, 3) / 12
    figure = incongruence_plots.attention(
        {"describe": {"regular": shares, "conflict": shares / 2}, "execute": {"regular": shares}}
    )
    assert len(figure.axes) == 8
    for head, axes in enumerate(figure.axes[:4]):
        lines = {line.get_label(): line.get_ydata() for line in axes.lines}
        np.testing.assert_allclose(lines["regular"], 100 * shares[head])
        np.testing.assert_allclose(lines["conflict"], 50 * shares[head])

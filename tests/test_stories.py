"""Answers under conflict: told as the model gave them, stored, and shown at every position."""

from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from test_panels import controls_of, frames_in

from ptae_lite import artefacts, dataset, published
from ptae_lite.display import conflicts
from ptae_lite.evaluation import respond
from ptae_lite.models import checkpoint
from ptae_lite.signals import Source
from ptae_lite.studies import incongruence, stories
from ptae_lite.studies.incongruence import ANSWERS_WORDS, EXTRA_INPUT, conflict_sets

POSITIONS = list(product(EXTRA_INPUT, range(4)))


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def recorded():
    return dataset.load("recording")


@pytest.fixture(scope="module")
def stored(recorded):
    return stories.load(recorded)


@pytest.fixture(scope="module")
def model():
    return checkpoint.load(artefacts.stored(stories.MODEL))


@pytest.fixture
def made_up():
    """A table as `incongruence.run` makes it: 100 - 10 x conflicts for words, conflicts else."""
    rows = []
    for signal, place in EXTRA_INPUT.items():
        words = signal in ANSWERS_WORDS
        for count in range(4):
            for aspects, where in product(
                conflict_sets(signal, count), [place] if count else ["none", "congruent"]
            ):
                value = 100.0 - 10 * count if words else float(count)
                rows.append({
                    "signal": signal, "conflict_in": where, "conflicts": count,
                    "aspects": " ".join(aspects), "accuracy": value if words else np.nan,
                    "nrmse": np.nan if words else value,
                })  # fmt: skip
    return pd.DataFrame(rows)


def line(axes, label):
    (found,) = [one for one in axes.lines if one.get_label() == label]
    return np.array(found.get_xdata()), np.array(found.get_ydata())


# ---------------------------------------------------------------- telling and storing


def test_a_clip_is_told_under_every_choice_of_conflicts(trained, samples):
    told = stories.tell(trained, samples, 7)
    assert len(told.told) == 4 * 9 and len(told.joints) == 2 * 9
    for signal in EXTRA_INPUT:
        for count, rows in told.told[told.told["signal"] == signal].groupby("conflicts"):
            aspects = [tuple(text.split()) for text in rows["aspects"]]
            assert aspects == [*conflict_sets(signal, count), *([()] if count == 0 else [])]
            assert (rows["track"] >= 0).all() == (signal not in ANSWERS_WORDS)
    again = incongruence.story(trained, Source(trained.dataset(samples)), 7, "execute", ("speed",))
    row = told.told[(told.told["signal"] == "execute") & (told.told["aspects"] == "speed")].iloc[0]
    np.testing.assert_allclose(told.joints[row["track"]], again["joints"], atol=1e-6)
    assert row["extra"] == again["extra"]


def test_what_is_written_is_read_back(trained, samples, tmp_path):
    paths = stories.write(tmp_path / "new", trained, samples)
    assert [path.name for path in paths] == [stories.TABLE, stories.TOLD, stories.JOINTS]
    table, told = stories.load(samples, lambda name: tmp_path / "new" / name)
    first = stories.tell(trained, samples, int(samples.split("test")[0]))
    pd.testing.assert_frame_equal(told.told, first.told, check_dtype=False)
    np.testing.assert_array_equal(told.joints, first.joints)
    np.testing.assert_array_equal(told.truth, first.truth)
    expected = incongruence.run(trained, samples).round(3)
    pd.testing.assert_frame_equal(table, expected, check_dtype=False)
    before = [path.read_bytes() for path in paths]
    stories.write(tmp_path / "new", trained, samples)
    assert [path.read_bytes() for path in paths] == before


def test_the_command_stores_with_provenance(trained, samples, monkeypatch, tmp_path, capsys):
    noted = {}
    monkeypatch.setattr(artefacts, "stored", lambda name: name)
    monkeypatch.setattr(checkpoint, "load", lambda path: trained)
    monkeypatch.setattr(dataset, "load", lambda name: samples)
    monkeypatch.setattr(artefacts, "DATA", tmp_path)
    monkeypatch.setattr(incongruence, "run", lambda *given: pd.DataFrame({"accuracy": [1.0]}))
    monkeypatch.setattr(artefacts, "register", lambda name, **about: noted.update({name: about}))
    assert stories.main(["--out", str(tmp_path / "look")]) == 0
    assert not noted and (tmp_path / "look" / stories.TOLD).exists()
    assert stories.main(["--store"]) == 0
    assert set(noted) == {f"results/{n}" for n in (stories.TABLE, stories.TOLD, stories.JOINTS)}
    assert all("studies.stories --store" in about["command"] for about in noted.values())
    assert capsys.readouterr().out.count("wrote") == 6


# ---------------------------------------------------------------- figures


def test_results_by_conflicts_have_each_choice_their_mean_and_the_control(made_up):
    figure = conflicts.by_conflicts(made_up)
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


def test_without_the_control_there_is_none(made_up):
    figure = conflicts.by_conflicts(made_up[made_up["conflict_in"] != "congruent"])
    labels = {one.get_label() for axes in figure.axes for one in axes.lines}
    assert "congruent extra input" not in labels and "mean of choices" in labels


# ---------------------------------------------------------------- the stored panel


@pytest.fixture(scope="module")
def panel(stored):
    return conflicts.panel(*stored)


def test_live_equals_stored_at_every_position(panel):
    frames, _ = frames_in(panel.html())
    view = panel.widget()
    controls = controls_of(view)
    assert len(set(frames)) == len(frames) == len(POSITIONS)
    for frame, (signal, count) in zip(frames, POSITIONS, strict=True):
        controls["signal"].value, controls["conflicts"].value = signal, count
        assert view.children[-1].value == frame


@pytest.mark.parametrize(("signal", "count"), POSITIONS)
def test_every_position_shows_and_says_what_is_stored(panel, stored, signal, count):
    table, told = stored
    score = conflicts.score_name(signal)
    rows = table[(table["signal"] == signal) & (table["conflicts"] == count)]
    mean = rows.loc[rows["conflict_in"] != "congruent", score].mean()
    figure, text = (
        panel.frame(signal=signal, conflicts=count),
        panel.description(signal=signal, conflicts=count),
    )
    x, y = line(figure.axes[0], "here")
    assert (x[0], y[0]) == (count, pytest.approx(mean)) and f"is {mean:.1f} %" in text
    drawn = " ".join(one.get_text() for one in figure.axes[1].texts)
    answers = told.of(signal, count)
    assert len(answers) == (2, 3, 3, 1)[count]
    for row in answers.itertuples():
        assert row.extra in drawn and row.extra in text
        if signal in ANSWERS_WORDS:
            assert f"{'right' if row.right else 'WRONG'}: {row.answer}" in drawn
            assert f"{row.answer}, {'right' if row.right else 'wrong'}" in text
    if signal not in ANSWERS_WORDS:
        joints = figure.axes[2:]
        np.testing.assert_allclose(
            np.transpose([line(axes, "recorded")[1] for axes in joints]), np.degrees(told.truth)
        )
        for number, track in enumerate(answers["track"], start=1):
            made = np.transpose([axes.lines[number].get_ydata() for axes in joints])
            np.testing.assert_allclose(made, np.degrees(told.joints[track][: len(told.truth)]))


@pytest.mark.parametrize(
    ("signal", "aspects"),
    [("describe", None), ("repeat language", ("speed",)), ("execute", ("action", "position")),
     ("repeat action", ())],
)  # fmt: skip
def test_the_stored_weights_still_give_the_stored_values(stored, recorded, model, signal, aspects):
    table, told = stored
    source, test = Source(model.dataset(recorded)), recorded.split("test")
    if aspects is None:
        answer = respond(model, source, test, signal)
    else:
        answer = incongruence.respond_with_extra(model, source, test, signal, aspects)
    where = "none" if aspects is None else EXTRA_INPUT[signal] if aspects else "congruent"

    def the_row(of):
        of = of[(of["signal"] == signal) & (of["conflict_in"] == where)]
        return of[of["aspects"] == " ".join(aspects or ())].iloc[0]

    again = incongruence.score(model, source, test, signal, answer)
    name = conflicts.score_name(signal)
    assert the_row(table)[name] == pytest.approx(
        again[name], abs=0.5 if name == "accuracy" else 0.02
    )
    row = the_row(told.told)
    story = incongruence.story(model, source, int(row["sample"]), signal, aspects)
    assert story["extra"] == row["extra"]
    if signal in ANSWERS_WORDS:
        assert (story["answer"], story["right"]) == (row["answer"], row["right"])
    else:
        np.testing.assert_allclose(told.joints[row["track"]], story["joints"], atol=0.02)

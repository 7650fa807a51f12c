"""Answers under conflict: told as the model gave them, stored, and shown at every position."""

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest
from test_panels import controls_of

from ptae_lite import artefacts
from ptae_lite.data.samples import load_samples
from ptae_lite.data.signals import Source
from ptae_lite.experiments import conflict_examples, incongruence_table
from ptae_lite.experiments.answer_source import SOURCES
from ptae_lite.experiments.incongruence import (
    ANSWERS_WORDS,
    EXTRA_INPUT,
    Condition,
    conditions,
    extra_inputs,
    respond_under,
)  # fmt: skip
from ptae_lite.language import pattern
from ptae_lite.models import checkpoint
from ptae_lite.widgets import conflict_cards

POSITIONS = list(
    product(conflict_cards.SIGNALS, conflict_cards.PLACES, range(4), conflict_cards.FIRST)
)
NOISY_VIDEOS = np.zeros((12, 6, 60, 80, 3), np.uint8)


@pytest.fixture(scope="module")
def recorded():
    return load_samples("recording")


@pytest.fixture(scope="module")
def stored():
    return conflict_examples.load()


@pytest.fixture(scope="module")
def table():
    found = incongruence_table.read(artefacts.stored("results/incongruence.csv"))
    return found[found["model"] == "ptae_adam"]


@pytest.fixture(scope="module")
def model():
    return checkpoint.load(artefacts.stored(conflict_examples.MODEL))


# ---------------------------------------------------------------- telling and storing


@pytest.fixture(scope="module")
def answers(trained, samples):
    return conflict_examples.tell(trained, samples, int(samples.split("test")[1]), NOISY_VIDEOS)


@pytest.mark.slow
def test_a_clip_is_told_under_every_condition(trained, samples, answers):
    assert len(answers.answers) == 69 and len(answers.joints) == 35
    indices = samples.split("test")
    for signal in EXTRA_INPUT:
        for condition in conditions(signal):
            row = answers.of(condition)
            assert (row.track >= 0) == (signal not in ANSWERS_WORDS)
            drawn = extra_inputs(samples, indices, condition)[1]  # as in the table
            assert (row.sentence or row.clip) == drawn and row.source in SOURCES
    condition = Condition("execute", "vision", ("speed",))
    answer = respond_under(trained, Source(trained.dataset(samples)), indices[:2], condition)
    again = trained.scaling.joints_back(answer.joints[1].numpy())
    np.testing.assert_allclose(answers.joints[answers.of(condition).track], again, atol=1e-4)


@pytest.mark.slow
def test_what_is_written_is_read_back(trained, samples, tmp_path):
    paths = conflict_examples.write(tmp_path / "new", trained, samples, NOISY_VIDEOS)
    assert [path.name for path in paths] == [conflict_examples.ANSWERS, conflict_examples.KEPT]
    again = conflict_examples.load(lambda name: tmp_path / "new" / name)
    first = conflict_examples.tell(trained, samples, int(samples.split("test")[0]), NOISY_VIDEOS)
    assert again.index == first.index
    pd.testing.assert_frame_equal(again.answers, first.answers, check_dtype=False)
    np.testing.assert_array_equal(again.joints, first.joints)
    np.testing.assert_array_equal(again.strips, NOISY_VIDEOS)


@pytest.mark.slow
def test_the_command_stores_with_provenance(trained, samples, monkeypatch, tmp_path, capsys):
    noted = {}
    monkeypatch.setattr(artefacts, "stored", lambda name: name)
    monkeypatch.setattr(checkpoint, "load", lambda path: trained)
    monkeypatch.setattr(conflict_examples, "load_samples", lambda name: samples)
    monkeypatch.setattr(conflict_examples, "picture_strips", lambda *given: NOISY_VIDEOS)
    monkeypatch.setenv("PTAE_DATA", str(tmp_path))
    monkeypatch.setattr(artefacts, "register", lambda name, **about: noted.update({name: about}))
    assert conflict_examples.main(["--out", str(tmp_path / "look")]) == 0
    assert not noted and (tmp_path / "look" / conflict_examples.ANSWERS).exists()
    assert conflict_examples.main(["--store"]) == 0
    assert set(noted) == {
        f"results/{name}" for name in (conflict_examples.ANSWERS, conflict_examples.KEPT)
    }
    assert all(
        "experiments.conflict_examples --store" in about["command"] for about in noted.values()
    )
    assert capsys.readouterr().out.count("wrote") == 4


def test_without_a_recording_one_sentence_says_what_is_missing(tmp_path, capsys):
    arguments = ["--recording", str(tmp_path / "none"), "--out", str(tmp_path / "new")]
    assert conflict_examples.main(arguments) == 1
    said = capsys.readouterr().err
    assert said.startswith("stories: ") and "none" in said and said.count("\n") == 1
    assert not (tmp_path / "new").exists()


# ---------------------------------------------------------------- what is stored


@pytest.mark.parametrize(
    "condition",
    [Condition("describe"), Condition("describe", "language", ("action",)),
     Condition("repeat language", "action", ("speed",)), Condition("repeat action", "congruent"),
     Condition("execute", "action", ("action", "position")),
     Condition("execute", "proprioception", ("speed",))],
    ids=str,
)  # fmt: skip
def test_the_stored_weights_still_give_the_stored_values(stored, table, recorded, model, condition):
    again = incongruence_table.rows_of(model, recorded, 0, wanted=[condition]).iloc[0]
    own = table[table["seed"] == 0]
    which = (own["signal"] == condition.signal) & (own["conflict_in"] == condition.conflict_in)
    row = own[which & (own["aspects"] == " ".join(condition.aspects))].iloc[0]
    for name in ("accuracy", "nrmse", *SOURCES):
        limit = 0.05 if name == "nrmse" else 1.0
        assert row[name] == pytest.approx(again[name], abs=limit, nan_ok=True)
    answers = stored.of(condition)
    source = Source(model.dataset(recorded))
    (extra,) = {answers.sentence or answers.clip}
    answer = respond_under(model, source, [stored.index], condition, extra=[extra])
    if answers.track >= 0:
        made = model.scaling.joints_back(answer.joints[0].numpy())
        np.testing.assert_allclose(stored.joints[answers.track], made, atol=0.02)
    else:
        assert conflict_examples.sentences(answer) == [answers.answer]


def test_films_show_the_clips_arrangement(stored, recorded):
    assert stored.strips.shape == (12, 6, 60, 80, 3)
    first = stored.strips[:, 0].astype(int)
    # before the motion all 12 show the same two cubes, nearly in their places
    assert np.abs(first - first[0]).mean(axis=(1, 2, 3)).max() < 12
    moving = np.abs(stored.strips.astype(int) - first[:, None]).mean(axis=(2, 3, 4))
    assert (moving[:, 2:5].max(axis=1) > 8).all()


# ---------------------------------------------------------------- the panel


def test_controls_stand_for_every_condition_that_is_told():
    found = {conflict_cards.condition_of(*position) for position in POSITIONS}
    wanted = {c for signal in EXTRA_INPUT for c in conditions(signal)}
    assert found == {c for c in wanted if c.conflict_in not in ("congruent_other", "blank")}
    assert len(found) == 64
    of = conflict_cards.condition_of
    assert of("describe", "all of it", 2, "speed") == ("describe", "language", ("action", "speed"))
    assert of("execute", "video only", 1, "cube") == ("execute", "vision", ("position",))
    assert of("execute", "none", 3, "cube") == ("execute", "none", ())


@pytest.fixture(scope="module")
def panel(recorded, stored, table):
    return conflict_cards.panel(recorded, stored, table)


@pytest.fixture
def static(monkeypatch):
    monkeypatch.setenv("PTAE_STATIC", "1")


def test_live_equals_stored_at_every_position(panel, static):
    html = panel.html()
    found = re.findall(r"<div data-frame( hidden)?>(.*?)</div>", html, re.DOTALL)
    for hidden, frame in found:  # scenes and photos out of sight are laid away
        large = "<iframe" in frame or "data:image/webp" in frame
        assert (large and bool(hidden)) == frame.startswith("<template>")
    frames = [frame.removeprefix("<template>").removesuffix("</template>") for _, frame in found]
    order = [int(n) for n in re.search(r'data-order="\[(.*?)\]"', html).group(1).split(",")]
    assert len(frames) == 64 and len(order) == len(POSITIONS)
    view = panel.widget()
    controls = controls_of(view)
    for number, (signal, extra, count, first) in zip(order, POSITIONS, strict=True):
        controls["signal"].value, controls["extra input"].value = signal, extra
        controls["conflicts"].value, controls["false first"].value = count, first
        assert view.children[-2].value == frames[number]
    assert len(html) < 2_000_000


def card(panel, *position):
    names = ("signal", "extra", "conflicts", "first")
    return panel.frame(**dict(zip(names, position, strict=True)))


@pytest.mark.parametrize("position", POSITIONS[::5], ids=str)
def test_a_card_shows_and_says_what_is_stored(panel, stored, table, recorded, position, static):
    condition, made = conflict_cards.condition_of(*position), card(panel, *position)
    row, html = stored.of(condition), made.html
    own = pattern(int(recorded.pattern[stored.index]))
    assert f"<b>{condition.signal}.</b>" in html
    assert html.count("≠") == len(condition.aspects)  # each false part has its mark
    assert row.answer in html and f"<b>{row.source}</b>" in html
    assert ("distractor</td>" in html) == bool(condition.aspects)
    assert ("data-ptae-embed" in html) == (condition.signal not in ANSWERS_WORDS)
    which = (table["signal"] == condition.signal) & (table["aspects"] == row.aspects)
    rows = table[which & (table["conflict_in"] == condition.conflict_in)]
    score = rows["accuracy" if condition.signal in ANSWERS_WORDS else "nrmse"].mean()
    assert f"{score:.1f} %" in html and f"truth {rows['truth'].mean():.0f} %" in html
    strips = re.findall(r'alt="(.*?)" style=".*?(double|solid)', html)
    kinds = [edge for _, edge in strips]
    if EXTRA_INPUT[condition.signal] == "language":
        assert kinds == ["solid"] and own.action in strips[0][0]
    elif condition.conflict_in == "none":
        assert kinds == ["solid"] and strips[0][0].startswith("first frame of")
    else:  # under a conflict in the joints alone, what is seen is the clip's own
        false = condition.conflict_in in ("action", "vision")
        assert kinds == ["solid", "double" if false else "solid"]


def test_false_words_are_marked_beside_the_true_ones(panel, static):
    html = card(panel, "describe", "all of it", 1, "action").html
    assert re.search(r"≠ (push|pull|slide|move-\w+)</span> <small>\(not (push|pull|slide)\)", html)


def test_both_arms_are_in_one_scene_and_the_models_is_faint(panel, static):
    html = card(panel, "execute", "all of it", 3, "action").html
    assert html.count("<iframe") == 1
    assert "Faint orange arm: that of the model. Solid: the recorded one" in html

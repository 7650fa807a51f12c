"""Panels that ask models in a notebook's kernel."""

import numpy as np
import pytest
import torch

from ptae_lite import artefacts, evaluation, vision
from ptae_lite.data.samples import load_samples
from ptae_lite.data.signals import Source, build, signal_number
from ptae_lite.language import parse, pattern
from ptae_lite.live import live_part
from ptae_lite.models import checkpoint
from ptae_lite.plots import style
from ptae_lite.robot.motions import VARIATIONS
from ptae_lite.widgets import ask


@pytest.fixture(scope="module")
def samples():
    return load_samples("recording")


@pytest.fixture(scope="module")
def ptae():
    return checkpoint.load(artefacts.stored("weights/ptae.safetensors"))


@pytest.fixture(scope="module")
def encoder():
    return vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))


@pytest.fixture(scope="module")
def panel(ptae, encoder, samples):
    return ask.attention(ptae, encoder, samples)


def test_there_is_a_clip_of_each_pattern(samples):
    known = ask.clips()
    assert list(known.values()) == [k * VARIATIONS for k in range(144)]
    tested = set(samples.split("test").tolist())
    assert all((index in tested) == text.endswith("test") for text, index in known.items())


@pytest.mark.parametrize("number", [0, 3])  # a slow clip, and a fast one or another slow one
def test_unchanged_keys_are_those_of_the_task(ptae, samples, number):
    source, which = Source(ptae.dataset(samples)), evaluation.alternatives_for(864)
    one = torch.tensor([number * VARIATIONS])
    batch = build(source, one, torch.tensor([signal_number("describe")]), which[one])
    count = int(samples.frames[one])
    torch.testing.assert_close(ask.with_keys(batch, np.arange(count), ask.ZEROS).keys, batch.keys)
    short = ask.with_keys(batch, np.arange(10), ask.NOTHING)
    assert short.keys.shape[1] == 10 and short.frames.tolist() == [10]
    held = ask.with_keys(batch, np.arange(10), ask.LAST).keys
    torch.testing.assert_close(held[:, 10:], held[:, 9:10].expand(-1, 90, -1))


def test_every_choice_is_answered_and_frames_matter(panel):
    chosen = panel.start | {"clip": next(text for text in ask.clips() if "fast" in text)}
    for name, allowed in panel.values.items():
        for value in allowed if name != "clip" else allowed[::36]:
            assert panel.frame(**chosen | {name: value}).text
    for task in panel.values["task"]:
        seen = {panel.face(**chosen | {"task": task, "frames": order}) for order in ask.ORDERS}
        assert len(seen) == len(ask.ORDERS)


def test_it_says_what_the_model_says(panel, ptae, samples):
    text, index = next(iter(ask.clips().items()))
    heard = evaluation.respond(ptae, Source(ptae.dataset(samples)), [index], "describe")
    said = panel.frame(**panel.start | {"clip": text, "task": "describe"}).text
    assert evaluation.sentences(heard)[0] in said
    assert ("right" in said) == bool(evaluation.correct(heard, samples, [index])[0])


def test_models_stand_side_by_side(ptae, samples):
    few = checkpoint.load(artefacts.stored("weights/ptae_labelled_5_seed0.safetensors"))
    panel = ask.labelled({5: few, 100: ptae}, samples)
    shown = panel.frame(clip=list(ask.clips())[0]).data
    assert shown.columns.tolist() == ["the clip shows", "5 %", "100 %"]
    assert parse(shown.iloc[0, 0]) == pattern(0).meaning


def test_other_colours_and_numbers_change_the_right_column_alone(simulator, encoder, samples):
    panel = ask.reconstructed(encoder, samples)

    def pictures(**changed):
        axes = panel.frame(**panel.start | changed).axes
        return [axis.images[0].get_array() for axis in axes if axis.images]

    same, other = pictures(), pictures(left_cube="yellow")
    moved = pictures(number=5, by=3)
    assert (same[0] == same[1]).all() and (same[2] == same[3]).all()
    assert (other[0] == same[0]).all() and (other[1] != same[1]).any()
    assert (moved[1] == same[1]).all() and (moved[3] != same[3]).any()


@pytest.mark.parametrize("made", [style.closed, style.chart])
def test_below_the_stored_answers_a_notebook_has_the_kernels_panel(monkeypatch, panel, made):
    figure = made(panel.frame(**panel.start).figure)
    part = live_part.LivePart("transformer", figure, "Attention", kernel=lambda: panel)
    shown = []
    monkeypatch.setattr(live_part, "display", lambda one, **_: shown.append(one))
    monkeypatch.setenv("PTAE_STATIC", "0")
    part._ipython_display_()
    assert shown[1:] == [panel] and len(shown[0]) > 1
    monkeypatch.setenv("PTAE_STATIC", "1")
    part._ipython_display_()
    assert len(shown) == 3 and "data-ptae-live" in shown[2]["text/html"]

"""A training that was stopped goes on to the same weights, wherever it was stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace

import numpy as np
import pytest
import torch

from ptae_lite import training, unfinished, vision
from ptae_lite.errors import ArtefactError, TrainingError
from ptae_lite.models import checkpoint
from ptae_lite.recipe import Recipe


class Stopped(Exception):
    pass


def stop_at(wanted: int):
    def look(epoch, _):
        if epoch == wanted:
            raise Stopped
        return {"epoch": epoch}

    return look


def same(one, other) -> bool:
    a, b = one.model.state_dict(), other.model.state_dict()
    return all(torch.equal(a[name], b[name]) for name in a)


RECIPES = {
    "Adam": Recipe(epochs=4, batch=8),
    "Muon": Recipe(epochs=4, batch=8, muon_lr=2e-3, warmup=0.2),
}


@pytest.fixture
def at_once(monkeypatch):
    monkeypatch.setattr(unfinished, "EVERY_S", 0)


@pytest.mark.parametrize("name", RECIPES)
@pytest.mark.parametrize("model", ["ptae", "pgae", "pvae"])
def test_a_stopped_training_goes_on_to_the_same_bits(
    few, small_configs, tmp_path, at_once, model, name
):
    options = {"recipe": RECIPES[name], "model": model, "config": small_configs[model]}
    whole = training.train(few, on_epoch=stop_at(99), **options)
    state = tmp_path / "state.safetensors"
    for epoch in (2, 3, 4):  # stopped three times; the second time right after it went on
        with pytest.raises(Stopped):
            training.train(few, unfinished=state, on_epoch=stop_at(epoch), **options)
    parts = training.train(few, unfinished=state, on_epoch=stop_at(99), **options)
    assert same(whole, parts)
    for what in ("history", "supervised_samples_seen", "steps"):
        assert whole.about[what] == parts.about[what]
    assert [seen["epoch"] for seen in parts.about["watched"]] == [1, 2, 3, 4]


def test_a_finished_training_that_is_asked_for_again_is_the_same(few, tiny, tmp_path, at_once):
    state, recipe = tmp_path / "state.safetensors", RECIPES["Muon"]
    first = training.train(few, recipe, config=tiny, unfinished=state)
    assert same(first, training.train(few, recipe, config=tiny, unfinished=state))


@pytest.mark.parametrize("change", [{"seed": 1}, {"epochs": 5}, {"muon_lr": 1e-3}])
def test_another_training_is_not_gone_on_with(few, tiny, tmp_path, at_once, change):
    state, recipe = tmp_path / "state.safetensors", RECIPES["Muon"]
    training.train(few, recipe, config=tiny, unfinished=state)
    before = state.read_bytes()
    with pytest.raises(ArtefactError, match="another training"):
        training.train(few, replace(recipe, **change), config=tiny, unfinished=state)
    assert state.read_bytes() == before


def test_other_labels_are_another_training(few, tiny, tmp_path, at_once):
    state, recipe, train = tmp_path / "state", RECIPES["Adam"], few.split("train")
    training.train(few, recipe, config=tiny, labelled=train[:6], unfinished=state)
    with pytest.raises(ArtefactError, match="another training"):
        training.train(few, recipe, config=tiny, labelled=train[1:7], unfinished=state)


def test_nothing_is_kept_before_ten_minutes(few, tiny, tmp_path):
    training.train(few, RECIPES["Adam"], config=tiny, unfinished=tmp_path / "state")
    assert not list(tmp_path.iterdir())


def test_a_loss_that_is_no_number_stops_with_a_sentence(few, tiny):
    recipe = Recipe(epochs=3, batch=8, learning_rate=1e20, clip=1e30, seed=5)
    with pytest.raises(TrainingError, match="seed 5 .* at update [0-9]+ "):
        training.train(few, recipe, config=tiny)


@pytest.mark.parametrize("kind", ["plain", "separated"])
def test_a_stopped_autoencoder_goes_on_to_the_same_bits(tmp_path, at_once, kind):
    images = np.random.default_rng(0).integers(0, 256, (6, 120, 160, 3), dtype=np.uint8)
    recipe, state = vision.AutoencoderRecipe(steps=6, batch=2, seed=3), tmp_path / "state"

    def trained(end=99, images=images, recipe=recipe, **options):
        encoder = vision.make_autoencoder(kind)

        def steps(numbers):
            for number in numbers:
                if number == end:
                    raise Stopped
                yield number

        losses = vision.train_autoencoder(encoder, images, recipe, steps, **options)
        return encoder.state_dict(), losses

    whole, losses = trained()
    for end in (2, 3, 5):
        with pytest.raises(Stopped):
            trained(end, unfinished=state)
    parts, again = trained(unfinished=state)
    assert losses == again and len(losses) == 6
    assert all(torch.equal(whole[name], parts[name]) for name in whole)
    for other in ({"images": images[:5]}, {"recipe": replace(recipe, seed=4)}):
        with pytest.raises(ArtefactError, match="another training"):
            trained(unfinished=state, **other)


KILLED = """
    import sys, time
    import torch
    torch.set_num_threads(1)
    from pathlib import Path
    from ptae_lite import training, unfinished, vision
    from ptae_lite.data.samples import load_samples
    from ptae_lite.models import checkpoint
    from ptae_lite.models.ptae import PTAEConfig
    from ptae_lite.recipe import Recipe

    unfinished.EVERY_S = 0
    config = PTAEConfig(hidden=16, heads=2, feed_forward=32, decoder_units=8)
    recipe = Recipe(epochs=4, batch=108, muon_lr=2e-3, warmup=0.2)
    trained = training.train(load_samples(), recipe, config=config, unfinished=sys.argv[1])
    checkpoint.save(sys.argv[2], trained)
"""


@pytest.mark.stops
def test_a_killed_training_goes_on_to_the_same_bits(tmp_path):
    def start(state, out):
        script = [sys.executable, "-c", textwrap.dedent(KILLED), tmp_path / state, tmp_path / out]
        return subprocess.Popen(script, env=os.environ | {"OMP_NUM_THREADS": "1"})

    assert start("whole", "whole.safetensors").wait() == 0
    state, kills = tmp_path / "state", 0
    rng = np.random.default_rng(0)
    while not (tmp_path / "parts.safetensors").exists():
        before = state.exists() and state.stat().st_mtime_ns
        process = start("state", "parts.safetensors")
        while process.poll() is None and before == (state.exists() and state.stat().st_mtime_ns):
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 0.5))  # somewhere in an epoch, or in a writing
        if process.poll() is None:
            process.send_signal(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
            kills += 1
        process.wait()
    assert kills
    whole, parts = (checkpoint.load(tmp_path / f"{n}.safetensors") for n in ("whole", "parts"))
    assert same(whole, parts)

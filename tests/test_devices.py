"""Where arithmetic is done: refusals anywhere; on a GPU, that it gives what the CPU gives."""

import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from ptae_lite import devices, training, vision
from ptae_lite.data.signals import build
from ptae_lite.errors import ConfigError
from ptae_lite.experiments.encoder_training import LongTraining
from ptae_lite.models import MODELS
from ptae_lite.training import Recipe

gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU here")
SMALL = vision.AutoencoderRecipe(steps=40, batch=4)


def test_a_device_that_is_not_here_is_refused(few, tiny):
    with pytest.raises(ConfigError, match="device 'tpu9' cannot be used here, .*; train without"):
        training.train(few, Recipe(epochs=1, batch=8), config=tiny, device="tpu9")
    with pytest.raises(ConfigError, match="device 'tpu9' cannot be used here"):
        vision.AutoencoderTrainer(vision.make_autoencoder("plain"), SMALL, "tpu9")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_a_gpu_is_refused_where_there_is_none():
    with pytest.raises(ConfigError, match="device 'cuda' cannot be used here"):
        devices.check("cuda")


def test_a_gpu_is_chosen_only_where_there_is_one(monkeypatch):
    for there, wanted in ((True, "cuda"), (False, "cpu")):
        monkeypatch.setattr(torch.cuda, "is_available", lambda there=there: there)
        assert devices.choose("auto") == wanted and devices.choose("cpu") == "cpu"


@pytest.mark.parametrize("model", MODELS)
def test_a_model_makes_its_tensors_where_its_input_is(source, small_configs, model):
    """A tensor that is made without a device would here be made where nothing can be computed."""
    samples = torch.arange(0, 864, 90)
    mixed = build(source, samples, torch.arange(10) % 5, torch.arange(10) % 8)
    network = MODELS[model].network(small_configs[model])
    paired = torch.arange(len(mixed.frames)) % 2 == 0
    found = []
    for default in ("cpu", "meta"):
        with torch.device(default), devices.seeded(0, "cpu"):
            found.append([*network(mixed), *network.loss(mixed, paired)])
    for one, other in zip(*found, strict=True):
        assert other.device.type == "cpu" and torch.equal(one, other)


def test_a_training_leaves_the_generators_and_cudnn_as_they_were(few, tiny):
    encoder = vision.make_autoencoder("plain")
    torch.manual_seed(3)
    wanted, precision = torch.rand(4), torch.backends.cudnn.allow_tf32
    torch.manual_seed(3)
    training.train(few, Recipe(epochs=1, batch=8), config=tiny)
    images = np.zeros((4, 120, 160, 3), np.uint8)
    vision.train_autoencoder(encoder, images, vision.AutoencoderRecipe(steps=1, batch=2))
    assert torch.equal(torch.rand(4), wanted) and torch.backends.cudnn.allow_tf32 == precision


@gpu
@pytest.mark.parametrize("model", ["ptae", "pgae", "pvae"])
def test_a_gpu_trains_the_same_model(few, small_configs, model):
    recipe, made = Recipe(epochs=1, batch=8), []
    for device in ("cpu", "cuda"):
        trained = training.train(few, recipe, model=model, config=small_configs[model],
                                 device=device)  # fmt: skip
        made.append(torch.cat([p.flatten() for p in trained.model.parameters()]))
    torch.testing.assert_close(*made, atol=1e-3, rtol=0)


@pytest.fixture(scope="module")
def images():
    """White, with a black square somewhere."""
    made, rng = np.full((60, 120, 160, 3), 255, np.uint8), np.random.default_rng(0)
    for image, (y, x) in zip(made, rng.integers(0, 80, (60, 2)), strict=True):
        image[y : y + 40, x : x + 40] = 0
    return made


@gpu
@pytest.mark.parametrize("kind", ["separated", "plain"])
def test_a_gpu_trains_the_same_eye(images, kind):
    losses, seen = [], []
    for device in ("cpu", "cuda"):
        encoder = vision.make_autoencoder(kind)
        losses.append(vision.train_autoencoder(encoder, images, SMALL, device=device))
        seen.append(vision.encode_images(encoder, images))  # the eye is back on the CPU
    assert losses[0][-1] < 0.9 * losses[0][0]  # it has learnt something
    np.testing.assert_allclose(losses[1], losses[0], rtol=0.05)
    assert np.abs(seen[1] - seen[0]).max() < 0.1 * np.abs(seen[0]).max()


@gpu
def test_on_a_gpu_too_a_branch_leaves_the_long_training_as_it_was(images, tmp_path):
    how = replace(SMALL, steps=32)
    asked = LongTraining("plain", {"code": 10}, how, "", name="plain 10", device="cuda")
    trained = asked.fit(SimpleNamespace(images=images))
    long = trained.training
    before = copy.deepcopy(long.encoder.state_dict())
    branch = copy.deepcopy(long)
    branch.go(images, 40, 40)
    asked.save(tmp_path / "long.safetensors", trained)
    again = asked.load(tmp_path / "long.safetensors").training
    again.go(images, 40, 40)
    alone = vision.make_autoencoder("plain")
    vision.train_autoencoder(alone, images, SMALL, device="cuda")
    for name, value in alone.state_dict().items():
        for other in (branch, again):
            torch.testing.assert_close(
                other.encoder.state_dict()[name].cpu(), value, atol=1e-2, rtol=0
            )
        assert torch.equal(long.encoder.state_dict()[name], before[name])

"""The eye: layers, separation of the channels, training and storing."""

import copy
import mmap
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import nn

from ptae_lite import artefacts, vision
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.robot import recorder


def parameters(module):
    return sum(p.numel() for p in module.parameters())


@pytest.fixture
def images():
    """Eight pictures of one coloured square each, on black."""
    rng = np.random.default_rng(0)
    made = np.zeros((8, 120, 160, 3), np.uint8)
    for image, (row, column) in zip(made, rng.integers(0, 90, (8, 2)), strict=True):
        image[row : row + 30, column : column + 30] = rng.integers(0, 256, 3)
    return made


@pytest.mark.parametrize(
    ("encoder", "count", "features"),
    [
        (vision.CAE(1), 664_891, 10),
        (vision.ChannelSeparatedCAE(), 1_994_673, 30),
        (vision.PlainCAE(), 665_405, 10),
        (vision.PlainCAE(30), None, 30),
    ],
)
def test_sizes_are_the_published_ones(encoder, count, features):
    if count:
        assert parameters(encoder) == count
    channels = getattr(encoder, "channels", 3)
    given = torch.rand(2, channels, 120, 160)
    assert encoder.encode(given).shape == (2, features)
    made = encoder(given)
    assert made.shape == given.shape
    assert made.min() >= 0 and made.max() <= 1


def test_layers_are_the_published_ones():
    """Convolutions halve the image three times and divide it by five; no activation after them."""
    cae, shapes = vision.CAE(1), []
    x = torch.rand(1, 1, 120, 160)
    for layer in [*cae.encoder, *cae.decoder]:
        x = layer(x)
        if not isinstance(layer, nn.ReLU | nn.Flatten | nn.Sigmoid):
            shapes.append(tuple(x.shape[1:]))
    assert shapes == [
        (8, 60, 80), (16, 30, 40), (32, 15, 20), (64, 3, 4), (384,), (192,), (10,),
        (192,), (384,), (32, 3, 4), (32, 15, 20), (16, 30, 40), (8, 60, 80), (1, 120, 160),
    ]  # fmt: skip
    kinds = "".join(type(layer).__name__[0] for layer in [*cae.encoder, *cae.decoder])
    assert kinds == "CRCRCRCR" + "FLLL" + "LLU" + "CRCRCRCS"


@pytest.mark.parametrize("kind", vision.ENCODERS)
def test_gradients_reach_every_parameter(kind):
    encoder = vision.make_autoencoder(kind)
    given = torch.rand(4, 3, 120, 160)
    nn.functional.binary_cross_entropy(encoder(given), given).backward()
    assert [n for n, p in encoder.named_parameters() if p.grad is None or not p.grad.any()] == []


def test_red_features_do_not_see_green():
    torch.manual_seed(0)
    encoder, given = vision.ChannelSeparatedCAE(), torch.rand(2, 3, 120, 160)
    changed = given.clone()
    changed[:, 1] = torch.rand(2, 120, 160)
    before, after = encoder.encode(given), encoder.encode(changed)
    same = (before == after).all(0)
    assert same.tolist() == [True] * 10 + [False] * 10 + [True] * 10
    untouched = (encoder.decode(before) == encoder.decode(after)).flatten(2).all(2).all(0)
    assert untouched.tolist() == [True, False, True]


def test_images_become_channels_first_from_0_to_1(images):
    given = vision.as_input(images)
    assert given.shape == (8, 3, 120, 160) and given.dtype == torch.float32
    assert given[3, 2, 50, 60].item() == pytest.approx(images[3, 50, 60, 2] / 255)


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((120, 160, 3), np.uint8),
        np.zeros((1, 160, 120, 3), np.uint8),
        np.zeros((1, 3, 120, 160), np.uint8),
        np.zeros((1, 120, 160, 4), np.uint8),
        np.zeros((1, 120, 160, 3)),
    ],
    ids=lambda array: f"{array.shape} {array.dtype}",
)
def test_images_of_another_shape_are_refused(unchecked, wrong):
    with pytest.raises(ConfigError, match="B x 120 x 160 x 3 bytes, not .* of"):
        vision.as_input(wrong)


@pytest.mark.parametrize("kind", vision.ENCODERS)
def test_logits_are_the_drawing_before_its_sigmoid(kind):
    encoder, given = vision.make_autoencoder(kind), torch.rand(2, 3, 120, 160)
    torch.testing.assert_close(encoder.logits(given).sigmoid(), encoder(given))


@pytest.mark.parametrize("value", [True, False])
@pytest.mark.parametrize("kind", vision.ENCODERS)
def test_the_fast_loss_equals_the_readable_one(images, kind, value):
    """Values and gradients, in either layout in memory."""
    encoder, x = vision.make_autoencoder(kind).double(), vision.as_input(images).double()
    readable = nn.functional.binary_cross_entropy(encoder(x.contiguous()), x.contiguous())
    readable.backward()
    expected = [p.grad for p in encoder.parameters()]
    encoder.zero_grad(set_to_none=True)
    encoder.to(memory_format=torch.channels_last)
    quick = vision.PixelCrossEntropy.apply(encoder.logits(x), x, value)
    (1.0 * quick).backward()
    assert quick.item() == pytest.approx(readable.item() if value else 0, rel=1e-9)
    for p, gradient in zip(encoder.parameters(), expected, strict=True):
        torch.testing.assert_close(p.grad, gradient, rtol=1e-9, atol=1e-12)


def test_the_gradient_of_the_loss_is_scaled_by_what_comes_after_it():
    z, x = torch.randn(2, 1, 3, 3, requires_grad=True), torch.rand(2, 1, 3, 3)
    (3 * vision.PixelCrossEntropy.apply(z, x)).backward()
    torch.testing.assert_close(z.grad, 3 * (z.detach().sigmoid() - x) / 18)


def test_images_become_numbers_from_0_to_1_channels_first(images, unchecked):
    x = vision.as_input(images)
    np.testing.assert_allclose(x.numpy(), images.transpose(0, 3, 1, 2) / 255, atol=1e-7)
    with pytest.raises(ConfigError, match="images are B x 120 x 160 x 3 bytes, not"):
        vision.as_input(images[:, :10])


def test_a_long_training_passes_through_the_states_that_short_ones_end_from(images):
    """Stopped, copied, and gone on with: what `train_autoencoder` of that length gives."""

    def weights(encoder):
        return torch.cat([p.flatten() for p in encoder.parameters()])

    recipe = vision.AutoencoderRecipe(batch=2, seed=4)
    long = vision.AutoencoderTrainer(vision.PlainCAE(3), recipe)
    long.go(images, 4)
    branch = copy.deepcopy(long)
    branch.go(images, 5, 5)
    long.go(images, 8, value=False)
    for encoder, steps in ((branch.encoder, 5), (long.encoder, None)):
        alone = vision.PlainCAE(3)
        if steps:
            vision.train_autoencoder(alone, images, replace(recipe, steps=steps))
            assert torch.equal(weights(alone), weights(encoder))
    long.go(images, 10, 10)
    alone = vision.PlainCAE(3)
    vision.train_autoencoder(alone, images, replace(recipe, steps=10))
    assert torch.equal(weights(alone), weights(long.encoder))


def test_the_rate_rises_stays_and_falls_to_nearly_zero(images, monkeypatch):
    rates, go = [], torch.optim.Adam.step

    def step(self, *rest):
        rates.append(self.param_groups[0]["lr"])
        return go(self, *rest)

    monkeypatch.setattr(torch.optim.Adam, "step", step)
    monkeypatch.setattr("ptae_lite.vision.training.WARM_UP", 4)
    recipe = vision.AutoencoderRecipe(steps=20, batch=1, learning_rate=0.1)
    vision.train_autoencoder(vision.PlainCAE(1), images, recipe)
    np.testing.assert_allclose(
        rates, [0.025, 0.05, 0.075] + [0.1] * 14 + [0.075, 0.05, 0.025], atol=1e-9
    )


@pytest.mark.parametrize("kind", vision.ENCODERS)
def test_a_short_training_lowers_the_loss(images, kind):
    recipe = vision.AutoencoderRecipe(steps=12, batch=4, learning_rate=0.01)
    losses = vision.train_autoencoder(vision.make_autoencoder(kind), images, recipe)
    assert len(losses) == 12
    assert losses[-1] < losses[0] - 0.03


def test_the_same_seed_gives_the_same_eye_and_another_another(images):
    def trained(seed):
        encoder = vision.PlainCAE(3)
        vision.train_autoencoder(
            encoder, images, vision.AutoencoderRecipe(steps=2, batch=2, seed=seed)
        )
        return torch.cat([p.flatten() for p in encoder.parameters()])

    assert torch.equal(trained(1), trained(1))
    assert not torch.equal(trained(1), trained(2))


def test_features_do_not_depend_on_the_batch(images):
    encoder = vision.ChannelSeparatedCAE().eval()
    together = vision.encode_images(encoder, images)
    assert together.shape == (8, 30)
    np.testing.assert_allclose(vision.encode_images(encoder, images, batch=3), together, atol=1e-6)


@pytest.mark.parametrize(("kind", "code"), [("separated", 2), ("plain", 5)])
def test_an_eye_comes_back_from_its_file(tmp_path, images, kind, code):
    encoder = vision.make_autoencoder(kind, code)
    path = tmp_path / "eye.safetensors"
    vision.save_autoencoder(path, encoder, vision.AutoencoderRecipe())
    again = vision.load_autoencoder(path)
    assert again.kind == kind and not again.training
    np.testing.assert_array_equal(
        vision.encode_images(again, images), vision.encode_images(encoder, images)
    )


def test_a_file_of_something_else_is_no_eye(tmp_path):
    path = tmp_path / "other.safetensors"
    artefacts.save_weights(path, {"x": torch.zeros(1)}, {"kind": "ptae"})
    with pytest.raises(ArtefactError, match="holds no CAE but 'ptae'"):
        vision.load_autoencoder(path)


def test_an_unknown_eye_is_refused_with_those_there_are():
    with pytest.raises(ConfigError, match="no encoder 'third'; there are separated, plain"):
        vision.make_autoencoder("third")


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"batch": 0}])
def test_a_recipe_without_steps_or_images_is_refused(wrong):
    with pytest.raises(ConfigError, match="at least one step"):
        vision.AutoencoderRecipe(**wrong)


def test_an_eye_whose_weights_do_not_fit_its_sizes_is_refused(tmp_path):
    path = tmp_path / "eye.safetensors"
    vision.save_autoencoder(path, vision.make_autoencoder("plain"), vision.AutoencoderRecipe())
    tensors, about = artefacts.load_weights(path)
    artefacts.save_weights(path, tensors, about | {"code": 12})
    with pytest.raises(ArtefactError, match="do not fit the sizes written in it"):
        vision.load_autoencoder(path)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from Linux")
def test_a_recording_is_seen_in_little_memory(monkeypatch):
    """A PCA makes images of floats at once: each sequence once kept 23 MB beside its features."""

    def load_sequence(folder, index, variation):
        return SimpleNamespace(images=np.full((100, 120, 160, 3), variation, np.uint8))

    monkeypatch.setattr(recorder, "samples_in_order", lambda: [(0, v) for v in range(40)])
    monkeypatch.setattr(recorder, "load_sequence", load_sequence)
    encoder, before = vision.make_autoencoder("pca", 10), pages()
    codes = vision.encode_recording(encoder, "none")
    assert codes.shape == (4000, 10)
    assert (pages() - before) * mmap.PAGESIZE < 0.4e9


def pages() -> int:
    """Of memory that this process has."""
    return int(Path("/proc/self/statm").read_text().split()[1])

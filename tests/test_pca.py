"""PCA as an eye: the linear autoencoder with the smallest squared error."""

import numpy as np
import pytest
import torch

from ptae_lite import vision
from ptae_lite.errors import ConfigError
from ptae_lite.vision import pca

ENCODERS = (pca.JointPCA, pca.ChannelPCA)


@pytest.fixture(scope="module")
def images():
    """Twelve noisy pictures."""
    return np.random.default_rng(0).integers(0, 256, (12, 120, 160, 3), np.uint8)


@pytest.fixture(scope="module", params=ENCODERS)
def encoder(request, images):
    return pca.fit(request.param(4), images)


def test_components_are_those_of_the_singular_value_decomposition(encoder, images):
    x = vision.as_input(images).reshape(12, encoder.groups, -1).double()
    for group in range(encoder.groups):
        part = x[:, group] - x[:, group].mean(0)
        right = torch.linalg.svd(part, full_matrices=False)[2][:4]
        along = (right @ encoder.axes[group].double()).abs()
        torch.testing.assert_close(along, torch.eye(4, dtype=torch.double), atol=1e-4, rtol=0)


def test_axes_are_orthonormal_and_the_largest_is_first(encoder, images):
    axes = encoder.axes.double()
    square = axes.transpose(1, 2) @ axes
    torch.testing.assert_close(square, torch.eye(4).double().expand_as(square), atol=1e-5, rtol=0)
    spread = vision.encode_images(encoder, images).reshape(12, encoder.groups, 4).std(0)
    assert (np.diff(spread, axis=1) < 0).all()


def test_images_that_are_mixtures_of_a_few_come_back_exactly():
    rng = np.random.default_rng(1)
    few = rng.integers(0, 60, (3, 120, 160, 3))
    shares = rng.integers(0, 2, (10, 3))
    images = np.tensordot(shares, few, 1).astype(np.uint8)
    for kind in ENCODERS:
        encoder, x = pca.fit(kind(3), images), vision.as_input(images)
        assert encoder(x).shape == x.shape
        torch.testing.assert_close(encoder(x), x, atol=2e-4, rtol=0)


def test_more_components_draw_better_and_the_mean_is_drawn_from_nothing(images):
    x = vision.as_input(images)
    errors = [((pca.fit(pca.JointPCA(k), images)(x) - x) ** 2).mean() for k in (1, 4, 8)]
    assert errors[0] > errors[1] > errors[2]
    encoder = pca.fit(pca.JointPCA(4), images)
    drawn = encoder.decode(torch.zeros(1, 4))
    torch.testing.assert_close(drawn, x.mean(0, keepdim=True), atol=1e-5, rtol=0)


def test_only_the_separated_one_keeps_channels_apart(images):
    changed = images.copy()
    changed[..., 1] = 0
    for kind, same in ((pca.ChannelPCA, [1, 0, 1]), (pca.JointPCA, [0])):
        encoder = pca.fit(kind(2), images)
        before, after = (vision.encode_images(encoder, some) for some in (images, changed))
        equal = (before == after).all(0).reshape(-1, 2).all(1)
        assert equal.tolist() == [bool(x) for x in same]


def test_drawings_stay_within_black_and_white(encoder):
    drawn = encoder.decode(1e4 * torch.randn(2, 4 * encoder.groups))
    assert drawn.min() == 0 and drawn.max() == 1


def test_it_comes_back_from_its_file(tmp_path, encoder, images):
    path = tmp_path / "eye.safetensors"
    vision.save_autoencoder(path, encoder)
    again = vision.load_autoencoder(path)
    assert type(again) is type(encoder)
    expected = vision.encode_images(encoder, images)
    np.testing.assert_array_equal(vision.encode_images(again, images), expected)


def test_too_few_images_are_refused(images):
    with pytest.raises(ConfigError, match="4 components need more than 4 images"):
        pca.fit(pca.JointPCA(4), images[:4])

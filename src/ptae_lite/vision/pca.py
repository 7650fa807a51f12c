"""Encoders without a network: principal component analysis (PCA) of images. Ours, not in the paper.

PCA keeps the directions in which the training images vary most. Of all linear autoencoders with as
many numbers it has the smallest squared error. It is computed, not trained step by step.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from ptae_lite.errors import ConfigError

CHANNELS, HEIGHT, WIDTH = 3, 120, 160
PARTS = 12  # of an image's height, when a PCA is fitted


class JointPCA(nn.Module):
    """Components of the whole image, with its three channels together: F = `code`."""

    kind = "pca"
    groups = 1  # parts of the image that have components of their own

    def __init__(self, code: int = 10):
        super().__init__()
        pixels = CHANNELS * HEIGHT * WIDTH // self.groups
        self.code = code
        self.register_buffer("mean", torch.zeros(self.groups, 1, pixels))
        self.register_buffer("axes", torch.zeros(self.groups, pixels, code))

    def encode(self, images: Float[Tensor, "B 3 120 160"]) -> Float[Tensor, "B F"]:
        """Features: `(image - mean) @ axes`."""
        parts = images.reshape(len(images), self.groups, -1).transpose(0, 1)
        return ((parts - self.mean) @ self.axes).transpose(0, 1).flatten(1)

    def decode(self, features: Float[Tensor, "B F"]) -> Float[Tensor, "B 3 120 160"]:
        """Images: `features @ axes.T + mean`, cut to 0 to 1."""
        codes = features.reshape(len(features), self.groups, -1).transpose(0, 1)
        parts = codes @ self.axes.transpose(1, 2) + self.mean
        return parts.transpose(0, 1).reshape(-1, CHANNELS, HEIGHT, WIDTH).clamp(0, 1)

    def forward(self, images):
        """The reconstruction of `images`, values 0 to 1."""
        return self.decode(self.encode(images))


class ChannelPCA(JointPCA):
    """Components of each colour channel alone, with their codes side by side: F = 3 x `code`."""

    kind = "pca-separated"
    groups = 3


def fit(encoder: JointPCA, images: UInt8[np.ndarray, "M 120 160 3"]) -> JointPCA:
    """Set a PCA encoder to the components of `images`, and return it.

    There are fewer images than pixels, so each component is a sum of images. The eigenvectors of
    the M x M matrix of the images' inner products are its weights.

    Args:
        images: of training patterns only.

    Raises:
        ConfigError: there are not more images than components.
    """
    if len(images) <= encoder.code:
        raise ConfigError(f"{encoder.code} components need more than {len(images)} images")
    for group, channels in enumerate(np.split(np.arange(CHANNELS), encoder.groups)):
        # In parts: all images as floats take too much memory. Channels come first, as in `encode`.
        parts = [part for c in channels for part in np.split(images[..., c], PARTS, axis=1)]
        products = sum((flat @ flat.T).astype(float) for flat, _ in map(_around_mean, parts))
        sizes, mixtures = np.linalg.eigh(products)
        sizes, mixtures = sizes[-encoder.code :], mixtures[:, -encoder.code :]  # the largest, last
        mixtures = (mixtures / np.sqrt(sizes)).astype(np.float32)
        fitted = [(flat.T @ mixtures, mean) for flat, mean in map(_around_mean, parts)]
        axes, mean = map(np.concatenate, zip(*fitted, strict=True))
        encoder.mean[group, 0] = torch.from_numpy(mean)
        encoder.axes[group] = torch.from_numpy(axes[:, ::-1].copy())
    return encoder


def _around_mean(part: UInt8[np.ndarray, "M H W"]) -> tuple[np.ndarray, np.ndarray]:
    """Images of one channel as rows (M, H x W) minus their mean, and the mean."""
    flat = part.reshape(len(part), -1) / np.float32(255)
    mean = flat.mean(0)
    flat -= mean
    return flat, mean

"""Samples in a network's units.

`prepare` scales them with a `Scaling` that is fitted on training samples only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.errors import ConfigError

JOINT_ROOM = 0.9  # joints lie in +-0.9: the home pose is at an extreme of some, tanh ends at 1
FEATURE_SD = 0.5
HALF_WHITE = 0.25  # exponent of the principal variances; chosen on held-out patterns


@dataclass(frozen=True)
class Scaling:
    """The fixed linear maps in front of a model, and back.

    Joints: each by its own range over the training samples, to +-0.9. Features: minus their mean,
    then a matrix that whitens them half-way (principal components, their spreads brought nearer to
    each other). What names a colour is spread over components of small variance; so it is learnt as
    soon as the rest (chapter 02). Ours; the published code scales all features by one range.
    """

    joint_low: Float[np.ndarray, " 5"]
    joint_high: Float[np.ndarray, " 5"]
    feature_mean: Float[np.ndarray, " F"]
    feature_map: Float[np.ndarray, "F F"]

    @property
    def joint_range(self) -> Float[np.ndarray, " 5"]:
        return self.joint_high - self.joint_low

    def joints(self, raw):
        """Raw joints to network units (+-0.9)."""
        return JOINT_ROOM * (2 * (raw - self.joint_low) / self.joint_range - 1)

    def joints_back(self, scaled):
        """Network units back to raw joints."""
        return (scaled / JOINT_ROOM + 1) / 2 * self.joint_range + self.joint_low

    def features(self, raw):
        return (raw - self.feature_mean) @ self.feature_map


def fit_scaling(samples: Samples, indices, exponent: float = HALF_WHITE) -> Scaling:
    """Fit a `Scaling` on the valid frames of the samples `indices`.

    Each principal component is divided by its variance to the power `exponent`: 0.5 whitens, 0
    only rotates. Whitening fully makes the noise of the smallest components as loud as the rest;
    in the authors' data their variances differ by a factor of 48,000. The joint
    range is that of the samples `indices`; in the authors' data, which are scaled already, it is 1.
    """
    valid = np.arange(MAX_FRAMES) < samples.frames[indices, None]
    joints = samples.joints[indices][valid].astype(float)
    features = samples.features[indices][valid].astype(float)
    mean = features.mean(0)
    features -= mean
    variances, axes = np.linalg.eigh(np.cov(features, rowvar=False))
    variances = np.maximum(variances, 1e-9 * variances.max())
    feature_map = axes * variances**-exponent
    spread = (features @ feature_map).std(0)
    return Scaling(
        joints.min(0), joints.max(0), mean, feature_map * FEATURE_SD / np.sqrt((spread**2).mean())
    )


@dataclass(frozen=True)
class Dataset:
    """Samples in network units, padding exactly zero, as float32."""

    samples: Samples
    scaling: Scaling
    joints: Float[np.ndarray, "S 100 5"]
    features: Float[np.ndarray, "S 100 F"]


def prepare(samples: Samples, scaling: Scaling) -> Dataset:
    """Scale all samples; padded frames stay exactly zero."""
    if len(scaling.feature_mean) != samples.features.shape[2]:
        raise ConfigError(
            f"the scaling is for {len(scaling.feature_mean)} features a frame, "
            f"the samples have {samples.features.shape[2]}"
        )
    mask = (np.arange(MAX_FRAMES) < samples.frames[:, None])[..., None]
    features = np.empty(samples.features.shape, np.float32)
    for made, raw, valid in zip(features, samples.features, mask, strict=True):
        made[:] = scaling.features(raw) * valid  # one by one: all as doubles take much memory
    return Dataset(
        samples,
        scaling,
        (scaling.joints(samples.joints) * mask).astype(np.float32),
        features,
    )

"""Samples in the units of a network.

`prepare` scales all samples with a `Scaling`. The `Scaling` is fitted on training samples only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.errors import ConfigError

JOINT_ROOM = 0.9  # joints lie in +-0.9, because tanh reaches 1 only in the limit
FEATURE_SD = 0.5
HALF_WHITE = 0.25  # exponent of the principal variances; chosen on held-out patterns


@dataclass(frozen=True)
class Scaling:
    """The fixed linear maps in front of a model, and their inverse for joints.

    Joints: each joint's range over the training samples becomes -0.9 to 0.9.

    Features: their mean is subtracted, then a matrix whitens them half-way. It turns them to their
    principal components and makes the spreads of these more alike. The colour words depend on
    components of small variance; without the whitening they are learnt later than the rest (chapter
    02).

    This is ours. The published code scales all features by one range.
    """

    joint_low: Float[np.ndarray, " 5"]
    joint_high: Float[np.ndarray, " 5"]
    feature_mean: Float[np.ndarray, " F"]
    feature_map: Float[np.ndarray, "F F"]

    @property
    def joint_range(self) -> Float[np.ndarray, " 5"]:
        """Highest minus lowest value of each joint over the training samples."""
        return self.joint_high - self.joint_low

    def joints(self, raw):
        """Raw joints to network units (-0.9 to 0.9 over the training samples)."""
        return JOINT_ROOM * (2 * (raw - self.joint_low) / self.joint_range - 1)

    def joints_back(self, scaled):
        """Network units back to raw joints."""
        return (scaled / JOINT_ROOM + 1) / 2 * self.joint_range + self.joint_low

    def features(self, raw):
        """Raw features to network units."""
        return (raw - self.feature_mean) @ self.feature_map


def fit_scaling(samples: Samples, indices, exponent: float = HALF_WHITE) -> Scaling:
    """Fit a `Scaling` on the frames of some samples, padding left out.

    Each principal component is divided by a power of its variance: `component / variance^exponent`.
    All are then multiplied by one number, so that the root mean square of their spreads is 0.5.

    Args:
        indices: the samples to fit on: training samples.
        exponent: 0.5 whitens fully, 0 only rotates. Full whitening makes the noise of the smallest
            components as large as everything else: in the authors' data the variances differ by a
            factor of 48,000.
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
    """Samples in network units, as float32. Padding is exactly zero."""

    samples: Samples
    scaling: Scaling
    joints: Float[np.ndarray, "S 100 5"]
    features: Float[np.ndarray, "S 100 F"]


def prepare(samples: Samples, scaling: Scaling) -> Dataset:
    """Scale all samples. Padding stays exactly zero.

    Raises:
        ConfigError: the scaling is for another number of features.
    """
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

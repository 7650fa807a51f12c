"""The 864 samples as arrays: load, check, scale, split.

`load` reads our recording (or a re-made one) into `Samples`, raw and zero-padded to 100 frames.
`prepare` scales them for a network with a `Scaling` that is fitted on training samples only.
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Bool, Float, Int

from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError, ConfigError, RecordingError
from ptae_lite.language import patterns

MAX_FRAMES = 100
JOINT_ROOM = 0.9  # joints lie in +-0.9: the home pose is at an extreme of some, tanh ends at 1
FEATURE_SD = 0.5


@dataclass(frozen=True)
class Samples:
    """All samples of a data set, raw. S samples, zero-padded to T = 100 frames."""

    joints: Float[np.ndarray, "S 100 5"]  # radians in our recording
    features: Float[np.ndarray, "S 100 F"]
    frames: Int[np.ndarray, " S"]  # clip lengths
    pattern: Int[np.ndarray, " S"]
    variation: Int[np.ndarray, " S"]
    eye: str  # which CAE made the features
    cubes: Float[np.ndarray, "S 100 2 7"] | None = None
    touched: Bool[np.ndarray, "S 100 2"] | None = None

    def split(self, name: str) -> Int[np.ndarray, " M"]:
        """Sample numbers of `train` (648), `test` (216), `held_out` or `fit`.

        `held_out` is 18 training patterns (108 samples) on which settings and stopping are
        chosen; `fit` is the rest of the training samples.
        """
        if name not in SPLITS:
            raise ConfigError(f"no split {name!r}; there are {', '.join(SPLITS)}")
        return np.flatnonzero(np.isin(self.pattern, SPLITS[name]))


def _splits() -> dict[str, tuple[int, ...]]:
    """Pattern indices by split; held out is one training pattern of every second meaning."""
    of = {name: tuple(p.index for p in patterns() if p.split == name) for name in ("train", "test")}
    meanings: dict = {}
    for p in patterns():
        if p.split == "train":
            meanings.setdefault(p.meaning, []).append(p.index)
    every_second = list(meanings.values())[::2]
    held_out = tuple(group[i % 3] for i, group in enumerate(every_second))
    fit = tuple(i for i in of["train"] if i not in held_out)
    return of | {"held_out": held_out, "fit": fit}


SPLITS = _splits()


@dataclass(frozen=True)
class Scaling:
    """The fixed linear maps in front of a model, and back.

    Joints: each by its own range over the training samples, to +-0.9. Features: minus their mean,
    then a matrix that whitens them (principal components, each brought to the same spread).
    Colour is a small signal on a large arm motion; without whitening it takes four times as long
    to learn. Ours; the published code scales all features by one range.
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


def fit_scaling(samples: Samples, indices, exponent: float = 0.5) -> Scaling:
    """Fit a `Scaling` on the valid frames of the samples `indices`.

    Each principal component is divided by its variance to the power `exponent`: 0.5 whitens, 0
    only rotates, 0.25 is half-way.
    """
    valid = np.arange(MAX_FRAMES) < samples.frames[indices, None]
    joints = samples.joints[indices][valid].astype(float)
    features = samples.features[indices][valid].astype(float)
    mean = features.mean(0)
    variances, axes = np.linalg.eigh(np.cov(features - mean, rowvar=False))
    variances = np.maximum(variances, 1e-9 * variances.max())
    feature_map = axes * variances**-exponent
    spread = ((features - mean) @ feature_map).std(0)
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
    return Dataset(
        samples,
        scaling,
        (scaling.joints(samples.joints) * mask).astype(np.float32),
        (scaling.features(samples.features) * mask).astype(np.float32),
    )


def load(data="recording") -> Samples:
    """All 864 samples: of the stored recording, or of a folder that `record` made.

    Raises:
        ArtefactError: a stored file is missing or damaged, or the features are another CAE's.
        RecordingError: the folder is no recording of ours, or arrays disagree in length.
    """
    if str(data) == "recording":
        arrays, eye = artefacts.stored("recording/samples.npz"), None
        feature_file = artefacts.stored("recording/features.npz")
        eye = artefacts.manifest()["weights/cae.safetensors"]["sha256"]
    else:
        from ptae_lite.robot.recorder import check_ours

        check_ours(data, same_scene=False)
        arrays, eye, feature_file = Path(data) / "samples.npz", None, Path(data) / "features.npz"
        for path, command in ((arrays, "record"), (feature_file, "features")):
            if not path.is_file():
                raise RecordingError(
                    f"{path} is missing; make it with: python -m ptae_lite {command}"
                )
    return _assemble(_read(arrays), _read(feature_file), data, eye)


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is damaged ({error}); make it again") from None


def _assemble(arrays: dict, features: dict, data, expected_eye: str | None) -> Samples:
    frames, total = arrays["frames"].astype(int), len(features["features"])
    for name in ("joints_rad", "cubes", "touched"):
        if len(arrays[name]) != frames.sum():
            raise RecordingError(
                f"{data}: {name} has {len(arrays[name])} frames, "
                f"the clip lengths add up to {frames.sum()}; record again"
            )
    if total != frames.sum():
        raise RecordingError(
            f"{data}: {total} frames of features for {frames.sum()} frames of joints; "
            "make the features again: python -m ptae_lite features"
        )
    eye = str(features["eye"])
    if expected_eye is not None and eye != expected_eye:
        raise ArtefactError(
            f"{data}: the features were made by the CAE {eye[:12]}, the stored CAE is "
            f"{expected_eye[:12]}; make them again: python -m ptae_lite features"
        )
    for index, length in zip(arrays["pattern"], frames, strict=True):
        if patterns()[index].frames != length:
            raise RecordingError(
                f"{data}: a sample of pattern {index} has {length} frames, "
                f"not {patterns()[index].frames}; record again"
            )
    return Samples(
        joints=_pad(arrays["joints_rad"], frames),
        features=_pad(features["features"].astype(np.float32), frames),
        frames=frames,
        pattern=arrays["pattern"].astype(int),
        variation=arrays["variation"].astype(int),
        eye=eye,
        cubes=_pad(arrays["cubes"], frames),
        touched=_pad(arrays["touched"], frames),
    )


def _pad(rows: np.ndarray, frames: np.ndarray) -> np.ndarray:
    padded = np.zeros((len(frames), MAX_FRAMES, *rows.shape[1:]), dtype=rows.dtype)
    padded[np.arange(MAX_FRAMES) < frames[:, None]] = rows
    return padded


def write_features(path, features: list[np.ndarray], eye_file) -> None:
    """Store features (an array for each sample, in order) with the hash of the CAE behind them.

    Half precision: it changes no feature by more than 0.05 % and halves the file.
    """
    eye = hashlib.sha256(Path(eye_file).read_bytes()).hexdigest()
    np.savez_compressed(
        path, features=np.concatenate(features).astype(np.float16), eye=np.array(eye)
    )

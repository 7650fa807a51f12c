"""The 864 samples as arrays: load and check.

`load_samples` reads a recording of ours or the authors' published folder into `Samples`. These are
raw numbers, padded with zeros to 100 frames. `scaling` then brings them to the units of a network.
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Bool, Float, Int

from ptae_lite import artefacts
from ptae_lite.data import authors
from ptae_lite.data.splits import patterns_of
from ptae_lite.errors import ArtefactError, ConfigError, RecordingError
from ptae_lite.files import write_arrays
from ptae_lite.language import patterns

MAX_FRAMES = 100
AUTHORS = "authors"  # the encoder of the published features; its weights are not public


@dataclass(frozen=True)
class Samples:
    """All S samples of a data set, raw, padded with zeros to T = 100 frames.

    Attributes:
        joints: radians in our recording; 0 to 1 in the authors' data.
        features: what the image encoder makes of each frame.
        frames: clip lengths, 50 or 100.
        pattern: pattern indices, 0 to 143.
        variation: 0 to 5.
        encoder: which encoder made the features: the hash of its weights, or `authors`.
        cubes: poses of the two cubes: position in metres, quaternion; None in the authors' data.
        touched: whether the arm touched each cube; None in the authors' data.
        holdout: number of training patterns that replace a missing test part; None if there is one.
    """

    joints: Float[np.ndarray, "S 100 5"]
    features: Float[np.ndarray, "S 100 F"]
    frames: Int[np.ndarray, " S"]
    pattern: Int[np.ndarray, " S"]
    variation: Int[np.ndarray, " S"]
    encoder: str
    cubes: Float[np.ndarray, "S 100 2 7"] | None = None
    touched: Bool[np.ndarray, "S 100 2"] | None = None
    holdout: int | None = None

    def split(self, name: str) -> Int[np.ndarray, " M"]:
        """Sample numbers of a split: `train` (648), `test` (216), `held_out` (96) or `fit` (552).

        Settings and the time to stop are chosen on `held_out`, 16 of the training patterns; `fit`
        is the rest of the training samples. With `holdout`, `test` is that many training patterns
        (`splits.holdout_patterns`), and the other splits lose them.

        Raises:
            ConfigError: there is no such split.
        """
        return np.flatnonzero(np.isin(self.pattern, patterns_of(name, self.holdout)))

    @property
    def name(self) -> str:
        """What tables call this data set; it says if training patterns replace the test part."""
        if self.encoder != AUTHORS:
            return "recording"
        return AUTHORS if self.holdout is None else f"{AUTHORS}, {self.holdout} held out"

    @cached_property
    def fingerprint(self) -> str:
        """The name, and a SHA-256 of everything that a training sees.

        It is a hash of the numbers, not of a file.
        """
        digest = hashlib.sha256()
        for array in (self.joints, self.features, self.frames, self.pattern, self.variation):
            little = array.astype("<f4")  # exact for small whole numbers
            digest.update(str(little.shape).encode() + little.tobytes())
        return f"{self.name} {digest.hexdigest()}"


def load_samples(data="recording", holdout: int | None = None) -> Samples:
    """All samples of the stored recording, of a recorded folder, or of the authors' folder.

    Args:
        data: `recording` for the stored one, else a folder.
        holdout: for an authors' folder without its test part, see `load_authors`.

    Raises:
        ArtefactError: a stored file is missing or damaged, or another CAE made the features.
        RecordingError: the folder is not a recording of ours, or its arrays disagree in length, or
            a file of the authors' folder is wrong.
        ConfigError: `holdout` is given for data that have a test part.
    """
    if authors.is_authors(data):
        return load_authors(data, holdout)
    if holdout is not None:
        raise ConfigError(f"{data} has a test part of its own; leave --holdout out")
    if str(data) == "recording":
        return load_stored()
    arrays = _recorded(data, "samples.npz", "record")
    return _assemble(arrays, _recorded(data, "features.npz", "features"), data, None)


def load_unseen(recording) -> Samples:
    """The samples of a folder that `record` made, before an encoder has made features: F is 0.

    Raises:
        RecordingError: the folder is not a recording of ours, or its arrays disagree in length.
    """
    arrays = _recorded(recording, "samples.npz", "record")
    unseen = {"features": np.zeros((len(arrays.get("joints_rad", ())), 0)), "encoder": "none"}
    return _assemble(arrays, unseen, recording, None)


def _recorded(folder, name: str, command: str) -> dict[str, np.ndarray]:
    """Read the file `name` of a recording's folder. `command` makes that file."""
    from ptae_lite.robot.recorder import check_ours

    check_ours(folder, same_scene=False)
    path = Path(folder) / name
    if not path.is_file():
        raise RecordingError(f"{path} is missing; make it with: python -m ptae_lite {command}")
    return _read(path)


def load_stored(data: Path | None = None) -> Samples:
    """The samples of the stored recording.

    Args:
        data: a folder of stored files to use instead of `data/`.

    Raises:
        ArtefactError: a file is missing or damaged, or another CAE made the features.
        RecordingError: arrays disagree in length.
    """
    arrays = artefacts.stored("recording/samples.npz", data)
    feature_file = artefacts.stored("recording/features.npz", data)
    encoder = artefacts.entry_of("weights/cae.safetensors", data)["sha256"]
    return _assemble(_read(arrays), _read(feature_file), data or "recording", encoder)


def load_authors(folder, holdout: int | None = None) -> Samples:
    """The authors' published samples, checked: 864, or the 648 of the training part.

    Joints have no physical unit: the authors scaled each joint to 0 to 1 over the whole data set.
    So the range that NRMSE divides by is 1. There are no cube poses and no contacts.

    Args:
        folder: holds `target/` and the index files; see `authors`.
        holdout: number of training patterns to keep aside as the test part, if the folder has none.
            Scores on them are never scores on the paper's test set.

    Raises:
        RecordingError: a file is missing or wrong (the message names file and line), or the folder
            has no test part and `holdout` is not given.
        ConfigError: `holdout` is given for a folder with a test part, or is not 1 to 36.
    """
    complete = "test" in authors.parts(folder)
    if complete and holdout is not None:
        raise ConfigError(f"{folder} has the paper's test part; leave --holdout out")
    if not complete and holdout is None:
        raise RecordingError(
            f"{folder} has no test part (target/behavior_test and so on); `train` and `evaluate` "
            "keep N of its training patterns aside with --holdout N"
        )
    patterns_of("test", holdout)  # refuse a wrong number before reading
    found = authors.read(folder)
    return Samples(
        joints=_pad(found.joints, found.frames),
        features=_pad(found.features, found.frames),
        frames=found.frames,
        pattern=found.pattern,
        variation=found.variation,
        encoder=AUTHORS,
        holdout=holdout,
    )


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is damaged ({error}); make it again") from None


PER_FRAME = ("joints_rad", "cubes", "touched")
PER_SAMPLE = ("frames", "pattern", "variation")


def _assemble(arrays: dict, features: dict, data, expected_encoder: str | None) -> Samples:
    missing = [name for name in (*PER_FRAME, *PER_SAMPLE) if name not in arrays]
    missing += [name for name in ("features", "encoder") if name not in features]
    if missing:
        raise RecordingError(f"{data}: no array {missing[0]!r}, so it is no recording of ours")
    for name in PER_SAMPLE:
        if len(arrays[name]) != len(arrays["frames"]):
            raise RecordingError(
                f"{data}: {name} is given for {len(arrays[name])} samples, "
                f"the clip length for {len(arrays['frames'])}; record again"
            )
    frames, total = arrays["frames"].astype(int), len(features["features"])
    for name in PER_FRAME:
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
    for name, values in (("joints_rad", arrays["joints_rad"]), ("features", features["features"])):
        wrong = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(wrong):
            sample = int(np.searchsorted(frames.cumsum(), wrong[0], side="right"))
            raise RecordingError(
                f"{data}: {name} of sample {sample} (pattern {arrays['pattern'][sample]}) are not "
                "all finite numbers; record again, and make the features again"
            )
    encoder = str(features["encoder"])
    if expected_encoder is not None and encoder != expected_encoder:
        raise ArtefactError(
            f"{data}: the features were made by the CAE {encoder[:12]}, the stored CAE is "
            f"{expected_encoder[:12]}; make them again: python -m ptae_lite features"
        )
    for index, length in zip(arrays["pattern"], frames, strict=True):
        if not 0 <= index < len(patterns()):
            raise RecordingError(
                f"{data}: pattern {index} does not exist; patterns are 0 to {len(patterns()) - 1}; "
                "record again"
            )
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
        encoder=encoder,
        cubes=_pad(arrays["cubes"], frames),
        touched=_pad(arrays["touched"], frames),
    )


def with_features(samples: Samples, path) -> Samples:
    """The same samples with the features of another encoder.

    Args:
        path: a file that `write_features` wrote.

    Raises:
        RecordingError: the file is missing or damaged, or holds another number of frames.
    """
    found = _read(Path(path))
    missing = [name for name in ("features", "encoder") if name not in found]
    total = int(samples.frames.sum())
    if missing or len(found["features"]) != total:
        raise RecordingError(f"{path} does not hold features of {total} frames; make it again")
    features = _pad(found["features"].astype(np.float32), samples.frames)
    return replace(samples, features=features, encoder=str(found["encoder"]))


def _pad(rows: np.ndarray, frames: np.ndarray) -> np.ndarray:
    filled = np.zeros((len(frames), MAX_FRAMES, *rows.shape[1:]), dtype=rows.dtype)
    filled[np.arange(MAX_FRAMES) < frames[:, None]] = rows
    return filled


def write_features(path, features: np.ndarray, encoder_file) -> None:
    """Store the features (M, F) of all frames, sample after sample, with the hash of their encoder.

    Half precision halves the file and changes no feature by more than 0.05 %.

    Args:
        encoder_file: the weights of the encoder.

    Raises:
        FileError: the file cannot be written.
    """
    encoder = hashlib.sha256(Path(encoder_file).read_bytes()).hexdigest()
    write_arrays(path, features=features.astype(np.float16), encoder=np.array(encoder))

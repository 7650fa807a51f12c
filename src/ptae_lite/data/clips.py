"""Corrected clips: what a planner did that was disturbed, and where it wanted to go.

A clip has the features of its images, not the images. `experiments.corrections` records them.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Bool, Float, Int

from ptae_lite.errors import RecordingError
from ptae_lite.files import write_arrays

FORMAT = "ptae-lite corrected clips 1"
CLIPS = "clips.npz"  # all of them, in the folder of a recording that is complete
OF_FRAMES = ("features", "joints_rad", "goal_m", "cubes")  # the rest has one number a clip


@dataclass(frozen=True)
class Clips:
    """C corrected clips, one after the other, of M frames in all.

    Frame t of all arrays is the same instant.

    Attributes:
        sample: the number of the sample of the recording in whose pattern a clip was made.
        pattern: pattern indices, 0 to 143.
        kind: which cubes were moved: `named`, `other`, `both` or `none`.
        event: the frame from which they were elsewhere; -1 if none was moved.
        pushed: the frame in which a push of the hand began; -1 if there was none.
        success: whether the planner did what was asked.
        seed: of the clip's motion.
        frames: how long each clip is.
        features: what the image encoder makes of each frame.
        joints_rad: measured joints.
        goal_m: where the planner, at this frame, wanted the fingertips to be in the next.
        cubes: poses of the left and the right cube: position in metres, quaternion x y z w.
    """

    sample: Int[np.ndarray, " C"]
    pattern: Int[np.ndarray, " C"]
    kind: np.ndarray
    event: Int[np.ndarray, " C"]
    pushed: Int[np.ndarray, " C"]
    success: Bool[np.ndarray, " C"]
    seed: Int[np.ndarray, " C"]
    frames: Int[np.ndarray, " C"]
    features: Float[np.ndarray, "M F"]
    joints_rad: Float[np.ndarray, "M 5"]
    goal_m: Float[np.ndarray, "M 3"]
    cubes: Float[np.ndarray, "M 2 7"]

    def __len__(self) -> int:
        return len(self.frames)

    def of(self, samples: Int[np.ndarray, " K"]) -> Clips:
        """The clips that were made for some samples, such as those of a split."""
        return self.where(np.isin(self.sample, samples))

    def where(self, chosen: Bool[np.ndarray, " C"]) -> Clips:
        """Some of the clips."""
        inside = np.repeat(chosen, self.frames)
        return replace(self, **{
            one.name: getattr(self, one.name)[inside if one.name in OF_FRAMES else chosen]
            for one in fields(self)
        })  # fmt: skip

    def stacked(self, name: str) -> np.ndarray:
        """An array of frames as (C, T, ...), with zeros after the end of a clip."""
        values = getattr(self, name)
        made = np.zeros((len(self), self.frames.max(initial=0), *values.shape[1:]), values.dtype)
        made[np.arange(made.shape[1]) < self.frames[:, None]] = values
        return made


def join(parts: list[Clips]) -> Clips:
    """The clips of several in one.

    Raises:
        RecordingError: there are none.
    """
    if not parts:
        raise RecordingError("there are no clips to join")
    return Clips(**{
        one.name: np.concatenate([getattr(part, one.name) for part in parts])
        for one in fields(Clips)
    })  # fmt: skip


def write_clips(path, clips: Clips) -> None:
    """Write clips into one file, whole or not at all."""
    write_arrays(path, **vars(clips))


def read_clips(path) -> Clips:
    """Read the clips of one file.

    Raises:
        RecordingError: it is missing or damaged.
    """
    path = Path(path)
    if not path.is_file():
        raise RecordingError(f"{path} is missing; record with: python -m ptae_lite corrections")
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            clips = Clips(**{name: file[name] for name in file.files})
    except (OSError, ValueError, TypeError, EOFError, KeyError, BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is damaged ({error}); delete it and record again") from None
    frames = int(clips.frames.sum())
    if any(len(getattr(clips, name)) != frames for name in OF_FRAMES):
        raise RecordingError(f"{path}: its arrays differ in length; delete it and record again")
    return clips


def load_clips(folder) -> Clips:
    """All clips of a folder: of `clips.npz`, or those that are there while it is being recorded.

    Raises:
        RecordingError: there are none, or a file is damaged.
    """
    folder = Path(folder)
    if (folder / CLIPS).is_file():
        return read_clips(folder / CLIPS)
    paths = sorted(folder.glob("clips/*.npz"))
    if not paths:
        raise RecordingError(
            f"{folder} has no corrected clips; record with: python -m ptae_lite corrections"
        )
    return join([read_clips(path) for path in paths])

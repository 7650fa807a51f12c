"""Clips from which a watching policy learns: recorded ones, and ones in which the planner corrects.

A recorded clip says where the hand went. A corrected clip also says where the planner wanted it to
go, from the state in which it was: without the noise and the pushes that the arm was driven with.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from ptae_lite.data.samples import Samples
from ptae_lite.language import SIDES, patterns
from ptae_lite.robot import arm

REST = 10  # frames at home after a clip, so that the end of a motion is learned, too


@dataclass(frozen=True)
class Clips:
    """C clips, each continued with its last frame up to T frames.

    Attributes:
        features: of the images, raw.
        joints_rad: measured joints.
        goal_m: where the hand is to be in the next frame.
        places_m: x and y of the left and the right cube.
        touch: the frame in which the arm first touches the named cube.
        frames: lengths without the continuation.
        pattern: what is done, where, and how fast: pattern indices.
    """

    features: Float[np.ndarray, "C T F"]
    joints_rad: Float[np.ndarray, "C T 5"]
    goal_m: Float[np.ndarray, "C T 3"]
    places_m: Float[np.ndarray, "C T 2 2"]
    touch: Int[np.ndarray, " C"]
    frames: Int[np.ndarray, " C"]
    pattern: Int[np.ndarray, " C"]

    def __len__(self) -> int:
        return len(self.frames)

    def take(self, which) -> Clips:
        """Some of the clips."""
        return Clips(**{field.name: getattr(self, field.name)[which] for field in fields(self)})

    @property
    def side(self) -> Int[np.ndarray, " C"]:
        """The side of the named cube, 0 or 1."""
        return np.array([SIDES.index(patterns()[i].side) for i in self.pattern], dtype=int)

    @property
    def before_touch(self) -> Bool[np.ndarray, "C T"]:
        """The frames in which the named cube stands free."""
        return np.arange(self.features.shape[1]) < self.touch[:, None]

    @property
    def remembered_m(self) -> Float[np.ndarray, "C T 2"]:
        """Where the named cube is, and after the touch where it was then."""
        clip, count = np.arange(len(self)), self.features.shape[1]
        frame = np.minimum(np.arange(count), (self.touch - 1)[:, None].clip(0))
        return self.places_m[clip[:, None], frame, self.side[:, None]]


def joined(parts: list[Clips]) -> Clips:
    """All clips of several collections."""
    return Clips(**{
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Clips)
    })  # fmt: skip


def recorded(samples: Samples, indices) -> Clips:
    """Recorded samples as clips: the hand is to go where it went."""
    frames = samples.frames[indices]
    at = np.minimum(np.arange(samples.joints.shape[1] + REST), frames[:, None] - 1)
    clip = np.asarray(indices)[:, None]
    joints = samples.joints[clip, at]
    hand = arm.fingertip(joints.reshape(-1, joints.shape[2])).reshape(*at.shape, 3)
    side = np.array([SIDES.index(patterns()[i].side) for i in samples.pattern[indices]])
    touched = samples.touched[clip, at, side[:, None]]
    return Clips(
        features=samples.features[clip, at], joints_rad=joints,
        goal_m=np.concatenate([hand[:, 1:], hand[:, -1:]], axis=1),
        places_m=samples.cubes[clip, at, :, :2], touch=touched.argmax(1), frames=frames,
        pattern=samples.pattern[indices],
    )  # fmt: skip

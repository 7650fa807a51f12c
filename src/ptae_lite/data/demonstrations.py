"""What a watching policy learns from: recorded clips, and clips in which the planner corrects.

A recorded clip says where the hand went. A corrected clip also says where the planner wanted it to
go, from the state in which it was: without the noise and the pushes that the arm was driven with.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from ptae_lite.data.clips import Clips
from ptae_lite.data.samples import Samples
from ptae_lite.language import SIDES, patterns
from ptae_lite.robot import arm

LONGEST = 130  # frames of a clip: an episode has no more
REST = 10  # frames at home after it, so that the end of a motion is learned, too
TOUCHED_M = 0.001  # a cube that has moved so far has been touched


@dataclass(frozen=True)
class Demonstrations:
    """C clips, each continued with its last frame up to T frames of one length for all.

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

    def take(self, which) -> Demonstrations:
        """Some of the clips."""
        return Demonstrations(
            **{field.name: getattr(self, field.name)[which] for field in fields(self)}
        )

    @property
    def side(self) -> Int[np.ndarray, " C"]:
        """The side of the named cube, 0 or 1."""
        return _sides(self.pattern)

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


def joined(parts: list[Demonstrations]) -> Demonstrations:
    """All clips of several collections."""
    return Demonstrations(**{
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Demonstrations)
    })  # fmt: skip


def recorded(samples: Samples, indices) -> Demonstrations:
    """Recorded samples: the hand is to go where it went."""
    frames = samples.frames[indices]
    clip, at = np.asarray(indices)[:, None], _held(frames)
    joints, shown = samples.joints[clip, at], samples.pattern[indices]
    hand = arm.fingertip(joints.reshape(-1, joints.shape[2])).reshape(*at.shape, 3)
    touched = samples.touched[clip, at, _sides(shown)[:, None]]
    return Demonstrations(
        features=samples.features[clip, at], joints_rad=joints,
        goal_m=np.concatenate([hand[:, 1:], hand[:, -1:]], axis=1),
        places_m=samples.cubes[clip, at, :, :2], touch=touched.argmax(1), frames=frames,
        pattern=shown,
    )  # fmt: skip


def corrected(clips: Clips) -> Demonstrations:
    """Corrected clips: the hand is to go where the planner wanted it. Failures are left out."""
    clips = clips.where(clips.success)
    clip, at = np.arange(len(clips))[:, None], _held(clips.frames)
    row = (clips.frames.cumsum() - clips.frames)[:, None] + at  # the clips lie one after the other
    places = clips.cubes[row, :, :2]
    named = places[clip[:, 0], :, _sides(clips.pattern)]
    # from the frame of the disturbance on, the named cube is where it is until the arm moves it
    stands = named[clip[:, 0], np.maximum(clips.event, 0)][:, None]
    away = np.linalg.norm(named - stands, axis=2) > TOUCHED_M
    away &= np.arange(at.shape[1]) > clips.event[:, None]
    return Demonstrations(
        features=clips.features[row], joints_rad=clips.joints_rad[row], goal_m=clips.goal_m[row],
        places_m=places, touch=away.argmax(1), frames=clips.frames, pattern=clips.pattern,
    )  # fmt: skip


def _held(frames: Int[np.ndarray, " C"]) -> Int[np.ndarray, "C T"]:
    """Which frame to take for each of T frames: a clip's own ones, then its last one again."""
    return np.minimum(np.arange(LONGEST + REST), frames[:, None] - 1)


def _sides(pattern) -> Int[np.ndarray, " C"]:
    return np.array([SIDES.index(patterns()[i].side) for i in pattern], dtype=int)

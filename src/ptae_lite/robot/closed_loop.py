"""Acting in the simulated scene frame by frame, and judging whether the task was done.

A policy may look through the camera. It is given the measured joints and answers with the next
target of the joints. The motors drive the arm there through physics, the arm moves the cubes that
it touches, and the next image shows the result.

The policy is not told how long to act. An episode ends when the arm has left home, has come back
and has rested there, or after `LIMIT` frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ptae_lite.errors import RobotError
from ptae_lite.language import SIDES
from ptae_lite.robot import inverse, motions
from ptae_lite.robot.disturbances import Disturbance, Happening
from ptae_lite.robot.scene import NOMINAL_PLACES_M, TABLE_TOP_M, Scene

LIMIT = 130  # frames; the slow motion takes 100
AWAY_RAD, HOME_RAD = 0.2, 0.08  # the largest joint difference from home
AT_REST = 3  # frames at home in a row
SLOW_FROM = 75  # frames: in the middle between the fast motion's 50 and the slow one's 100
TRAVEL_MM, OTHER_MM = 40.0, 10.0  # what the named cube must do, and the other must not
DONE = "done"
WRONG = {  # what can go wrong; of several, the first is the reason
    "joint": "a joint at its limit",
    "other": "the other cube was moved",
    "travel": "the cube went too little that way",
    "home": "it did not come home",
    "speed": "the wrong speed",
    "fell": "the cube fell off the table",
}

Look = Callable[[], np.ndarray]  # the camera's image now, (120, 160, 3) uint8
Act = Callable[[Look, np.ndarray], np.ndarray]


class Setting(NamedTuple):
    """A scene to act in.

    Args:
        colours: of the left and the right cube.
        places_m: (2, 2) x and y of the two cubes.
        yaws_rad: (2,) rotation of the cubes about the vertical.
    """

    colours: tuple[str, str]
    places_m: np.ndarray = np.array(NOMINAL_PLACES_M)
    yaws_rad: np.ndarray = np.zeros(2)


class Episode(NamedTuple):
    """What happened in T frames. Frame 0 is the scene before the first action.

    Args:
        joints_rad: measured joints.
        cubes: poses of the left and the right cube: position in metres, quaternion x y z w.
        stopped: why it ended: `home` (the arm came back), `limit` (too many frames) or `joint` (a
            target was outside a joint's limits).
        event: the frame from which cubes were moved or the hand was pushed; -1 if this did not
            happen.
        shift_m: (2, 2) how far a disturbance, not the arm, moved the two cubes along x and y.
    """

    joints_rad: Float[np.ndarray, "T 5"]
    cubes: Float[np.ndarray, "T 2 7"]
    stopped: str
    event: int = -1
    shift_m: np.ndarray = np.zeros((2, 2))

    @property
    def moved_mm(self) -> Float[np.ndarray, "2 2"]:
        """How far the arm moved the two cubes along x and y."""
        return 1000 * (self.cubes[-1, :, :2] - self.cubes[0, :, :2] - self.shift_m)


class Verdict(NamedTuple):
    """Whether the arm did what the sentence said.

    Args:
        success: the right cube went the right way, far enough, at the right speed.
        reason: `done`, or the first thing that went wrong.
        named_mm: how far the named cube moved in the commanded direction.
        other_mm: how far the other cube moved in any direction.
        frames: length of the episode.
    """

    success: bool
    reason: str
    named_mm: float
    other_mm: float
    frames: int


def stage_of(pattern, variation: int) -> Setting:
    """The scene of a recorded sample."""
    drawn = motions.draw(motions.sample_seed(pattern.index, variation))
    return Setting((pattern.left, pattern.right), drawn.places_m, drawn.yaws_rad)


def perform(
    stage: Setting, act: Act, limit: int | None = None, disturbance: Disturbance | None = None
) -> Episode:
    """Run an episode: `act(look, joints_rad)` moves the arm in a fresh scene.

    A planner that knows where the cubes are has a method `see`. It is called before each action,
    with the poses of the cubes (2, 7).

    Args:
        act: a policy. It is called once a frame with `look`, which makes the camera's image, and
            the measured joints (5,). It returns the next target of the joints (5,), in radians. An
            image takes most of a frame's time, so it is made only if `look` is called.
        limit: the largest number of frames; `LIMIT` if None.
        disturbance: what happens meanwhile; nothing if None.
    """
    see = getattr(act, "see", None)
    joints, cubes, stopped, rest, left = [], [], "limit", 0, False
    limit = limit or LIMIT
    with Scene(*stage) as world:
        happening = Happening(disturbance or Disturbance(), world)
        for frame in range(limit):
            happening.begin(frame)
            joints.append(world.joints_rad())
            cubes.append(world.cubes())
            off = np.abs(joints[-1] - inverse.home_rad()).max()
            left = left or off > AWAY_RAD
            rest = rest + 1 if left and off < HOME_RAD else 0
            if rest == AT_REST:
                stopped = "home"
                break
            if frame == limit - 1:
                break
            if see is not None:
                see(cubes[-1])
            wish = act(world.image, joints[-1])
            try:
                world.drive(happening.driven(frame, wish))
            except RobotError:
                stopped = "joint"
                break
    return Episode(np.array(joints), np.array(cubes), stopped, happening.event, happening.shift_m)


def replay(joints_rad: Float[np.ndarray, "T 5"]) -> Act:
    """A policy that follows recorded joints and never looks. At the end it holds the last pose."""
    rows = iter(joints_rad[1:])
    last = joints_rad[-1]
    return lambda look, joints_rad: next(rows, last)


def judge(episode: Episode, action: str, side: str, speed: str) -> Verdict:
    """Judge an episode by the command.

    Moved distances are those between the first and the last frame; where a disturbance moves a cube
    they begin at its new place. The reason is the first of
    `WRONG` that applies. A cube that falls off the table has moved far enough, so this has a reason
    of its own.
    """
    moved_mm = episode.moved_mm
    named = SIDES.index(side)
    along = float(moved_mm[named] @ np.array(motions.DIRECTION[action]))
    other = float(np.linalg.norm(moved_mm[1 - named]))
    frames = len(episode.joints_rad)
    wrong = {
        "joint": episode.stopped == "joint",
        "other": other >= OTHER_MM,
        "travel": along < TRAVEL_MM,
        "home": episode.stopped == "limit",
        "speed": (frames >= SLOW_FROM) != (speed == "slowly"),
        "fell": bool(episode.cubes[-1, named, 2] < TABLE_TOP_M),
    }
    reason = next((text for name, text in WRONG.items() if wrong[name]), DONE)
    return Verdict(reason == DONE, reason, along, other, frames)

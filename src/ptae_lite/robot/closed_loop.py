"""Acting in the simulated scene, frame by frame, and whether the cube went where it was to go.

Whoever acts may look through the camera, gets the measured joints, and answers with the joints to
go to. The motors do it through physics, cubes move when touched, and the next look shows what came
of it.

Nobody says how long to act. An episode ends when the arm has been away and has come to rest at home
again, or after `LIMIT` frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ptae_lite.errors import RobotError
from ptae_lite.language import SIDES
from ptae_lite.robot import inverse, motions
from ptae_lite.robot.scene import NOMINAL_PLACES_M, TABLE_TOP_M, Scene

LIMIT = 130  # frames; the slow motion takes 100
AWAY_RAD, HOME_RAD = 0.2, 0.08  # the largest joint difference from home
AT_REST = 3  # frames at home in a row
SLOW_FROM = 75  # frames: in the middle between the fast motion's 50 and the slow one's 100
TRAVEL_MM, OTHER_MM = 40.0, 10.0  # what the named cube must do, and the other must not

Look = Callable[[], np.ndarray]  # the camera's image now, (120, 160, 3) uint8
Act = Callable[[Look, np.ndarray], np.ndarray]


class Setting(NamedTuple):
    """A scene to act in."""

    colours: tuple[str, str]  # of the left and the right cube
    places_m: np.ndarray = np.array(NOMINAL_PLACES_M)  # (2, 2) x and y
    yaws_rad: np.ndarray = np.zeros(2)


class Episode(NamedTuple):
    """What happened, T frames; the first is the scene as it was found."""

    joints_rad: Float[np.ndarray, "T 5"]
    cubes: Float[np.ndarray, "T 2 7"]
    stopped: str  # `home`, `limit` (too long) or `joint` (it wanted past a joint's limit)


class Verdict(NamedTuple):
    """Was the sentence carried out? The right cube, way, distance and time make a success."""

    success: bool
    reason: str  # `done`, or the first thing that went wrong
    named_mm: float  # how far the named cube went in the commanded direction
    other_mm: float  # how far the other one went, anywhere
    frames: int


def stage_of(pattern, variation: int) -> Setting:
    """The scene of a recorded sample."""
    drawn = motions.draw(motions.sample_seed(pattern.index, variation))
    return Setting((pattern.left, pattern.right), drawn.places_m, drawn.yaws_rad)


def perform(stage: Setting, act: Act, limit: int | None = None) -> Episode:
    """Let `act(look, joints_rad)` move the arm in a fresh scene until it is done.

    An image takes most of a frame's time to compute, so it is made only for one who looks.
    """
    joints, cubes, stopped, rest, left = [], [], "limit", 0, False
    limit = limit or LIMIT
    with Scene(*stage) as world:
        for frame in range(limit):
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
            wish = act(world.image, joints[-1])
            try:
                world.drive(wish)
            except RobotError:
                stopped = "joint"
                break
    return Episode(np.array(joints), np.array(cubes), stopped)


def replay(joints_rad: Float[np.ndarray, "T 5"]) -> Act:
    """Acts out recorded joints and looks at nothing; then it stays where it is."""
    rows = iter(joints_rad[1:])
    last = joints_rad[-1]
    return lambda look, joints_rad: next(rows, last)


def judge(episode: Episode, action: str, side: str, speed: str) -> Verdict:
    """Hold an episode against what was asked for; positions are those at its end.

    The reason is the first that holds of those below. A cube that falls off the table goes far, so
    it needs one of its own.
    """
    moved_mm = 1000 * (episode.cubes[-1, :, :2] - episode.cubes[0, :, :2])
    named = SIDES.index(side)
    along = float(moved_mm[named] @ np.array(motions.DIRECTION[action]))
    other = float(np.linalg.norm(moved_mm[1 - named]))
    frames = len(episode.joints_rad)
    wrong = {
        "a joint at its limit": episode.stopped == "joint",
        "the other cube was moved": other >= OTHER_MM,
        "the cube went too little that way": along < TRAVEL_MM,
        "it did not come home": episode.stopped == "limit",
        "the wrong speed": (frames >= SLOW_FROM) != (speed == "slowly"),
        "the cube fell off the table": bool(episode.cubes[-1, named, 2] < TABLE_TOP_M),
    }
    reason = next((name for name, so in wrong.items() if so), "done")
    return Verdict(reason == "done", reason, along, other, frames)

"""What happens to an episode from outside: cubes are moved, the hand is pushed, things are changed.

A `Disturbance` says it, and `closed_loop.perform` lets it happen. Whoever acts is not told of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from ptae_lite.errors import RobotError
from ptae_lite.language import SIDES, Pattern
from ptae_lite.robot import arm, inverse, motions
from ptae_lite.robot.motions import DIRECTION, STANDOFF_M, Variation, ease
from ptae_lite.robot.scene import CUBE_EDGE_M, TABLE_TOP_M, Scene

LOW_M = 0.030  # the hand has come down: fingertips so far above the table at most
CUBES_APART_M = 0.100  # between the centres
OF_MIDDLE_M = 0.075  # a cube is at most so far from the middle of the near table, in x
MIDDLE_X_M = 0.40
CLEAR_M = 0.006  # between the other cube and the way of the hand and of the named cube
CUBE_RADIUS_M = CUBE_EDGE_M / 2**0.5
TILT_RAD = 0.3  # of a push
FROM_HOME_M = 0.050  # a hand that is pushed home has ended the episode
TRIES = 200


@dataclass(frozen=True)
class Disturbance:
    """What happens, and when. Nothing happens by default.

    The cubes are moved, or the push begins, before the first frame in which all that is given of
    `frame`, `away_m` and `low` holds. A push is stronger than the motors: while it lasts, the hand
    goes where it is pushed, whatever the policy wishes.

    Attributes:
        frame: not before this frame.
        away_m: not before the fingertips are so far from where they are at home.
        low: not before the hand has come down to the table.
        places_m: (2, 2) x and y of where the two cubes are put.
        push_m: (3,) how far the hand is driven from where it is.
        push_frames: in how many frames it is driven there.
        held_frames: for how many more frames it is held there.
        friction: of the cubes, as a share of the usual one, in the whole episode.
        mass: of the cubes, likewise.
        light: its brightness, likewise.
    """

    frame: int = 0
    away_m: float = 0.0
    low: bool = False
    places_m: Float[np.ndarray, "2 2"] | None = None
    push_m: Float[np.ndarray, " 3"] | None = None
    push_frames: int = 0
    held_frames: int = 0
    friction: float = 1.0
    mass: float = 1.0
    light: float = 1.0


class Happening:
    """A disturbance in one episode.

    `event` is the frame in which the cubes were moved, or the push began; -1 before it. `shift_m`
    (2, 2) is how far it moved the two cubes.
    """

    def __init__(self, disturbance: Disturbance, world: Scene):
        self._what, self._world = disturbance, world
        self.event = -1
        self.shift_m = np.zeros((2, 2))
        changed = (disturbance.friction, disturbance.mass, disturbance.light)
        if changed != (1.0, 1.0, 1.0):
            world.alter(*changed)

    def begin(self, frame: int) -> None:
        """Let it happen before a frame, if it is time."""
        what = self._what
        if self.event >= 0 or (what.places_m is None and what.push_m is None):
            return
        tip_m = arm.fingertip(self._world.joints_rad()[None])[0]
        away_m = np.linalg.norm(tip_m - np.array(arm.HOME_TIP_M))
        is_low = tip_m[2] < TABLE_TOP_M + LOW_M
        if frame < what.frame or away_m < what.away_m or (what.low and not is_low):
            return
        self.event = frame
        self._from_m = tip_m
        if what.places_m is not None:
            before = self._world.cubes()[:, :2]
            self._world.put(what.places_m)
            self.shift_m = self._world.cubes()[:, :2] - before

    def driven(self, frame: int, wish_rad: Float[np.ndarray, " 5"]) -> Float[np.ndarray, " 5"]:
        """Where the arm goes in a frame: to the wish, or where the push drives it."""
        done = frame - self.event + 1
        took = self._what.push_frames
        if self._what.push_m is None or self.event < 0 or done > took + self._what.held_frames:
            return wish_rad
        share = ease(min(done / took, 1.0))
        aim_m = self._from_m + share * self._what.push_m
        aim_m[2] = max(aim_m[2], TABLE_TOP_M + motions.LOW_HEIGHT_M)  # never into the table
        return inverse.towards(aim_m, self._world.joints_rad())


def is_free(pattern: Pattern, places_m: Float[np.ndarray, "2 2"], variation: Variation) -> bool:
    """Whether cubes in these places are on the table and in nobody's way.

    They stand clear of each other and the other one clear of the stroke. The arm can do the motion.
    """
    side = SIDES.index(pattern.side)
    named, other = places_m[side], places_m[1 - side]
    if (np.abs(places_m[:, 0] - MIDDLE_X_M) > OF_MIDDLE_M).any():
        return False
    if np.linalg.norm(named - other) < CUBES_APART_M:
        return False
    for way in np.linspace(-STANDOFF_M, variation.travel_m, 6):
        widest = CUBE_RADIUS_M if way >= 0 else arm.HAND_RADIUS_M  # the cube goes, or the hand
        there = named + way * np.array(DIRECTION[pattern.action])
        if np.linalg.norm(there - other) < CUBE_RADIUS_M + widest + CLEAR_M:
            return False
    try:
        motions.plan(pattern, replace(variation, places_m=places_m))
    except RobotError:
        return False
    return True


def draw_places(
    rng, pattern: Pattern, variation: Variation, which: str, smallest_m: float, largest_m: float
) -> Float[np.ndarray, "2 2"] | None:
    """Places to which cubes are moved, in any direction; None if no try of `TRIES` is free.

    Args:
        rng: numpy's generator.
        which: `named`, `other` or `both` cubes.
        smallest_m: each is moved at least so far ...
        largest_m: ... and at most so far.
    """
    side = SIDES.index(pattern.side)
    moved = {"named": [side], "other": [1 - side], "both": [0, 1]}[which]
    for _ in range(TRIES):
        places = variation.places_m.copy()
        for cube in moved:
            angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(smallest_m, largest_m)
            places[cube] += far * np.array([np.cos(angle), np.sin(angle)])
        if is_free(pattern, places, variation):
            return places
    return None


def draw_push(
    rng, pattern: Pattern, variation: Variation, at_m: Float[np.ndarray, " 3"],
    smallest_m: float, largest_m: float,
) -> Float[np.ndarray, " 3"] | None:  # fmt: skip
    """How far the hand is driven off its way: aside in any direction, and up or down a little.

    The hand ends away from home, and all points on the straight way from there to where it is to
    come down are in reach. None if no try of `TRIES` is such.

    Args:
        rng: numpy's generator.
        at_m: where the fingertips are then.
        smallest_m: the hand is driven at least so far ...
        largest_m: ... and at most so far.
    """
    start, _ = motions.stroke_start_m(pattern, variation)
    above = np.array([*start, TABLE_TOP_M + variation.high_m])
    shares = np.linspace(0, 1, 9)[:, None]
    for _ in range(TRIES):
        angle, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(-TILT_RAD, TILT_RAD)
        aside = np.cos(tilt)
        way = np.array([np.cos(angle) * aside, np.sin(angle) * aside, np.sin(tilt)])
        push = rng.uniform(smallest_m, largest_m) * way
        ends = at_m + push
        if np.linalg.norm(ends - np.array(arm.HOME_TIP_M)) < FROM_HOME_M:
            continue
        try:
            inverse.solve(np.concatenate([at_m + shares * push, ends + shares * (above - ends)]))
        except RobotError:
            continue
        return push
    return None

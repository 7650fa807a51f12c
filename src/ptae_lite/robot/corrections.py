"""A planner that corrects itself: where the fingertips are to go next, given the present state.

The motion of `motions` is a path in time. Here it becomes a rule. The state is where the fingertips
are, where the cubes are, and the phase of the motion. The rule takes the path for the cube's
present place and makes what the hand is off this path smaller in every frame::

    goal = path(clock + 1) + off - min(GAIN |off|, max(LARGEST, HURRY |off|)) off / |off|
    off = tip - path(clock)

So a hand that was pushed, or whose cube was moved, is back on its path after about ten slow frames.
Two things wait for it. The hand comes down only above the place where the stroke starts, and the
stroke starts only when the hand is there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from ptae_lite.language import Pattern
from ptae_lite.robot import arm, inverse, motions
from ptae_lite.robot.motions import CLOCK, Variation
from ptae_lite.robot.scene import TABLE_TOP_M

GAIN = 0.5  # the share of a small deviation that is made up in a slow frame
LARGEST_M, LARGEST_UP_M = 0.008, 0.014  # in a slow frame, aside and up or down
HURRY = 1 / 6  # a hand that is far off makes up this share of it, if that is more
CLOSE_M, FAR_M = 0.008, 0.020  # above the start of the stroke, and not above it
PUSHED_RAD = 0.05  # the motors miss a target by less
READY_M = 0.010  # from the start of the stroke, at most, when it starts


@dataclass(frozen=True)
class Phase:
    """How far the motion is.

    Attributes:
        clock: slow frames, 0 to 99. It goes twice as fast in a fast motion, and it can wait.
        places_m: (2, 2) where the cubes were when the stroke started, or are if it has not.
    """

    clock: float
    places_m: Float[np.ndarray, "2 2"]


def correct(
    pattern: Pattern,
    variation: Variation,
    tip_m: Float[np.ndarray, " 3"],
    cubes: Float[np.ndarray, "2 7"],
    phase: Phase,
) -> tuple[Float[np.ndarray, " 3"], Phase]:
    """Where the fingertips are to be in the next frame, in metres, and the phase then.

    Args:
        variation: how the motion is made; the places of its cubes are not used.
        tip_m: where the fingertips are.
        cubes: poses of the left and the right cube: position in metres, quaternion.
        phase: of the motion now.
    """
    step = CLOCK[-1] / (pattern.frames - 1)  # slow frames in a frame
    down, stroke = variation.clock[1], variation.clock[2]
    before_stroke = phase.clock < stroke
    places = cubes[:, :2] if before_stroke else phase.places_m
    now = replace(variation, places_m=places)
    ahead = min(phase.clock + step, CLOCK[-1])
    here, there = motions.points_at(pattern, now, np.array([phase.clock, ahead], dtype=float))
    off = tip_m - here
    if before_stroke and ahead >= stroke and np.linalg.norm(off) > READY_M:
        ahead, there = phase.clock, here
    goal = there + _left_of(off, step)
    if before_stroke and phase.clock > down:
        start, _ = motions.stroke_start_m(pattern, now)
        aside = np.linalg.norm(goal[:2] - start)
        share = np.clip((aside - CLOSE_M) / (FAR_M - CLOSE_M), 0, 1)
        lowest = TABLE_TOP_M + variation.low_m + share * (variation.high_m - variation.low_m)
        if goal[2] < lowest:
            goal[2] = min(lowest, tip_m[2] + step * LARGEST_UP_M)
    return goal, Phase(ahead, np.array(places))


def _left_of(off_m, step: float):
    """What is left of a deviation after a frame of `step` slow frames."""
    aside = np.linalg.norm(off_m[:2])
    gain = 1 - (1 - GAIN) ** step
    kept = np.array(off_m, dtype=float)
    if aside > 0:
        kept[:2] *= 1 - min(gain * aside, step * max(LARGEST_M, HURRY * aside)) / aside
    kept[2] -= np.clip(gain * off_m[2], -step * LARGEST_UP_M, step * LARGEST_UP_M)
    return kept


class Planner:
    """A policy for `closed_loop.perform`: the planner that sees where the cubes are.

    Use a new one for each episode. `phase` is that of its motion. `goal_m` (3,) is where, in the
    last frame, it wanted the fingertips to go.
    """

    def __init__(self, pattern: Pattern, variation: Variation):
        self._pattern, self._variation = pattern, variation
        self.phase = Phase(0.0, variation.places_m)

    def see(self, cubes: Float[np.ndarray, "2 7"]) -> None:
        """Take in the poses of the cubes."""
        self._cubes = cubes

    def __call__(self, look, joints_rad) -> np.ndarray:
        tip_m = arm.fingertip(joints_rad[None])[0]
        goal, self.phase = correct(self._pattern, self._variation, tip_m, self._cubes, self.phase)
        wish = inverse.towards(goal, joints_rad)
        self.goal_m = arm.fingertip(wish[None])[0]
        return wish


class UnawarePlanner:
    """A policy for `closed_loop.perform`: the motion for the scene as it was, without looking.

    It drives the joints by the steps of this motion. A hand that was pushed goes on from there.
    """

    def __init__(self, pattern: Pattern, variation: Variation):
        path_rad = motions.plan(pattern, variation)
        self._steps = iter(np.diff(path_rad, axis=0))
        self._wish_rad = path_rad[0]

    def __call__(self, look, joints_rad) -> np.ndarray:
        if np.abs(joints_rad - self._wish_rad).max() > PUSHED_RAD:
            self._wish_rad = joints_rad
        wish = self._wish_rad + next(self._steps, 0.0)
        self._wish_rad = np.clip(wish, arm.LOWER_RAD, arm.UPPER_RAD)
        return self._wish_rad

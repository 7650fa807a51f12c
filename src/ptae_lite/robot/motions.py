"""Push, pull and slide as paths of the fingertips, with a variation for each sample.

A motion is a list of waypoints with times: from home to a place above the near, far or left side of
the named cube, down beside the cube, along the stroke, back off the cube, up, and home. The hand
speeds up and slows down smoothly between two waypoints. A slow motion takes 100 frames. A fast one
follows the same path in 50.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ptae_lite.language import Pattern
from ptae_lite.robot import arm, inverse
from ptae_lite.robot.scene import CUBE_EDGE_M, NOMINAL_PLACES_M, TABLE_TOP_M

VARIATIONS = 6  # of every pattern, as in the paper (section 4.1)

# Where the hand waits (from the cube's centre) and where the stroke goes: x forward, y left.
DIRECTION = {"push": (1.0, 0.0), "pull": (-1.0, 0.0), "slide": (0.0, -1.0)}
GAP_M = 0.018  # between hand and cube when the stroke starts
STANDOFF_M = CUBE_EDGE_M / 2 + arm.HAND_RADIUS_M + GAP_M
BACK_OFF_M = 0.020

PLACE_JITTER_M = 0.012
YAW_JITTER_RAD = np.radians(4.0)
TRAVEL_M = (0.060, 0.080)  # how far the cube is to go
ASIDE_JITTER_M = 0.004
LOW_HEIGHT_M, LOW_JITTER_M = 0.013, 0.003  # fingertips above the table during the stroke
HIGH_HEIGHT_M, HIGH_JITTER_M = 0.080, 0.010
CLOCK = (0, 18, 30, 58, 65, 79, 99)  # slow frames at which each waypoint is reached
CLOCK_JITTER = 1.5


@dataclass(frozen=True)
class Variation:
    """What is special to one sample. All of it is drawn from the sample's own seed.

    Attributes:
        places_m: (2, 2) x and y of the left and the right cube.
        yaws_rad: (2,) rotation of the cubes about the vertical.
        travel_m: how far the cube is to move.
        aside_m: distance of the stroke from the middle of the cube.
        low_m: height of the fingertips above the table during the stroke.
        high_m: height of the fingertips above the table before and after it.
        clock: (7,) slow frame at which each waypoint is reached.
    """

    places_m: np.ndarray
    yaws_rad: np.ndarray
    travel_m: float
    aside_m: float
    low_m: float
    high_m: float
    clock: np.ndarray


def sample_seed(pattern_index: int, variation: int) -> int:
    """The seed of a sample, 0 to 863. It is the sample's place in the data set: `6 pattern +
    variation`.

    So any sample can be made alone.
    """
    return VARIATIONS * pattern_index + variation


def draw(seed: int) -> Variation:
    """The variation that belongs to a seed."""
    rng = np.random.default_rng([2023, seed])
    clock = np.array(CLOCK, dtype=float)
    clock[1:-1] += rng.uniform(-CLOCK_JITTER, CLOCK_JITTER, len(clock) - 2)
    nominal = np.array(NOMINAL_PLACES_M)
    return Variation(
        places_m=nominal + rng.uniform(-PLACE_JITTER_M, PLACE_JITTER_M, (2, 2)),
        yaws_rad=rng.uniform(-YAW_JITTER_RAD, YAW_JITTER_RAD, 2),
        travel_m=rng.uniform(*TRAVEL_M),
        aside_m=rng.uniform(-ASIDE_JITTER_M, ASIDE_JITTER_M),
        low_m=LOW_HEIGHT_M + rng.uniform(-LOW_JITTER_M, LOW_JITTER_M),
        high_m=HIGH_HEIGHT_M + rng.uniform(-HIGH_JITTER_M, HIGH_JITTER_M),
        clock=clock,
    )


def middle(places_m: Float[np.ndarray, "2 2"]) -> Variation:
    """The variation without any random part, for cubes in these places."""
    return Variation(
        places_m=np.asarray(places_m, dtype=float),
        yaws_rad=np.zeros(2),
        travel_m=sum(TRAVEL_M) / 2,
        aside_m=0.0,
        low_m=LOW_HEIGHT_M,
        high_m=HIGH_HEIGHT_M,
        clock=np.array(CLOCK, dtype=float),
    )


def ease(x):
    """Smooth step from 0 to 1, `x^3 (10 - 15 x + 6 x^2)`.

    Its speed and its acceleration are 0 at both ends.
    """
    return x**3 * (10 + x * (6 * x - 15))


def stroke_start_m(
    pattern: Pattern, variation: Variation
) -> tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]]:
    """x and y in metres where the hand comes down, and the direction of the stroke."""
    cube = variation.places_m[("left", "right").index(pattern.side)]
    along = np.array(DIRECTION[pattern.action])
    aside = np.array([-along[1], along[0]]) * variation.aside_m
    return cube - along * STANDOFF_M + aside, along


def points_at(
    pattern: Pattern, variation: Variation, clock: Float[np.ndarray, " T"]
) -> Float[np.ndarray, "T 3"]:
    """Where the fingertips are to be at times of the motion, in metres.

    Args:
        clock: slow frames, 0 to 99.
    """
    start, along = stroke_start_m(pattern, variation)
    end = start + along * (GAP_M + variation.travel_m)
    back = end - along * BACK_OFF_M
    low, high = TABLE_TOP_M + variation.low_m, TABLE_TOP_M + variation.high_m
    waypoints = np.array([
        arm.HOME_TIP_M, (*start, high), (*start, low), (*end, low), (*back, low), (*back, high),
        arm.HOME_TIP_M,
    ])  # fmt: skip
    leg = np.clip(np.searchsorted(variation.clock, clock, side="right") - 1, 0, len(waypoints) - 2)
    begun, done = variation.clock[leg], variation.clock[leg + 1]
    share = ease((clock - begun) / (done - begun))[:, None]
    return waypoints[leg] + share * (waypoints[leg + 1] - waypoints[leg])


def fingertip_path(pattern: Pattern, variation: Variation) -> Float[np.ndarray, "T 3"]:
    """Where the fingertips are to be in each frame, in metres."""
    return points_at(pattern, variation, np.linspace(0, CLOCK[-1], pattern.frames))


def plan(pattern: Pattern, variation: Variation) -> Float[np.ndarray, "T 5"]:
    """Joint angles in radians of the whole motion, from home to home.

    Raises:
        RobotError: the arm cannot reach a point of the path.
    """
    return inverse.solve(fingertip_path(pattern, variation))

"""Push, pull and slide as paths of the fingertips, each sample with its own variation.

A motion is a list of waypoints on a clock of 100 slow frames: from home to above the near, far or
left side of the named cube, down beside it, along the stroke, off the cube, up, and home again.
Between waypoints the hand eases in and out. A fast motion takes the same way in half the time.
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
    """What is particular to one sample; all drawn from its own seed."""

    places_m: np.ndarray  # (2, 2) x, y of the left and the right cube
    yaws_rad: np.ndarray  # (2,)
    travel_m: float
    aside_m: float  # how far off the cube's middle the hand strokes
    low_m: float
    high_m: float
    clock: np.ndarray  # (7,) slow frames


def sample_seed(pattern_index: int, variation: int) -> int:
    """The seed of a sample: its place in the data set, so that any one can be made alone."""
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
    """The variation for cubes in these places that is in the middle of all else."""
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
    """Quintic smoothstep from 0 to 1: it starts and ends with no speed and no acceleration."""
    return x**3 * (10 + x * (6 * x - 15))


def fingertip_path(pattern: Pattern, variation: Variation) -> Float[np.ndarray, "T 3"]:
    """Where the fingertips are to be at each frame, in metres."""
    cube = variation.places_m[("left", "right").index(pattern.side)]
    along = np.array(DIRECTION[pattern.action])
    aside = np.array([-along[1], along[0]]) * variation.aside_m
    start = cube - along * STANDOFF_M + aside
    end = start + along * (GAP_M + variation.travel_m)
    back = end - along * BACK_OFF_M
    low, high = TABLE_TOP_M + variation.low_m, TABLE_TOP_M + variation.high_m
    waypoints = np.array([
        arm.HOME_TIP_M, (*start, high), (*start, low), (*end, low), (*back, low), (*back, high),
        arm.HOME_TIP_M,
    ])  # fmt: skip
    now = np.linspace(0, CLOCK[-1], pattern.frames)
    leg = np.clip(np.searchsorted(variation.clock, now, side="right") - 1, 0, len(waypoints) - 2)
    begun, done = variation.clock[leg], variation.clock[leg + 1]
    share = ease((now - begun) / (done - begun))[:, None]
    return waypoints[leg] + share * (waypoints[leg + 1] - waypoints[leg])


def plan(pattern: Pattern, variation: Variation) -> Float[np.ndarray, "T 5"]:
    """Joint angles (T, 5) in radians of the whole motion, home to home."""
    return inverse.solve(fingertip_path(pattern, variation))

"""The robot, its scene and the rule of success as one object for the scripts of a page.

Everything here comes from `robot`: no number is written a second time.
"""

from __future__ import annotations

import numpy as np

from ptae_lite.experiments.disturbances import MOVED_AT, MOVED_M
from ptae_lite.language import SIDES
from ptae_lite.robot import arm, closed_loop, disturbances, inverse, motions, scene
from ptae_lite.robot.mjcf import nico_mjcf


def constants() -> dict:
    """What physics.js, acting.js and the drawings of the arm need; units are in the names."""
    return {
        "mjcf": nico_mjcf(),
        "sides": SIDES,
        "frames_per_s": scene.FRAMES_PER_S,
        "substeps": scene.SUBSTEPS,
        "position_gain": scene.POSITION_GAIN,
        "velocity_gain": scene.VELOCITY_GAIN,
        "home_rad": inverse.home_rad().tolist(),
        "lower_rad": arm.LOWER_RAD.tolist(),
        "upper_rad": arm.UPPER_RAD.tolist(),
        "table_top_m": scene.TABLE_TOP_M,
        "cube_edge_m": scene.CUBE_EDGE_M,
        "table_m": table(),
        "inverse": {
            "rest_rad": inverse.REST_RAD.tolist(),
            "posture_weight": inverse.POSTURE_WEIGHT,
            "damping": inverse.DAMPING,
            "steps": inverse.STEPS,
            "largest_step_rad": inverse.LARGEST_STEP_RAD,
            "tolerance_m": inverse.TOLERANCE_M,
            "last_step_rad": inverse.LAST_STEP_RAD,
            "near_enough_rad": inverse.NEAR_ENOUGH_RAD,
            "near_damping": inverse.NEAR_DAMPING,
            "places_on_the_way": inverse.PLACES_ON_THE_WAY,
        },
        "rule": {
            "limit": closed_loop.LIMIT,
            "away_rad": closed_loop.AWAY_RAD,
            "home_rad": closed_loop.HOME_RAD,
            "at_rest": closed_loop.AT_REST,
            "slow_from": closed_loop.SLOW_FROM,
            "travel_mm": closed_loop.TRAVEL_MM,
            "other_mm": closed_loop.OTHER_MM,
            "direction": motions.DIRECTION,
            "done": closed_loop.DONE,
            "wrong": closed_loop.WRONG,
        },
        "stroke": {
            "standoff_m": motions.STANDOFF_M,
            "gap_m": motions.GAP_M,
            "travel_m": sum(motions.TRAVEL_M) / 2,
            "low_m": motions.LOW_HEIGHT_M,
            "high_m": motions.HIGH_HEIGHT_M,
        },
        "snatch": {
            "smallest_m": MOVED_M[0],
            "largest_m": MOVED_M[1],
            "at": MOVED_AT,
            "middle_x_m": disturbances.MIDDLE_X_M,
            "of_middle_m": disturbances.OF_MIDDLE_M,
            "apart_m": disturbances.CUBES_APART_M,
            "clear_m": disturbances.CLEAR_M,
            "cube_radius_m": disturbances.CUBE_RADIUS_M,
            "hand_radius_m": arm.HAND_RADIUS_M,
            "tries": disturbances.TRIES,
        },
        "links": links(),
        "fingertip_m": arm.FINGERTIP_M,
    }


def table() -> dict:
    """The corners of the table's top, as x and y."""
    (top,) = scene.TABLE_SHAPES
    middle, half = np.array(top.xyz[:2]), np.array(top.size[:2]) / 2
    return {"low": (middle - half).tolist(), "high": (middle + half).tolist()}


def links() -> list[dict]:
    """The chain of links from the torso to the hand, for forward kinematics."""
    chain = [{"name": j.link, "origin_m": j.origin_m, "axis": j.axis} for j in arm.JOINTS]
    fixed = {"name": "hand", "origin_m": arm.WRIST_X_ORIGIN_M, "axis": (1, 0, 0)}
    return [*chain, fixed | {"angle_rad": arm.WRIST_X_RAD}]

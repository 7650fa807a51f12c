"""Inverse kinematics: joint angles that bring the fingertips to given points.

Five joints reach a point (three numbers) with two to spare. The spare ones make the hand point
down and stay near a resting posture. For all frames of a motion at once we solve, step by step,

::

    minimise   |d(q) - down|^2  +  w^2 |q - rest|^2     subject to   tip(q) = target,

linearising `d` (the hand's direction) and `tip` at the current angles (Gauss-Newton). Because the
optimum does not depend on the frame before, a smooth path of targets gives a smooth path of joints.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Float

from ptae_lite.errors import RobotError
from ptae_lite.robot import arm

REST_RAD = np.radians([-19.0, 33.0, 109.0, 79.0, 21.0])
POSTURE_WEIGHT = 0.3
DAMPING = 0.3  # shortens the steps near full stretch, where they would swing about the solution
STEPS = 60
LARGEST_STEP_RAD = 0.25
TOLERANCE_M = 1e-4


def _jacobians(joints_rad):
    """Fingertip, hand direction and their derivatives by each joint: (T,3), (T,3), (T,3,5) x 2."""
    links = arm.link_transforms(joints_rad)
    hand = links["hand"]
    down = -hand[:, :3, 2]
    tip = hand[:, :3, 3] + arm.FINGERTIP_M * down
    of_tip = np.empty((len(tip), 3, len(arm.JOINTS)))
    of_down = np.empty_like(of_tip)
    for j, joint in enumerate(arm.JOINTS):
        frame = links[joint.link]
        axis = frame[:, :3, :3] @ np.array(joint.axis, dtype=float)
        of_tip[:, :, j] = np.cross(axis, tip - frame[:, :3, 3])
        of_down[:, :, j] = np.cross(axis, down)
    return tip, down, of_tip, of_down


def solve(targets_m: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 5"]:
    """Joint angles (T, 5) in radians whose fingertips are at `targets_m`, within the limits.

    Raises `RobotError` for a point that the arm cannot reach.
    """
    targets_m = np.asarray(targets_m, dtype=float)
    if targets_m.ndim != 2 or targets_m.shape[1] != 3:
        raise RobotError(f"targets are an array of frames x 3 metres, not {targets_m.shape}")
    frames, joints = len(targets_m), len(arm.JOINTS)
    q = np.tile(REST_RAD, (frames, 1))
    free = np.ones_like(q)  # 0 for a joint that rests at its limit: the others must do it
    straight_down = np.array([0.0, 0.0, -1.0])
    for _ in range(STEPS):
        tip, down, of_tip, of_down = _jacobians(q)
        of_tip, of_down = of_tip * free[:, None], of_down * free[:, None]
        # The Lagrange conditions of the linearised problem, one 8 x 8 system a frame.
        system = np.zeros((frames, joints + 3, joints + 3))
        system[:, :joints, :joints] = np.swapaxes(of_down, 1, 2) @ of_down
        system[:, range(joints), range(joints)] += POSTURE_WEIGHT**2 + DAMPING
        system[:, :joints, joints:] = np.swapaxes(of_tip, 1, 2)
        system[:, joints:, :joints] = of_tip
        system[:, range(joints, joints + 3), range(joints, joints + 3)] -= 1e-9  # at full stretch
        right = np.zeros((frames, joints + 3, 1))
        right[:, :joints] = np.swapaxes(of_down, 1, 2) @ (straight_down - down)[..., None]
        right[:, :joints, 0] += POSTURE_WEIGHT**2 * (REST_RAD - q)
        right[:, joints:, 0] = targets_m - tip
        step = np.linalg.solve(system, right)[:, :joints, 0]
        step *= np.minimum(1, LARGEST_STEP_RAD / np.abs(step).max(1, keepdims=True).clip(1e-12))
        wanted = q + step
        moved = np.clip(wanted, arm.LOWER_RAD, arm.UPPER_RAD)
        free = (moved == wanted).astype(float)
        done = np.abs(moved - q).max() < 1e-7
        q = moved
        if done:
            break
    miss_m = np.linalg.norm(arm.fingertip(q) - targets_m, axis=1)
    if miss_m.max() > TOLERANCE_M:
        worst = int(miss_m.argmax())
        raise RobotError(
            f"the arm cannot reach ({', '.join(f'{x:.3f}' for x in targets_m[worst])}) m: "
            f"it misses by {1000 * miss_m[worst]:.1f} mm; points over the near part of the table "
            "(x 0.33 to 0.45, y -0.10 to 0.25 m) are in reach"
        )
    return q


@cache
def home_rad() -> Float[np.ndarray, " 5"]:
    """The home pose, where every sequence starts and ends."""
    home = solve(np.array([arm.HOME_TIP_M]))[0]
    home.setflags(write=False)
    return home

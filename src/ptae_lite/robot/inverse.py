"""Inverse kinematics: the joint angles that bring the fingertips to given points.

A point is three numbers and the arm has five joints, so two are free. We use them to point the hand
down and to stay near a resting posture. For each frame we solve

::

    minimise   |d(q) - down|^2  +  w^2 |q - rest|^2     subject to   tip(q) = target,

where `q` are the joint angles, `d` is the direction of the hand and `tip` the place of the
fingertips. We replace `d` and `tip` by their linear approximation at the current angles, solve, and
repeat (Gauss-Newton). All frames are solved at once. The solution of a frame does not depend on
the frame before it, so a smooth path of targets gives a smooth path of joints.
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
LAST_STEP_RAD = 1e-7  # of a search
NEAR_ENOUGH_RAD = 3e-4  # the same of one that starts from the angles now
NEAR_DAMPING = 0.03  # a search that starts near its end needs less
PLACES_ON_THE_WAY = 32  # that are tried if a point is out of reach


def _jacobians(joints_rad):
    """Fingertip, hand direction, and their derivatives by the joints.

    Returns arrays (T, 3), (T, 3), (T, 3, 5) and (T, 3, 5).
    """
    links = arm.link_transforms(joints_rad)
    hand = links["hand"]
    down = -hand[:, :3, 2]
    tip = hand[:, :3, 3] + arm.FINGERTIP_M * down
    axes = np.empty((len(tip), 3, len(arm.JOINTS)))
    levers = np.empty_like(axes)
    for j, joint in enumerate(arm.JOINTS):
        frame = links[joint.link]
        axes[:, :, j] = frame[:, :3, :3] @ np.array(joint.axis, dtype=float)
        levers[:, :, j] = tip - frame[:, :3, 3]
    return tip, down, _cross(axes, levers), _cross(axes, down[:, :, None])


def _cross(a, b):
    """Cross products along the second axis, of all joints at once: `np.cross` is slow."""
    rows = [a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(rows, axis=1)


def solve(targets_m: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 5"]:
    """Joint angles in radians, within the limits, that bring the fingertips to `targets_m`.

    Args:
        targets_m: T points in metres.

    Raises:
        RobotError: the array is not (T, 3), or the arm cannot reach a point to 0.1 mm.
    """
    targets_m = np.asarray(targets_m, dtype=float)
    if targets_m.ndim != 2 or targets_m.shape[1] != 3:
        raise RobotError(f"targets are an array of frames x 3 metres, not {targets_m.shape}")
    q, miss_m = _nearest(targets_m, np.tile(REST_RAD, (len(targets_m), 1)))
    if miss_m.max() > TOLERANCE_M:
        worst = int(miss_m.argmax())
        raise RobotError(
            f"the arm cannot reach ({', '.join(f'{x:.3f}' for x in targets_m[worst])}) m: "
            f"it misses by {1000 * miss_m[worst]:.1f} mm; points over the near part of the table "
            "(x 0.33 to 0.45, y -0.10 to 0.25 m) are in reach"
        )
    return q


def towards(
    target_m: Float[np.ndarray, " 3"], joints_rad: Float[np.ndarray, " 5"]
) -> Float[np.ndarray, " 5"]:
    """Joint angles in radians that bring the fingertips to a point, or as near as the arm reaches.

    If the point is out of reach, it is the nearest to it of these: the last point in reach on the
    straight way to it, and the point where the search for it ends.

    Args:
        target_m: the point in metres.
        joints_rad: the angles now. The way begins at their fingertips.
    """
    target_m = np.asarray(target_m, dtype=float)
    now = np.clip(joints_rad, arm.LOWER_RAD, arm.UPPER_RAD)
    q, miss_m = _nearest(target_m[None], now[None], NEAR_ENOUGH_RAD, NEAR_DAMPING)
    if miss_m[0] <= TOLERANCE_M:
        return q[0]
    start_m = arm.fingertip(now[None])[0]
    shares = np.linspace(1, 0, PLACES_ON_THE_WAY, endpoint=False)[1:, None]
    on_the_way, off_m = _nearest(start_m + shares * (target_m - start_m),
                                 np.tile(REST_RAD, (len(shares), 1)))  # fmt: skip
    found = np.concatenate([q, on_the_way[off_m <= TOLERANCE_M], now[None]])
    return found[np.linalg.norm(arm.fingertip(found) - target_m, axis=1).argmin()]


def _nearest(targets_m, q, near_enough_rad=LAST_STEP_RAD, damping=DAMPING):
    """Angles (T, 5) found from the angles `q`, and by how much (T,) their fingertips miss."""
    frames, joints = len(targets_m), len(arm.JOINTS)
    free = np.ones_like(q)  # 0 for a joint at its limit: the other joints must do the motion
    straight_down = np.array([0.0, 0.0, -1.0])
    for _ in range(STEPS):
        tip, down, of_tip, of_down = _jacobians(q)
        of_tip, of_down = of_tip * free[:, None], of_down * free[:, None]
        # The Lagrange conditions of the linearised problem, one 8 x 8 system a frame.
        system = np.zeros((frames, joints + 3, joints + 3))
        system[:, :joints, :joints] = np.swapaxes(of_down, 1, 2) @ of_down
        system[:, range(joints), range(joints)] += POSTURE_WEIGHT**2 + damping
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
        done = np.abs(moved - q).max() < near_enough_rad
        q = moved
        if done:
            break
    return q, np.linalg.norm(arm.fingertip(q) - targets_m, axis=1)


@cache
def home_rad() -> Float[np.ndarray, " 5"]:
    """The home pose in radians. Every sequence starts and ends there."""
    home = solve(np.array([arm.HOME_TIP_M]))[0]
    home.setflags(write=False)
    return home

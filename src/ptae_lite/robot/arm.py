"""NICO's upper body as numbers: joints, shapes and forward kinematics.

The sizes are those of the robot's published description (NICO-software, `complete.urdf`), rounded
to a millimetre. Its small fixed rotations (up to 3.2 degrees) are left out. The shapes that we draw
are simple ones of our own: boxes, cylinders and spheres.

Coordinates are the robot's, in metres: x forward, y to its left, z up. The origin is on the floor
below the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from jaxtyping import Float

from ptae_lite.errors import RobotError

COMPLETE = "complete.urdf"
NARROW = "kinematics.urdf"  # the narrower limits that NICO's own inverse kinematics uses


@dataclass(frozen=True)
class Joint:
    """A revolute joint: its place in the frame of its parent link, its axis and its limits.

    Attributes:
        link: the link that the joint moves.
        limits_from: the file of NICO's software that has these limits.
    """

    name: str
    link: str
    origin_m: tuple[float, float, float]
    axis: tuple[int, int, int]
    lower_rad: float
    upper_rad: float
    limits_from: str


# The five recorded joints, shoulder to wrist: J = 5. The paper says only "five joints of the left
# arm"; these five are the ones that NICO's own arm chain lists first.
JOINTS = (
    Joint("shoulder_z", "shoulder", (0.027, 0.050, 0.749), (0, 0, 1), -2.182, 1.745, COMPLETE),
    Joint("shoulder_y", "collar", (0.022, 0.022, 0.037), (0, 1, 0), -3.124, 3.142, COMPLETE),
    Joint("arm_x", "upper_arm", (0.024, 0.074, -0.023), (1, 0, 0), -1.868, 3.002, COMPLETE),
    Joint("elbow_y", "forearm", (-0.035, 0.023, -0.170), (0, -1, 0), 0.0, 1.745, NARROW),
    Joint("wrist_z", "wrist", (0.0, -0.010, -0.126), (0, 0, 1), -1.571, 1.571, COMPLETE),
)
JOINT_NAMES = tuple(joint.name for joint in JOINTS)
LOWER_RAD = np.array([joint.lower_rad for joint in JOINTS])
UPPER_RAD = np.array([joint.upper_rad for joint in JOINTS])

# The sixth joint, wrist_x, is held at its limit, so that the hand can point straight down.
WRIST_X_ORIGIN_M = (0.0, 0.0, -0.071)
WRIST_X_RAD = -0.873
FINGERTIP_M = 0.085  # from wrist_x to the fingertips
HAND_RADIUS_M = 0.022  # of the capsule that touches the cubes

HEAD_ORIGIN_M = (0.001, 0.0, 0.8305)
HEAD_YAW_RAD, HEAD_PITCH_RAD = 0.28, 0.78  # to the left, and down at the table
RIGHT_EYE_M = (0.085, -0.033, 0.100)  # in the head's frame; ours: no source gives the eye's place

# Every sequence starts and ends in the same pose, so the pose does not give away the action. The
# hand is then at this point, beside the cubes and in view.
HOME_TIP_M = (0.33, 0.23, 0.65)


@dataclass(frozen=True)
class Shape:
    """A simple shape, fixed to a link.

    Attributes:
        kind: `box`, `cylinder` or `sphere`.
        size: in metres: the edges (x, y, z) of a box, the radius and the length along z of a
            cylinder, the radius of a sphere.
        xyz: place of the shape's centre in the link's frame, in metres.
        rpy: rotation about x, y and z, in radians.
        rgba: colour and opacity, 0 to 1.
        solid: whether the shape can touch the cubes.
        drawn: whether the shape is visible.
    """

    link: str
    kind: str
    size: tuple[float, ...]
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rgba: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    solid: bool = False
    drawn: bool = True


_WHITE, _GREY, _DARK = (0.93, 0.93, 0.95, 1.0), (0.55, 0.56, 0.60, 1.0), (0.13, 0.13, 0.15, 1.0)


def _finger(x_m: float, y_m: float) -> Shape:
    return Shape("hand", "box", (0.013, 0.013, 0.048), (x_m, y_m, -0.061), rgba=_WHITE)


SHAPES = (
    Shape("torso", "box", (0.13, 0.20, 0.27), (-0.03, 0.0, 0.645), rgba=_WHITE),
    Shape("torso", "cylinder", (0.035, 0.06), (0.0, 0.0, 0.80), rgba=_DARK),
    Shape("torso", "box", (0.11, 0.13, 0.05), (-0.03, 0.0, 0.49), rgba=_DARK),
    # the right arm hangs at rest
    Shape("torso", "cylinder", (0.030, 0.10), (0.035, -0.125, 0.765), (pi / 2, 0, 0), rgba=_DARK),
    Shape("torso", "cylinder", (0.028, 0.17), (0.035, -0.175, 0.68), rgba=_WHITE),
    Shape("torso", "cylinder", (0.024, 0.15), (0.035, -0.175, 0.52), rgba=_DARK),
    Shape("torso", "box", (0.05, 0.03, 0.09), (0.035, -0.175, 0.40), rgba=_WHITE),
    Shape("head", "sphere", (0.082,), (0.0, 0.0, 0.094), rgba=_WHITE),
    Shape("head", "sphere", (0.016,), (0.070, -0.033, 0.100), rgba=_DARK),
    Shape("head", "sphere", (0.016,), (0.070, 0.033, 0.100), rgba=_DARK),
    Shape("shoulder", "cylinder", (0.030, 0.06), (0.015, 0.02, 0.03), (pi / 2, 0, 0), rgba=_DARK),
    Shape("collar", "cylinder", (0.028, 0.07), (0.020, 0.045, -0.012), (pi / 2, 0, 0), rgba=_WHITE),
    Shape("upper_arm", "cylinder", (0.024, 0.17), (-0.017, 0.012, -0.085), (-0.13, 0.2, 0),
          rgba=_DARK, solid=True),
    Shape("forearm", "cylinder", (0.024, 0.13), (0.0, -0.005, -0.065), rgba=_WHITE, solid=True),
    Shape("wrist", "cylinder", (0.021, 0.07), (0.0, 0.0, -0.036), rgba=_DARK, solid=True),
    Shape("hand", "box", (0.052, 0.026, 0.050), (0.0, 0.0, -0.022), rgba=_GREY),
    _finger(-0.018, 0.0), _finger(0.001, 0.0), _finger(0.019, 0.0),
    Shape("hand", "box", (0.013, 0.030, 0.013), (0.0, 0.024, -0.034), rgba=_GREY),
    # The hand touches the cubes with a capsule. A box would twist them: five joints cannot also
    # set the hand's yaw.
    Shape("hand", "cylinder", (HAND_RADIUS_M, FINGERTIP_M - HAND_RADIUS_M),
          (0.0, 0.0, -(FINGERTIP_M - HAND_RADIUS_M) / 2), solid=True, drawn=False),
    Shape("hand", "sphere", (HAND_RADIUS_M,), (0.0, 0.0, -(FINGERTIP_M - HAND_RADIUS_M)),
          solid=True, drawn=False),
)  # fmt: skip


def rotation(axis, angle_rad) -> Float[np.ndarray, "T 3 3"]:
    """Rotation matrices about a unit axis (x, y, z) by T angles, by Rodrigues' formula:

    ::

        R = I + sin(angle) C + (1 - cos(angle)) C C,    C v = axis x v
    """
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=float)
    angle_rad = np.asarray(angle_rad, dtype=float)[:, None, None]
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * (cross @ cross)


def _transform(rotations, origin_m) -> Float[np.ndarray, "T 4 4"]:
    made = np.zeros((len(rotations), 4, 4))
    made[:, :3, :3] = rotations
    made[:, :3, 3] = origin_m
    made[:, 3, 3] = 1
    return made


def head_transform() -> Float[np.ndarray, "4 4"]:
    """Pose of the head in the world. The head looks at the table and never moves."""
    turned = rotation((0, 0, 1), [HEAD_YAW_RAD]) @ rotation((0, 1, 0), [HEAD_PITCH_RAD])
    return _transform(turned, HEAD_ORIGIN_M)[0]


def link_transforms(joints_rad: Float[np.ndarray, "T 5"]) -> dict[str, np.ndarray]:
    """Forward kinematics: the world transform (T, 4, 4) of each link, from `torso` to `hand`.

    Each joint multiplies its parent's transform: `T_link = T_parent @ [R(axis, q), origin]`.

    Raises:
        RobotError: `joints_rad` is not an array (T, 5).
    """
    joints_rad = check_shape(joints_rad)
    frames = len(joints_rad)
    links = {
        "torso": np.tile(np.eye(4), (frames, 1, 1)),
        "head": np.tile(head_transform(), (frames, 1, 1)),
    }
    parent = links["torso"]
    for j, joint in enumerate(JOINTS):
        parent = parent @ _transform(rotation(joint.axis, joints_rad[:, j]), joint.origin_m)
        links[joint.link] = parent
    links["hand"] = parent @ _transform(rotation((1, 0, 0), [WRIST_X_RAD]), WRIST_X_ORIGIN_M)
    return links


def fingertip(joints_rad: Float[np.ndarray, "T 5"]) -> Float[np.ndarray, "T 3"]:
    """Where the fingertips are, in metres."""
    hand = link_transforms(joints_rad)["hand"]
    return hand[:, :3, 3] - FINGERTIP_M * hand[:, :3, 2]


def check_shape(joints_rad) -> Float[np.ndarray, "T 5"]:
    """The joints as an array of floats.

    Raises:
        RobotError: the array is not (T, 5).
    """
    joints_rad = np.asarray(joints_rad, dtype=float)
    if joints_rad.ndim != 2 or joints_rad.shape[1] != len(JOINTS):
        raise RobotError(
            f"joints are an array of frames x {len(JOINTS)} angles in radians, "
            f"not of shape {joints_rad.shape}"
        )
    return joints_rad


def check_limits(joints_rad: Float[np.ndarray, "T 5"]) -> None:
    """Check that every joint is inside its limits in every frame.

    Raises:
        RobotError: a joint is outside, or is not a number. The message names the first one.
    """
    joints_rad = check_shape(joints_rad)
    # "not inside" rather than "outside": a NaN must be found, too
    outside = ~((joints_rad >= LOWER_RAD - 1e-9) & (joints_rad <= UPPER_RAD + 1e-9))
    if outside.any():
        frame, j = np.argwhere(outside)[0]
        raise RobotError(
            f"{JOINT_NAMES[j]} is at {joints_rad[frame, j]:.3f} rad in frame {frame}; "
            f"its limits are {LOWER_RAD[j]:.3f} to {UPPER_RAD[j]:.3f}"
        )

"""Forward kinematics of the arm as a differentiable function: joints to the place of the hand.

It gives the numbers of `robot.arm.fingertip`, for joints of any leading shape. A network that is
fed with it knows where its hand is, in metres, without learning it.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from ptae_lite.robot import arm


def _crosses(axis) -> Float[Tensor, "3 3"]:
    """The matrix C of the product `C v = axis x v`."""
    x, y, z = axis
    return torch.tensor([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=torch.float64)


# The chain from the wrist back to the torso: what turns, about which axis, and where it sits.
_TURNS = [_crosses(joint.axis) for joint in arm.JOINTS]
_PLACES = [torch.tensor(joint.origin_m, dtype=torch.float64) for joint in arm.JOINTS]
_HAND = torch.linalg.matrix_exp(arm.WRIST_X_RAD * _crosses((1, 0, 0)))
_TIP = torch.tensor(arm.WRIST_X_ORIGIN_M, dtype=torch.float64) - arm.FINGERTIP_M * _HAND[:, 2]


def fingertip(joints_rad: Float[Tensor, "... 5"]) -> Float[Tensor, "... 3"]:
    """Where the fingertips are, in metres.

    ::

        tip = o1 + R1 (o2 + R2 (o3 + R3 (o4 + R4 (o5 + R5 tip5)))),
        R v = v + sin(q) C v + (1 - cos(q)) C C v

    with the joints' origins `o`, angles `q` and axes (`C v = axis x v`). `tip5` are the fingertips
    in the frame of the last joint.
    """
    tip = _TIP.to(joints_rad)
    for j in reversed(range(len(arm.JOINTS))):
        turn, angle = _TURNS[j].to(joints_rad), joints_rad[..., j, None]
        once = tip @ turn.T
        tip = tip + angle.sin() * once + (1 - angle.cos()) * (once @ turn.T)
        tip = tip + _PLACES[j].to(joints_rad)
    return tip

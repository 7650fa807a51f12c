"""The hand's next place, from the task, the place of the named cube and the place of the hand.

Places are in the robot's coordinates, in metres.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ptae_lite.models.recurrent import open_forget_gates
from ptae_lite.robot import arm
from ptae_lite.robot.scene import NOMINAL_PLACES_M

HAND_UNIT_M = 0.1  # the hand goes some of these away from home
NEAR_UNIT_M = 0.03  # the hand is mostly within this of the cube when it matters


class Memory(NamedTuple):
    """What the policy keeps from frame to frame.

    Args:
        place_m: where it believes the named cube to be, or to have been at the touch.
        attention: state of the recurrent layer of the gate.
        states: of the recurrent layers of the wish.
    """

    place_m: Float[Tensor, "B 2"]
    attention: Tensor
    states: tuple[Tensor, Tensor]


class HandPlanner(nn.Module):
    """Task, place of the named cube and place of the hand to the hand's next place.

    The remembered place `m` follows what is read of the named cube as far as a gate is open::

        m' = m + gate (read - m)

    The gate is a recurrent layer that sees the hand, the hand's way from the cube, and the task. It
    learns to close when the arm hides the cube or moves it. Two more recurrent layers see the same
    with the remembered place, and answer ::

        wish = home + share (m' - home) + rest

    with a share between 0 and 1 for the horizontal place.

    Args:
        task: length K of the task's vector.
        units: of each recurrent layer.
        gate_units: of the gate's hidden layer.
    """

    def __init__(self, task: int, units: int, layers: int, gate_units: int):
        super().__init__()
        self.attend = nn.GRU(task + 6, gate_units, batch_first=True)
        self.gate = nn.Linear(gate_units, 1)
        self.lstm = nn.LSTM(task + 8, units, layers, batch_first=True)
        open_forget_gates(self.lstm)
        self.share, self.rest = nn.Linear(units, 2), nn.Linear(units, 3)
        self.register_buffer("home", torch.tensor(arm.HOME_TIP_M), persistent=False)
        self.register_buffer(
            "middle", torch.tensor(NOMINAL_PLACES_M, dtype=torch.float32), persistent=False
        )

    def _hand(self, hand, place):
        off = torch.cat([hand[..., :2] - place, hand[..., 2:] - self.home[2]], dim=-1)
        return (hand - self.home) / HAND_UNIT_M, off / NEAR_UNIT_M

    def forward(
        self, task: Float[Tensor, "B K"], read: Float[Tensor, "B T 2"],
        hand: Float[Tensor, "B T 3"], memory: Memory | None = None,
    ):  # fmt: skip
        """Wishes for the hand (B, T, 3), remembered places (B, T, 2), and the memory.

        Args:
            task: side, action and speed, each as one of its kinds.
            read: the place that is read of the named cube, in metres.
            hand: where the hand is, in metres.
            memory: from the frame before; None at the first.
        """
        every = task[:, None].expand(-1, hand.shape[1], -1)
        seen = torch.cat([every, *self._hand(hand, read)], dim=2)
        attended, attention = self.attend(seen, None if memory is None else memory.attention)
        gate = torch.sigmoid(self.gate(attended))
        place, places = read[:, 0] if memory is None else memory.place_m, []
        for new, share in zip(read.unbind(1), gate.unbind(1), strict=True):
            place = torch.lerp(place, new, share)
            places.append(place)
        kept = torch.stack(places, dim=1)
        at = (kept - self.middle.mean(0)) / HAND_UNIT_M
        inputs = torch.cat([every, *self._hand(hand, kept), at], dim=2)
        hidden, states = self.lstm(inputs, None if memory is None else memory.states)
        wish = self.home + HAND_UNIT_M * self.rest(hidden)
        follow = torch.sigmoid(self.share(hidden)) * (kept - self.home[:2])
        return wish + nn.functional.pad(follow, (0, 1)), kept, Memory(place, attention, states)

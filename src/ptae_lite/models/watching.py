"""A policy that watches: a PTAE whose actions are wishes for the hand, corrected at every frame.

::

    sentence, first look --PTAE--> h --TaskReader--> side, action, speed --\\
    image now, first image --PlaceReader--> places of the cubes --memory--> HandPlanner --> wish
    measured joints --forward kinematics--> place of the hand --------------/

The PTAE stays as it was trained. Its code tells once, at the first look, what is to be done. From
then on the policy asks at every frame where the named cube is and where the hand is, and answers
with the place where the hand is to be in the next frame. Inverse kinematics turns it into joints.

Places and wishes are in the robot's coordinates, in metres. What happens before the touch is a
matter of the cube; so a wish is given as a share of the cube's place and a rest that does not know
of it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from ptae_lite.errors import ConfigError
from ptae_lite.language import ACTIONS, SIDES, SPEEDS
from ptae_lite.models.common import check_sizes
from ptae_lite.models.recurrent import open_forget_gates
from ptae_lite.robot import arm
from ptae_lite.robot.scene import NOMINAL_PLACES_M

KINDS = (len(SIDES), len(ACTIONS), len(SPEEDS))  # choices of a task
PLACE_UNIT_M = 0.03  # a cube is mostly within this of the middle of its places
HAND_UNIT_M = 0.1
NEAR_UNIT_M = 0.03


@dataclass(frozen=True)
class WatcherConfig:
    """Sizes and choices of a watching policy.

    Raises:
        ConfigError: a value makes no sense.
    """

    features: int = 30
    hidden: int = 256  # of the PTAE's code
    task_units: int = 64
    place_units: int = 128
    gate_units: int = 32
    units: int = 128
    layers: int = 2
    # Controls: what is taken away from it.
    freeze_video: bool = False  # it sees the first image only, at every frame
    feel_hand: bool = True  # it measures its joints; False: it believes its own last wish

    def __post_init__(self):
        check_sizes(self, *(name for name, value in asdict(self).items() if type(value) is int))


class TaskReader(nn.Module):
    """Code to the task: which side, which action, which speed."""

    def __init__(self, hidden: int, units: int):
        super().__init__()
        self.inner = nn.Sequential(nn.Linear(hidden, units), nn.ReLU())
        self.outputs = nn.ModuleList(nn.Linear(units, kinds) for kinds in KINDS)

    def forward(self, code: Float[Tensor, "B H"]) -> list[Float[Tensor, "B _"]]:
        """Scores of the sides, of the actions and of the speeds."""
        inner = self.inner(code)
        return [output(inner) for output in self.outputs]

    def decide(self, code: Float[Tensor, "B H"]) -> Int[Tensor, "B 3"]:
        """The most likely side, action and speed, as numbers."""
        return torch.stack([scores.argmax(1) for scores in self(code)], dim=1)


class PlaceReader(nn.Module):
    """Features of the present and of the first image to the places of both cubes."""

    def __init__(self, features: int, units: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(2 * features, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(),
            nn.Linear(units, 4),
        )  # fmt: skip
        middle = torch.tensor(NOMINAL_PLACES_M, dtype=torch.float32)
        self.register_buffer("middle", middle, persistent=False)

    def forward(
        self, now: Float[Tensor, "... F"], first: Float[Tensor, "... F"]
    ) -> Float[Tensor, "... 2 2"]:
        """x and y of the left and the right cube, in metres."""
        read = self.layers(torch.cat([now, first], dim=-1))
        return self.middle + PLACE_UNIT_M * read.unflatten(-1, (2, 2))


class Memory(NamedTuple):
    """What the policy keeps from frame to frame.

    Args:
        place_m: where it believes the named cube to be, or to have been at the touch.
        states: of the recurrent layers.
    """

    place_m: Float[Tensor, "B 2"]
    states: tuple[Tensor, Tensor]


class HandPlanner(nn.Module):
    """Task, place of the named cube and place of the hand to the hand's next place.

    The remembered place `m` follows what is read of the named cube as far as a gate is open::

        m' = m + gate (read - m)

    The gate sees the hand, the hand's way from the cube, and the task. It learns to close when the
    arm hides the cube or moves it. A recurrent network sees the same, and answers ::

        wish = home + share (m' - home) + rest

    with a share between 0 and 1 for the horizontal place.
    """

    def __init__(self, config: WatcherConfig):
        super().__init__()
        task, c = sum(KINDS), config
        self.gate = nn.Sequential(
            nn.Linear(task + 6, c.gate_units), nn.Tanh(), nn.Linear(c.gate_units, 1)
        )
        self.lstm = nn.LSTM(task + 8, c.units, c.layers, batch_first=True)
        open_forget_gates(self.lstm)
        self.share, self.rest = nn.Linear(c.units, 2), nn.Linear(c.units, 3)
        self.register_buffer("home", torch.tensor(arm.HOME_TIP_M), persistent=False)
        self.register_buffer(
            "middle", torch.tensor(NOMINAL_PLACES_M, dtype=torch.float32), persistent=False
        )

    def remember(self, task, read, hand, place) -> Float[Tensor, "B 2"]:
        """The remembered place after one more look."""
        seen = torch.cat([task, *self._hand(hand, read)], dim=1)
        return place + torch.sigmoid(self.gate(seen)) * (read - place)

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
        place, places = read[:, 0] if memory is None else memory.place_m, []
        for r, h in zip(read.unbind(1), hand.unbind(1), strict=True):
            place = self.remember(task, r, h, place)
            places.append(place)
        kept = torch.stack(places, dim=1)
        at = (kept - self.middle.mean(0)) / HAND_UNIT_M
        every = task[:, None].expand(-1, hand.shape[1], -1)
        inputs = torch.cat([every, *self._hand(hand, kept), at], dim=2)
        hidden, states = self.lstm(inputs, None if memory is None else memory.states)
        wish = self.home + HAND_UNIT_M * self.rest(hidden)
        follow = torch.sigmoid(self.share(hidden)) * (kept - self.home[:2])
        return wish + nn.functional.pad(follow, (0, 1)), kept, Memory(place, states)


def one_of_each(numbers: Int[Tensor, "B 3"]) -> Float[Tensor, "B K"]:
    """Side, action and speed as numbers to a vector with a 1 for each."""
    parts = [nn.functional.one_hot(numbers[:, i], kinds) for i, kinds in enumerate(KINDS)]
    return torch.cat(parts, dim=1).float()


class Watcher(nn.Module):
    """The parts that are trained beside a PTAE."""

    kind = "watcher"

    def __init__(self, config: WatcherConfig = WatcherConfig()):
        super().__init__()
        self.config = c = config
        self.task = TaskReader(c.hidden, c.task_units)
        self.places = PlaceReader(c.features, c.place_units)
        self.plan = HandPlanner(c)

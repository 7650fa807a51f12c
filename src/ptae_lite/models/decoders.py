"""The two decoders: LSTMs that start from the code and feed on their own output.

Neither is ever shown the true previous answer, in training or in the test (no teacher forcing).
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ptae_lite.language import EOS, VOCABULARY
from ptae_lite.models.recurrent import make_cell


class RecurrentDecoder(nn.Module):
    """LSTM layers whose first state is a linear function of the code (B, H)."""

    def __init__(self, inputs: int, outputs: int, hidden: int, units: int, layers: int,
                 forget_bias: float, peepholes: bool):  # fmt: skip
        super().__init__()
        self.units = units
        self.start = nn.Linear(hidden, layers * 2 * units)
        sizes = [inputs] + [units] * (layers - 1)
        self.cells = nn.ModuleList(make_cell(size, units, forget_bias, peepholes) for size in sizes)
        self.output = nn.Linear(units, outputs)

    def first_state(self, code: Float[Tensor, "B H"]) -> list[tuple[Tensor, Tensor]]:
        """(hidden, cell) of each layer, (B, units) each."""
        parts = self.start(code).split(self.units, dim=1)
        return [(parts[2 * i], parts[2 * i + 1]) for i in range(len(self.cells))]

    def step(self, x: Tensor, states: list) -> tuple[Tensor, list]:
        """One step of all layers: the output before its nonlinearity, and the new states."""
        after = []
        for cell, state in zip(self.cells, states, strict=True):
            x, memory = cell(x, state)
            after.append((x, memory))
        return self.output(x), after


class LanguageDecoder(RecurrentDecoder):
    """Code to words; the whole softmax vector is fed back, not the chosen word."""

    def __init__(self, hidden: int, units: int, layers: int, forget_bias: float,
                 peepholes: bool = False):  # fmt: skip
        words = len(VOCABULARY)
        super().__init__(words, words, hidden, units, layers, forget_bias, peepholes)

    def forward(self, code: Float[Tensor, "B H"], steps: int) -> Float[Tensor, "B N V"]:
        """Logarithms of the word probabilities at each step, BOS given."""
        states = self.first_state(code)
        word = code.new_zeros(len(code), len(VOCABULARY))
        word[:, EOS] = 1  # BOS is the same token
        answers = []
        for _ in range(steps):
            scores, states = self.step(word, states)
            answers.append(torch.log_softmax(scores, dim=1))
            word = answers[-1].exp()
        return torch.stack(answers, dim=1)


class ActionDecoder(RecurrentDecoder):
    """Code and video to joints: each step sees one frame and its own last pose.

    `condition_on_code`: each step is given the code, too, not the first state alone.
    """

    def __init__(self, features: int, joints: int, hidden: int, units: int, layers: int,
                 forget_bias: float, peepholes: bool = False,
                 condition_on_code: bool = False):  # fmt: skip
        inputs = features + joints + (hidden if condition_on_code else 0)
        super().__init__(inputs, joints, hidden, units, layers, forget_bias, peepholes)
        self.seen = features + joints  # the inputs before the code
        self.condition_on_code = condition_on_code

    def forward(
        self,
        code: Float[Tensor, "B H"],
        video: Float[Tensor, "B T F"],
        start: Float[Tensor, "B 5"],
    ) -> Float[Tensor, "B T 5"]:
        """Poses 2 to T+1, in -1 to 1."""
        states, pose, poses = self.first_state(code), start, []
        # unbind once: indexing video[:, t] in the loop makes the backward pass quadratic in T
        for frame in video.unbind(dim=1):
            pose, states = self.move(code, frame, pose, states)
            poses.append(pose)
        return torch.stack(poses, dim=1)

    def move(self, code, frame: Float[Tensor, "B F"], pose: Float[Tensor, "B 5"], states: list):
        """One step: the next pose, and the new states."""
        inputs = [frame, pose, code] if self.condition_on_code else [frame, pose]
        raw, states = self.step(torch.cat(inputs, dim=1), states)
        return torch.tanh(raw), states

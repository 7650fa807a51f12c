"""The two decoders: LSTMs that start from the code and take their own last output as input.

There is no teacher forcing: neither decoder sees the true last output, in training or in the test
(as published).
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ptae_lite.language import EOS, VOCABULARY
from ptae_lite.models.recurrent import make_cell


class RecurrentDecoder(nn.Module):
    """LSTM layers whose first state is a linear map of the code.

    Args:
        inputs: length of the input of a step.
        outputs: length of the output of a step.
        hidden: length H of the code.
        units: length of the state of a layer.
        forget_bias: see `recurrent.make_cell`.
        peepholes: whether the gates see the memory, as in PGAE and PVAE.
    """

    def __init__(self, inputs: int, outputs: int, hidden: int, units: int, layers: int,
                 forget_bias: float, peepholes: bool):  # fmt: skip
        super().__init__()
        self.units = units
        self.start = nn.Linear(hidden, layers * 2 * units)
        sizes = [inputs] + [units] * (layers - 1)
        self.cells = nn.ModuleList(make_cell(size, units, forget_bias, peepholes) for size in sizes)
        self.output = nn.Linear(units, outputs)

    def first_state(self, code: Float[Tensor, "B H"]) -> list[tuple[Tensor, Tensor]]:
        """Hidden state and memory of each layer, (B, units) each."""
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
    """Code to words. A step gets the probabilities of the last step, not its most likely word."""

    def __init__(self, hidden: int, units: int, layers: int, forget_bias: float,
                 peepholes: bool = False):  # fmt: skip
        words = len(VOCABULARY)
        super().__init__(words, words, hidden, units, layers, forget_bias, peepholes)

    def forward(self, code: Float[Tensor, "B H"], steps: int) -> Float[Tensor, "B N V"]:
        """Logarithms of the word probabilities at each of `steps` steps. The first input is BOS."""
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
    """Code and video to joints. Each step gets one frame of the video and the decoder's last pose.

    Args:
        features: visual features a frame, F.
        joints: joints, J.
        condition_on_code: each step also gets the code, not only the first state (ours).
    """

    def __init__(self, features: int, joints: int, hidden: int, units: int, layers: int,
                 forget_bias: float, peepholes: bool = False,
                 condition_on_code: bool = False):  # fmt: skip
        inputs = features + joints + (hidden if condition_on_code else 0)
        super().__init__(inputs, joints, hidden, units, layers, forget_bias, peepholes)
        self.seen = features + joints  # inputs without the code
        self.condition_on_code = condition_on_code

    def forward(
        self,
        code: Float[Tensor, "B H"],
        video: Float[Tensor, "B T F"],
        start: Float[Tensor, "B 5"],
    ) -> Float[Tensor, "B T 5"]:
        """Poses 2 to T + 1, values -1 to 1.

        Args:
            video: features that each step sees.
            start: the first pose.
        """
        states, pose, poses = self.first_state(code), start, []
        # unbind once: video[:, t] in the loop would make the backward pass quadratic in T
        for frame in video.unbind(dim=1):
            pose, states = self.move(code, frame, pose, states)
            poses.append(pose)
        return torch.stack(poses, dim=1)

    def move(self, code, frame: Float[Tensor, "B F"], pose: Float[Tensor, "B 5"], states: list):
        """One step: the next pose (B, 5), and the new states."""
        inputs = [frame, pose, code] if self.condition_on_code else [frame, pose]
        raw, states = self.step(torch.cat(inputs, dim=1), states)
        return torch.tanh(raw), states

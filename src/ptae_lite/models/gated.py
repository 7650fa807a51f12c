"""The gated multimodal unit: for each number of the code, which modality may say it?

    code = z * tanh(A a + b_a) + (1 - z) * tanh(L l + b_l),    z = sigmoid(G [a, l] + b_g)

a and l sum up the action and the language.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn


class GatedUnit(nn.Module):
    """Two summaries, of the action and of the language, to one code of `size` numbers."""

    def __init__(self, action: int, language: int, size: int):
        super().__init__()
        self.action = nn.Linear(action, size)
        self.language = nn.Linear(language, size)
        self.gate = nn.Linear(action + language, size)

    def forward(
        self, action: Float[Tensor, "B A"], language: Float[Tensor, "B L"]
    ) -> Float[Tensor, "B H"]:
        gate = torch.sigmoid(self.gate(torch.cat([action, language], dim=1)))
        return gate * torch.tanh(self.action(action)) + (1 - gate) * torch.tanh(
            self.language(language)
        )

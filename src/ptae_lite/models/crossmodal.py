"""The crossmodal transformer: words ask, the moving picture answers.

Queries come from language, keys and values from vision and joints together (paper, section 3.2):

    attention(Q, K, V) = softmax(Q K^T / sqrt(d)) V,   d = 64 for each of 4 heads

One layer, then the mean over the query tokens gives the code `h` that both decoders start from.
There is no mask on keys and no position on them: keys are an unordered set, and the zero padding
of short clips is attended to. That padding is how speed gets into `h`.
"""

from __future__ import annotations

import math

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional


def positions(count: int, size: int) -> Float[Tensor, "N H"]:
    """The fixed sinusoids of the original transformer, sine and cosine interleaved."""
    place = torch.arange(count)[:, None]
    rate = torch.exp(torch.arange(0, size, 2) * (-math.log(10000.0) / size))
    code = torch.zeros(count, size)
    code[:, 0::2], code[:, 1::2] = torch.sin(place * rate), torch.cos(place * rate)
    return code


class Attention(nn.Module):
    """Multi-head attention with separate projections for query, key, value and output."""

    def __init__(self, hidden: int, heads: int):
        super().__init__()
        self.heads = heads
        self.query, self.key, self.value, self.output = (
            nn.Linear(hidden, hidden) for _ in range(4)
        )
        for linear in (self.query, self.key, self.value, self.output):
            nn.init.xavier_normal_(linear.weight)
            nn.init.zeros_(linear.bias)

    def _split(self, x: Float[Tensor, "B N H"]) -> Float[Tensor, "B heads N d"]:
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)

    def forward(self, query: Float[Tensor, "B N H"], keys: Float[Tensor, "B T H"]):
        """Attended values (B, N, H) and the weights (B, heads, N, T) that made them."""
        q, k, v = self._split(self.query(query)), self._split(self.key(keys)), self.value(keys)
        weights = torch.softmax(q @ k.transpose(-1, -2) / math.sqrt(q.shape[-1]), dim=-1)
        mixed = (weights @ self._split(v)).transpose(1, 2).flatten(-2)
        return self.output(mixed), weights


class CrossmodalTransformer(nn.Module):
    """Query tokens and frames to one code.

    Post-norm residuals on the query side as in the original transformer. Both embeddings share one
    LayerNorm, as the published code does (the paper's equations leave it out).
    """

    def __init__(self, tokens: int, inputs: int, hidden: int, heads: int, feed_forward: int,
                 dropout: float):  # fmt: skip
        super().__init__()
        self.embed_token = nn.Linear(tokens, hidden)
        self.embed_frame = nn.Linear(inputs, hidden)
        self.embed_norm = nn.LayerNorm(hidden)
        self.attention = Attention(hidden, heads)
        self.attention_norm = nn.LayerNorm(hidden)
        self.widen = nn.Linear(hidden, feed_forward)
        self.narrow = nn.Linear(feed_forward, hidden)
        self.output_norm = nn.LayerNorm(hidden)
        self.dropout = nn.Dropout(dropout)
        self.register_buffer("positions", positions(16, hidden), persistent=False)

    def _embed(self, linear, x):
        return self.embed_norm(self.dropout(functional.relu(linear(x))))

    def forward(
        self,
        tokens: Int[Tensor, "B N"],
        token_mask: Bool[Tensor, "B N"],
        keys: Float[Tensor, "B T K"],
        attend=Attention.__call__,
    ):
        """The code h (B, H) and the attention weights (B, heads, N, T).

        `attend(attention, query, keys)` may be another form of the same (see `fast`).
        """
        one_hot = functional.one_hot(tokens, self.embed_token.in_features).to(keys.dtype)
        x = self._embed(self.embed_token, one_hot) + self.positions[: tokens.shape[1]]
        attended, weights = attend(self.attention, x, self._embed(self.embed_frame, keys))
        x = self.attention_norm(x + self.dropout(attended))
        fed = self.narrow(self.dropout(functional.relu(self.widen(x))))
        x = self.output_norm(x + self.dropout(fed))
        there = token_mask[..., None].to(x.dtype)
        return (x * there).sum(1) / there.sum(1), weights

"""The crossmodal transformer: words ask, the moving picture answers.

Queries come from language, keys and values from vision and joints together (paper, section 3.2)::

    attention(Q, K, V) = softmax(Q K^T / sqrt(d)) V,   d = 64 for each of 4 heads

One layer, then the mean over the query tokens gives the code `h` that both decoders start from.
There is no mask on keys and no position on them: keys are an unordered set, and the zero padding
of short clips is attended to. That padding is how speed gets into `h`.

Choices change that, each for an experiment: `queries` from action lets the frames ask the words,
`TwoWay` does both at once, and `frame_positions` gives frames their position and masks the
padding.
"""

from __future__ import annotations

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite.data.samples import MAX_FRAMES


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

    def forward(
        self,
        query: Float[Tensor, "B N H"],
        keys: Float[Tensor, "B T H"],
        mask: Bool[Tensor, "B T"] | None = None,
    ):
        """Attended values (B, N, H) and the weights (B, heads, N, T) that made them.

        `mask` says which keys may be looked at; all if None.
        """
        q, k, v = self._split(self.query(query)), self._split(self.key(keys)), self.value(keys)
        scores = q @ k.transpose(-1, -2) / math.sqrt(q.shape[-1])
        if mask is not None:
            scores = scores.masked_fill(~mask[:, None, None], -torch.inf)
        weights = torch.softmax(scores, dim=-1)
        mixed = (weights @ self._split(v)).transpose(1, 2).flatten(-2)
        return self.output(mixed), weights


class CrossmodalTransformer(nn.Module):
    """Tokens and frames to one code.

    Post-norm residuals on the query side as in the original transformer. Both embeddings share one
    LayerNorm, as the published code does (the paper's equations leave it out).
    """

    def __init__(self, words: int, inputs: int, hidden: int, heads: int, feed_forward: int,
                 dropout: float, queries: str = "language",
                 frame_positions: bool = False):  # fmt: skip
        super().__init__()
        self.queries, self.frame_positions = queries, frame_positions
        self.embed_token = nn.Linear(words, hidden)
        self.embed_frame = nn.Linear(inputs, hidden)
        self.embed_norm = nn.LayerNorm(hidden)
        self.attention = Attention(hidden, heads)
        self.attention_norm = nn.LayerNorm(hidden)
        self.widen = nn.Linear(hidden, feed_forward)
        self.narrow = nn.Linear(feed_forward, hidden)
        self.output_norm = nn.LayerNorm(hidden)
        self.dropout = nn.Dropout(dropout)
        self.register_buffer("positions", positions(MAX_FRAMES, hidden), persistent=False)

    def embed(self, linear: nn.Linear, rows: Float[Tensor, "B N I"], placed: bool):
        """Rows of one modality, (B, N, H); `placed`: with the position of each."""
        x = self.embed_norm(self.dropout(functional.relu(linear(rows))))
        return x + self.positions[: rows.shape[1]] if placed else x

    def finish(self, x: Float[Tensor, "... H"], attended: Float[Tensor, "... H"]):
        """The rest of the layer, for each query by itself."""
        x = self.attention_norm(x + self.dropout(attended))
        fed = self.narrow(self.dropout(functional.relu(self.widen(x))))
        return self.output_norm(x + self.dropout(fed))

    def forward(
        self,
        words: Float[Tensor, "B N W"],
        word_mask: Bool[Tensor, "B N"],
        frames: Float[Tensor, "B T K"],
        frame_mask: Bool[Tensor, "B T"],
    ):
        """The code h (B, H) and the attention weights (B, heads, N, T); T, N if frames ask."""
        if self.queries == "language":
            x, there = self.embed(self.embed_token, words, True), word_mask
            keys = self.embed(self.embed_frame, frames, self.frame_positions)
            mask = frame_mask if self.frame_positions else None
        else:
            x, there = self.embed(self.embed_frame, frames, True), frame_mask
            keys, mask = self.embed(self.embed_token, words, False), word_mask
        attended, weights = self.attention(x, keys, mask)
        there = there[..., None].to(x.dtype)
        return (self.finish(x, attended) * there).sum(1) / there.sum(1), weights


class TwoWay(nn.Module):
    """Words ask the frames, frames ask the words: the attention that the paper's discussion names.

    Two crossmodal transformers of one layer, each with weights of its own. Each pools its queries
    to a code, and h is the mean of the two codes. (The paper proposes the two directions and does
    not build them. A mean needs no further weights, and takes neither side.)
    """

    def __init__(self, *sizes, frame_positions: bool = False):
        super().__init__()
        self.words_ask = CrossmodalTransformer(*sizes, "language", frame_positions)
        self.frames_ask = CrossmodalTransformer(*sizes, "action")

    def forward(
        self,
        words: Float[Tensor, "B N W"],
        word_mask: Bool[Tensor, "B N"],
        frames: Float[Tensor, "B T K"],
        frame_mask: Bool[Tensor, "B T"],
    ):
        """The code h (B, H), and the weights (B, heads, N, T) with which words look at frames."""
        seen = (words, word_mask, frames, frame_mask)
        (code, weights), (other, _) = self.words_ask(*seen), self.frames_ask(*seen)
        return (code + other) / 2, weights

"""The crossmodal transformer: attention of the words to the clip.

Queries come from language, keys and values from vision and joints together (paper, section 3.2)::

    attention(Q, K, V) = softmax(Q K^T / sqrt(d)) V,   d = 64 for each of 4 heads

There is one layer. The mean of its output over the query tokens is the code `h`, from which both
decoders start. Keys have no mask and no position: the model sees a set of frames without order. It
also attends to the zero padding of short clips, and this padding is how it knows the speed.

Three choices change this, each for an experiment. With `queries="action"` the frames ask and the
words answer. `TwoWay` does both. `frame_positions` gives frames their position and hides the
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
    """The fixed position code of the original transformer: sines and cosines in turn.

    ::

        code[n, 2i] = sin(n / 10000^(2i / H)),    code[n, 2i + 1] = cos(n / 10000^(2i / H))
    """
    place = torch.arange(count)[:, None]
    rate = torch.exp(torch.arange(0, size, 2) * (-math.log(10000.0) / size))
    code = torch.zeros(count, size)
    code[:, 0::2], code[:, 1::2] = torch.sin(place * rate), torch.cos(place * rate)
    return code


class Attention(nn.Module):
    """Multi-head attention, with separate linear maps for query, key, value and output."""

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
        """Attended values (B, N, H) and the attention weights (B, heads, N, T).

        Args:
            mask: which keys may be attended to; None means all.
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

    The query side has residuals with the LayerNorm after them, as in the original transformer. The
    two embeddings share one LayerNorm, as in the published code; the paper's equations leave it
    out.

    Args:
        words: numbers W a token.
        inputs: numbers K a frame.
        hidden: length H of the code.
        feed_forward: width of the layer's feed-forward part.
        queries: `language`, or `action` if the frames ask.
        frame_positions: frames have a position, and padding is hidden (ours).
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
        """Embed the rows of one modality: `LayerNorm(dropout(ReLU(W x + b)))`, (B, N, H).

        Args:
            placed: add the position code.
        """
        x = self.embed_norm(self.dropout(functional.relu(linear(rows))))
        return x + self.positions[: rows.shape[1]] if placed else x

    def finish(self, x: Float[Tensor, "... H"], attended: Float[Tensor, "... H"]):
        """The rest of the layer, after the attention: residuals and the feed-forward part."""
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
        """The code `h` (B, H) and the attention weights.

        The weights are (B, heads, N, T), or (B, heads, T, N) if the frames ask.
        """
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
    """Attention both ways: words ask the frames, and frames ask the words.

    The paper's discussion proposes this and does not build it. Here it is two crossmodal
    transformers of one layer with separate weights. The code `h` is the mean of their two codes: a
    mean needs no further weights and prefers neither of them (ours).
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
        """The code `h` (B, H), and the words' attention weights (B, heads, N, T) for the frames."""
        seen = (words, word_mask, frames, frame_mask)
        (code, weights), (other, _) = self.words_ask(*seen), self.frames_ask(*seen)
        return (code + other) / 2, weights

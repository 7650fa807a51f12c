"""Faster forms of parts of the models, for training. The other modules are easier to read.

They compute the same values and gradients, up to rounding; a test compares them with the readable
forms. (One difference: with dropout, equal frames share one mask here.)

With the readable forms, a training step takes 2.4 times as long for PTAE, 2.0 times for PGAE and
1.8 times for PVAE (medians of processor time, one thread, the batches of the recipes).

`encode` computes the code of PTAE:

- There are few queries and many frames. So it applies the key map to the queries instead of the
  frames (q . W x = W^T q . x), and the value map to the mixed frames. It leaves out the key bias,
  which adds the same number to all scores of a query: softmax does not change.
- A first frame that is repeated for the whole clip is one key, and so is the padding. A key that
  stands for n equal keys has log n added to its score.
- If frames are queries, those in the padding are not computed.

`decode_fast` and `encode_fast` compute the recurrent layers. They skip the padding, see `packed`.
"""

from __future__ import annotations

import math

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite.data.signals import Batch
from ptae_lite.models.crossmodal import Attention, CrossmodalTransformer, TwoWay
from ptae_lite.models.decoders import ActionDecoder
from ptae_lite.models.packed import Layer, Packed, Unroll
from ptae_lite.models.recurrent import PeepholeCell, RecurrentEncoder


def encode(encoder: CrossmodalTransformer | TwoWay, words_in, batch: Batch):
    """The code (B, H) of a batch, for an `encoder` without `frame_positions`.

    Args:
        words_in: the language encoder, see `encoders`.
    """
    if isinstance(encoder, TwoWay):
        asked = _words_ask(encoder.words_ask, words_in, batch)
        return (asked + _frames_ask(encoder.frames_ask, words_in, batch)) / 2
    ask = _words_ask if encoder.queries == "language" else _frames_ask
    return ask(encoder, words_in, batch)


def _frames_ask(encoder: CrossmodalTransformer, words_in, batch: Batch):
    """The code if frames are queries: clips of one length together, without padding."""
    words = words_in(batch.tokens, batch.token_mask).to(batch.keys.dtype)
    codes, groups = [], []
    for count in batch.frames.unique().tolist():
        groups.append((batch.frames == count).nonzero()[:, 0])
        keys = batch.keys[groups[-1], :count]
        inside = torch.ones_like(keys[..., 0], dtype=torch.bool)
        mask = batch.token_mask[groups[-1]]
        codes.append(encoder(words[groups[-1]], mask, keys, inside)[0])
    return torch.cat(codes)[torch.cat(groups).argsort()]


def _words_ask(encoder: CrossmodalTransformer, words_in, batch: Batch) -> Float[Tensor, "B H"]:
    """The code if words are queries.

    Samples with as many tokens and as many different keys are computed together. Work on single
    tokens is done for all samples at once.
    """
    still = (batch.keys[:, 1:] == batch.keys[:, :1]).all(2)
    frame = torch.arange(1, batch.keys.shape[1], device=batch.frames.device)
    still |= frame >= batch.frames[:, None]
    keys = torch.where(still.all(1), 1, batch.frames)
    kinds = torch.stack([keys, batch.token_mask.sum(1)], dim=1)
    groups = [(kinds == kind).all(1).nonzero()[:, 0] for kind in kinds.unique(dim=0)]
    asked, found = [], []
    for group in groups:
        tokens = batch.tokens[group, : int(kinds[group[0], 1])]
        words = words_in(tokens, torch.ones_like(tokens, dtype=torch.bool)).to(batch.keys.dtype)
        x = encoder.embed(encoder.embed_token, words, True)
        frames, times = _distinct(batch, group, int(keys[group[0]]))
        embedded = encoder.embed(encoder.embed_frame, frames, False)
        found.append(_attend(encoder.attention, x, embedded, times))
        asked.append(x.flatten(0, 1))
    rows = encoder.finish(torch.cat(asked), encoder.attention.output(torch.cat(found)))
    parts = rows.split([len(x) for x in asked])
    codes = [x.unflatten(0, (len(g), -1)).mean(1) for x, g in zip(parts, groups, strict=True)]
    return torch.cat(codes)[torch.cat(groups).argsort()]


def _distinct(batch: Batch, group, count: int):
    """The different keys of a group, and the logarithm of how often each stands in the clip."""
    total, frames = batch.keys.shape[1], batch.frames[group]
    keys = batch.keys[group, :count]
    if count == total:
        return keys, None
    padding = keys.new_zeros(len(group), 1, keys.shape[2])
    times = keys.new_ones(len(group), count + 1)
    times[:, 0], times[:, -1] = frames - count + 1, total - frames
    return torch.cat([keys, padding], dim=1), times.log()


def _attend(attention: Attention, query: Float[Tensor, "B N H"], keys, times):
    """What `attention` gives each token before its output map: rows (B x N, H)."""
    heads, width = attention.heads, query.shape[-1]
    by_head = (heads, width // heads, width)
    asked = attention.query(query).unflatten(-1, by_head[:2])  # B N heads d
    asked = torch.einsum("bnhd,hdk->bhnk", asked, attention.key.weight.view(by_head))
    scores = asked.flatten(1, 2) @ keys.transpose(1, 2) / math.sqrt(by_head[1])
    if times is not None:
        scores = scores + times[:, None]
    mixed = (torch.softmax(scores, dim=-1) @ keys).unflatten(1, (heads, -1))
    mixed = torch.einsum("bhnk,hdk->bnhd", mixed, attention.value.weight.view(by_head))
    return (mixed.flatten(-2) + attention.value.bias).flatten(0, 1)


def decode_fast(decoder: ActionDecoder, code, batch: Batch) -> Float[Tensor, "B T J"]:
    """The result of `decoder(code, batch.video, batch.start)` where `batch.step_mask`, else 0."""
    if len(decoder.cells) != 2:  # only the published two layers have a fast form
        return decoder(code, batch.video, batch.start) * batch.step_mask[..., None]
    packed = Packed.of(batch.step_mask.sum(1))
    features, inputs = batch.video.shape[2], decoder.seen
    states = [part[packed.order] for layer in decoder.first_state(code) for part in layer]
    (ih1, hh1, bias1, peep1), (ih2, hh2, bias2, peep2) = map(_parts, decoder.cells)
    # what the first layer's gates get from the video: one matrix product for all frames
    video = batch.video[packed.sample, packed.step]
    seen = functional.linear(video, ih1[:, :features], bias1)
    if decoder.condition_on_code:
        seen = seen + functional.linear(code, ih1[:, inputs:])[packed.sample]
    poses = Unroll.apply(
        packed.spans, seen,
        batch.start[packed.order], *states,
        torch.cat([hh1, ih1[:, features:inputs]], dim=1),  # of h1 and the pose
        torch.cat([ih2, hh2], dim=1),  # of the new h1 and h2
        bias2, peep1, peep2, decoder.output.weight, decoder.output.bias,
    )  # fmt: skip
    answer = poses.new_zeros(*batch.step_mask.shape, poses.shape[1])
    return answer.index_put((packed.sample, packed.step), poses)


def encode_fast(
    encoder: RecurrentEncoder, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]
):
    """The result of `encoder(rows, lengths)`."""
    packed = Packed.of(lengths)
    hidden = rows[packed.sample, packed.step]
    ends = torch.empty_like(lengths)
    over = packed.step == lengths[packed.sample] - 1
    ends[packed.sample[over]] = over.nonzero()[:, 0]
    parts = []
    for cell in encoder.cells:
        weight_ih, weight_hh, bias, peep = _parts(cell)
        hidden, memory = Layer.apply(
            packed.spans, functional.linear(hidden, weight_ih, bias), weight_hh, peep
        )
        parts += [memory[ends], hidden[ends]]
    return torch.cat(parts, dim=1)


def _parts(cell: nn.Module):
    """A cell's input weights, recurrent weights, bias and peepholes, with its gates reordered.

    The order is o, i, f, g. So the three sigmoid gates stand side by side, and so do the three that
    make the memory.
    """

    def order(rows):
        i, f, g, o = rows.chunk(4)
        return torch.cat([o, i, f, g])

    if isinstance(cell, PeepholeCell):
        maps = cell.weight_ih.weight, cell.weight_hh.weight, cell.weight_ih.bias
        return *map(order, maps), cell.peepholes
    return *map(order, (cell.weight_ih, cell.weight_hh, cell.bias_ih + cell.bias_hh)), None

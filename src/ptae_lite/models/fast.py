"""The same models, computed faster: what training uses. The other modules are the ones to read.

Nothing here changes what is computed, and a test holds each form equal to the readable one, values
and gradients. (With dropout, equal frames are dropped alike here, each for itself there.)

The way to the code, `encode`:

- Attention asks few questions of many frames. So the key map is applied to the questions, not to
  the frames (q . W x = W^T q . x), and the value map to the mixed frames. The key bias adds the
  same to all frames, and softmax does not see it.
- A first frame that stands still for the whole clip is one key, and so is the padding. A key that
  is there n times has log n added to its score.
- Frames that ask are not computed beyond the end of their clip.

Recurrent layers, `act` and `summarise`, take up to 100 steps. Clips are sorted by length, and a
step computes only those that are not over. Autograd would add up the gradient of each weight matrix
once a step; here the steps are kept, and one product at the end does it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn import functional

from ptae_lite.models.crossmodal import Attention, CrossmodalTransformer, TwoWay
from ptae_lite.models.decoders import ActionDecoder
from ptae_lite.models.recurrent import PeepholeCell, RecurrentEncoder
from ptae_lite.signals import Batch


def encode(encoder: CrossmodalTransformer | TwoWay, words_in, batch: Batch):
    """The code (B, H) that `encoder` makes of a batch when language asks, or both do; no clock."""
    if isinstance(encoder, TwoWay):
        asked = _words_ask(encoder.words_ask, words_in, batch)
        return (asked + _frames_ask(encoder.frames_ask, words_in, batch)) / 2
    return _words_ask(encoder, words_in, batch)


def _frames_ask(encoder: CrossmodalTransformer, words_in, batch: Batch):
    """Clips of one length go together, without their padding: by the readable form."""
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
    """Samples with as many tokens and as many different keys go through together; what works on
    tokens one by one takes all of them at once.
    """
    still = (batch.keys[:, 1:] == batch.keys[:, :1]).all(2)
    still |= torch.arange(1, batch.keys.shape[1]) >= batch.frames[:, None]
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
    """Keys of a group without their repetitions, and the logarithm of how often each is there."""
    total, frames = batch.keys.shape[1], batch.frames[group]
    keys = batch.keys[group, :count]
    if count == total:
        return keys, None
    padding = keys.new_zeros(len(group), 1, keys.shape[2])
    times = keys.new_ones(len(group), count + 1)
    times[:, 0], times[:, -1] = frames - count + 1, total - frames
    return torch.cat([keys, padding], dim=1), times.log()


def _attend(attention: Attention, query: Float[Tensor, "B N H"], keys, times):
    """What `attention` mixes for each token, before its output map, tokens in rows (B x N, H)."""
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


class Packed(NamedTuple):
    """Sequences of different lengths as rows, step by step, the longest first."""

    order: Int[Tensor, " B"]  # of the samples, the longest first
    sample: Int[Tensor, " R"]  # where each row comes from
    step: Int[Tensor, " R"]
    spans: list[tuple[int, int]]  # rows of each step: from, to

    @classmethod
    def of(cls, lengths: Int[Tensor, " B"]) -> Packed:
        order = lengths.argsort(descending=True, stable=True)
        going = torch.arange(int(lengths.max()))[:, None] < lengths[order]
        step, place = going.nonzero(as_tuple=True)
        ends = going.sum(1).cumsum(0).tolist()
        return cls(order, order[place], step, list(zip([0, *ends], ends, strict=False)))


def act(decoder: ActionDecoder, code, batch: Batch) -> Float[Tensor, "B T J"]:
    """What `decoder(code, batch.video, batch.start)` is where `batch.step_mask` is; else zero."""
    if len(decoder.cells) != 2:  # only the published two layers have a fast form
        return decoder(code, batch.video, batch.start) * batch.step_mask[..., None]
    packed = Packed.of(batch.step_mask.sum(1))
    features, inputs = batch.video.shape[2], decoder.seen
    states = [part[packed.order] for layer in decoder.first_state(code) for part in layer]
    (look1, recall1, bias1, peep1), (look2, recall2, bias2, peep2) = map(_parts, decoder.cells)
    # what of the first layer's gates comes from the video: one product for all frames
    video = batch.video[packed.sample, packed.step]
    seen = functional.linear(video, look1[:, :features], bias1)
    if decoder.reminded:
        seen = seen + functional.linear(code, look1[:, inputs:])[packed.sample]
    poses = _Unroll.apply(
        packed.spans, seen,
        batch.start[packed.order], *states,
        torch.cat([recall1, look1[:, features:inputs]], dim=1),  # of h1 and the pose
        torch.cat([look2, recall2], dim=1),  # of the new h1 and h2
        bias2, peep1, peep2, decoder.output.weight, decoder.output.bias,
    )  # fmt: skip
    answer = poses.new_zeros(*batch.step_mask.shape, poses.shape[1])
    return answer.index_put((packed.sample, packed.step), poses)


def summarise(encoder: RecurrentEncoder, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]):
    """What `encoder(rows, lengths)` is."""
    packed = Packed.of(lengths)
    hidden = rows[packed.sample, packed.step]
    ends = torch.empty_like(lengths)
    over = packed.step == lengths[packed.sample] - 1
    ends[packed.sample[over]] = over.nonzero()[:, 0]
    parts = []
    for cell in encoder.cells:
        look, recall, bias, peep = _parts(cell)
        hidden, memory = _Layer.apply(
            packed.spans, functional.linear(hidden, look, bias), recall, peep
        )
        parts += [memory[ends], hidden[ends]]
    return torch.cat(parts, dim=1)


def _parts(cell: nn.Module):
    """A cell's maps of input and hidden state, bias and peepholes, gates in the order i, f, o, g.

    So the three gates that are sigmoids lie side by side.
    """

    def order(rows):
        i, f, g, o = rows.chunk(4)
        return torch.cat([i, f, o, g])

    if isinstance(cell, PeepholeCell):
        maps = cell.look.weight, cell.recall.weight, cell.look.bias
        return *map(order, maps), cell.peepholes
    return *map(order, (cell.weight_ih, cell.weight_hh, cell.bias_ih + cell.bias_hh)), None


class _Tape:
    """One layer's steps, kept for the way back; R rows, U units. Views are cut once, not a step."""

    def __init__(self, spans, gates: Float[Tensor, "R G"], peep):
        self.gates, self.peep = gates, peep
        self.units = u = gates.shape[1] // 4
        self.before, self.after, self.squashed = (gates.new_empty(len(gates), u) for _ in range(3))
        parts = (gates, gates[:, : 2 * u].unflatten(1, (2, u)), gates[:, : 3 * u],
                 *gates.split(u, dim=1), self.before, self.after, self.squashed)  # fmt: skip
        self.steps = steps_of(spans, *parts)
        self.one = gates.new_ones(())

    def forward(self, t: int, before, hidden) -> None:
        """Turn the gates of step t into activations; `hidden` is filled."""
        _, both, sigmoids, i, f, o, g, kept, after, squashed = self.steps[t]
        kept.copy_(before)
        if self.peep is None:
            sigmoids.sigmoid_()
        else:
            both.addcmul_(before[:, None], self.peep[:2]).sigmoid_()
        g.tanh_()
        torch.mul(f, before, out=after)
        after.addcmul_(i, g)
        if self.peep is not None:
            o.addcmul_(after, self.peep[2]).sigmoid_()
        torch.tanh(after, out=squashed)
        torch.mul(o, squashed, out=hidden)

    def slopes(self, spans):
        """Room for the gradients of the gates, and its views of each step."""
        made, u = torch.empty_like(self.gates), self.units
        return made, steps_of(spans, made, made[:, : 3 * u], *made.split(u, dim=1))

    def backward(self, t: int, hidden, cell, slopes) -> None:
        """Fill the slopes of step t; `cell` becomes the gradient of the memory one step earlier."""
        _, _, sigmoids, i, f, o, g, before, _, squashed = self.steps[t]
        _, to_sigmoids, to_i, to_f, to_o, to_g = slopes
        torch.addcmul(sigmoids, sigmoids, sigmoids, value=-1, out=to_sigmoids)
        torch.addcmul(self.one, g, g, value=-1, out=to_g)
        to_o.mul_(squashed).mul_(hidden)
        cell.addcmul_(torch.addcmul(self.one, squashed, squashed, value=-1).mul_(o), hidden)
        if self.peep is not None:
            cell.addcmul_(to_o, self.peep[2])
        to_i.mul_(g).mul_(cell)
        to_f.mul_(before).mul_(cell)
        to_g.mul_(i).mul_(cell)
        cell.mul_(f)
        if self.peep is not None:
            cell.addcmul_(to_i, self.peep[0]).addcmul_(to_f, self.peep[1])

    def peep_gradient(self, slopes):
        if self.peep is None:
            return None
        to_i, to_f, to_o, _ = slopes.split(self.units, dim=1)
        seen = ((to_i, self.before), (to_f, self.before), (to_o, self.after))
        return torch.stack([(slope * memory).sum(0) for slope, memory in seen])


def steps_of(spans, *rows: Tensor) -> list[tuple[Tensor, ...]]:
    """The rows of each step, for each of the tensors."""
    sizes = [b - a for a, b in spans]
    return list(zip(*(part.split(sizes) for part in rows), strict=True))


class _Layer(torch.autograd.Function):
    """One recurrent layer over packed rows, from a state of zero: hidden states and memories."""

    @staticmethod
    def forward(ctx, spans, seen, recall, peep):
        tape = _Tape(spans, seen.clone(), peep)
        hidden = seen.new_empty(len(seen), tape.units)
        turns = [h for (h,) in steps_of(spans, hidden)]
        memory = seen.new_zeros(len(turns[0]), tape.units)
        for t, now in enumerate(turns):
            n = len(now)
            if t:
                tape.steps[t][0].addmm_(turns[t - 1][:n], recall.T)
            tape.forward(t, memory[:n], now)
            memory = tape.steps[t][-2]
        ctx.tape, ctx.spans = tape, spans
        ctx.save_for_backward(hidden, recall)
        return hidden, tape.after.clone()  # the tape must not hold what autograd hands out

    @staticmethod
    @once_differentiable
    def backward(ctx, to_hidden, to_memory):
        tape, spans = ctx.tape, ctx.spans
        hidden, recall = ctx.saved_tensors
        made, slopes = tape.slopes(spans)
        earlier = torch.zeros_like(hidden)  # each row's hidden state one step before
        steps = steps_of(spans, hidden, earlier, to_hidden, to_memory)
        h, c = (hidden.new_zeros(spans[0][1], tape.units) for _ in range(2))
        for t in reversed(range(len(spans))):
            _, before, from_hidden, from_memory = steps[t]
            n = len(before)
            c[:n] += from_memory
            tape.backward(t, h[:n] + from_hidden, c[:n], slopes[t])
            if t:
                torch.mm(slopes[t][0], recall, out=h[:n])
                before.copy_(steps[t - 1][0][:n])
        return None, made, made.T @ earlier, tape.peep_gradient(made)


class _Unroll(torch.autograd.Function):
    """Two recurrent layers and a tanh output that is fed back, over packed rows."""

    @staticmethod
    def forward(ctx, spans, seen, start, h1, c1, h2, c2, w1, w2, b2, peep1, peep2, wo, bo):
        rows, units, joints = len(seen), h1.shape[1], start.shape[1]
        # inputs of each product, side by side: [h1 | pose] and [h1 | h2]
        in1, in2 = seen.new_empty(rows, units + joints), seen.new_empty(rows, 2 * units)
        first = _Tape(spans, seen.clone(), peep1)
        second = _Tape(spans, seen.new_empty(rows, 4 * units), peep2)
        out, poses = seen.new_empty(rows, units), seen.new_empty(rows, joints)
        steps = steps_of(spans, in1, in1[:, :units], in1[:, units:],
                         in2, in2[:, :units], in2[:, units:], out, poses)  # fmt: skip
        w1, w2 = w1.T.contiguous(), w2.T.contiguous()
        pose, hidden1, hidden2 = start, h1, h2
        for t, (to1, was1, posed, to2, now1, was2, now2, pose_out) in enumerate(steps):
            n = len(to1)
            was1.copy_(hidden1[:n]), posed.copy_(pose[:n]), was2.copy_(hidden2[:n])
            gates1, gates2 = first.steps[t][0], second.steps[t][0]
            gates1.addmm_(to1, w1)
            first.forward(t, c1[:n], now1)
            torch.addmm(b2, to2, w2, out=gates2)
            second.forward(t, c2[:n], now2)
            torch.addmm(bo, now2, wo.T, out=pose_out).tanh_()
            c1, c2 = first.steps[t][-2], second.steps[t][-2]
            pose, hidden1, hidden2 = pose_out, now1, now2
        ctx.tapes, ctx.spans = (first, second), spans
        ctx.save_for_backward(in1, in2, out, poses, w1, w2, wo)
        return poses

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        (first, second), spans = ctx.tapes, ctx.spans
        in1, in2, out, poses, w1, w2, wo = ctx.saved_tensors
        w1, w2 = w1.T.contiguous(), w2.T.contiguous()
        units, batch = out.shape[1], spans[0][1]
        grads = torch.empty_like(poses)
        made1, slopes1 = first.slopes(spans)
        made2, slopes2 = second.slopes(spans)
        steps = steps_of(spans, grad, 1 - poses.square(), grads)
        back1 = in1.new_zeros(batch, in1.shape[1])  # to h1 and the pose of the step before
        back2 = in2.new_zeros(batch, 2 * units)
        c1, c2 = (in1.new_zeros(batch, units) for _ in range(2))
        for t in reversed(range(len(spans))):
            from_pose, steep, to_pose = steps[t]
            n = len(to_pose)
            torch.mul(from_pose + back1[:n, units:], steep, out=to_pose)
            second.backward(t, torch.addmm(back2[:n, units:], to_pose, wo), c2[:n], slopes2[t])
            torch.mm(slopes2[t][0], w2, out=back2[:n])
            first.backward(t, back1[:n, :units] + back2[:n, :units], c1[:n], slopes1[t])
            torch.mm(slopes1[t][0], w1, out=back1[:n])
        return (
            None, made1, back1[:, units:], back1[:, :units], c1, back2[:, units:], c2,
            made1.T @ in1, made2.T @ in2, made2.sum(0),
            first.peep_gradient(made1), second.peep_gradient(made2), grads.T @ out, grads.sum(0),
        )  # fmt: skip

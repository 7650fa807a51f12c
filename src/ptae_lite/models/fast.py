"""The same PTAE, computed faster: what training uses. `ptae.py` is the form to read.

Two things are rearranged, and a test holds both equal to the readable form, values and gradients.

- Attention asks few questions of many frames: 2 to 6 tokens of 100 frames. So the key map is
  applied to the questions, not to the frames (q . W x = W^T q . x), and the value map to the mixed
  frames. The key bias adds the same to all frames, and softmax does not see it.
- The action decoder takes 99 steps. Autograd would add up the gradient of each weight matrix 99
  times; here the steps are kept, and one product at the end does it.
"""

from __future__ import annotations

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn import functional

from ptae_lite.models.common import Answer
from ptae_lite.models.crossmodal import Attention
from ptae_lite.models.decoders import ActionDecoder
from ptae_lite.signals import WORDS_OUT, Batch


def answer(model: nn.Module, batch: Batch) -> Answer:
    """What `model(batch)` is for a PTAE, up to rounding."""
    code, attention = model.encoder(batch.tokens, batch.token_mask, batch.keys, attend=attend)
    words = model.language(code, WORDS_OUT)
    joints = act(model.action, code, batch.video, batch.start)
    return Answer(words, joints, code, attention)


def attend(attention: Attention, query: Float[Tensor, "B N H"], keys: Float[Tensor, "B T H"]):
    """What `attention(query, keys)` is."""
    heads, width = attention.heads, query.shape[-1]
    by_head = (heads, width // heads, width)
    asked = attention.query(query).unflatten(-1, by_head[:2])  # B N heads d
    asked = torch.einsum("bnhd,hdk->bhnk", asked, attention.key.weight.view(by_head))
    scores = asked.flatten(1, 2) @ keys.transpose(1, 2) / math.sqrt(by_head[1])
    weights = torch.softmax(scores, dim=-1)  # B heads*N T
    mixed = (weights @ keys).unflatten(1, (heads, -1))
    mixed = torch.einsum("bhnk,hdk->bnhd", mixed, attention.value.weight.view(by_head))
    return attention.output(mixed.flatten(-2) + attention.value.bias), weights.unflatten(
        1, (heads, -1)
    )


def act(decoder: ActionDecoder, code, video: Float[Tensor, "B T F"], start: Float[Tensor, "B J"]):
    """What `decoder(code, video, start)` is."""
    if len(decoder.cells) != 2:  # only the paper's two layers have a fast form
        return decoder(code, video, start)
    (h1, c1), (h2, c2) = decoder.first_state(code)
    first, second = decoder.cells
    frames = video.shape[2]
    # what of the first layer's gates comes from the video: one product for all frames
    seen = functional.linear(
        video.transpose(0, 1), first.weight_ih[:, :frames], first.bias_ih + first.bias_hh
    )
    w1 = torch.cat([first.weight_hh, first.weight_ih[:, frames:]], dim=1)  # of h1 and the pose
    w2 = torch.cat([second.weight_ih, second.weight_hh], dim=1)  # of the new h1 and h2
    output = decoder.output
    poses = _Unroll.apply(
        seen, start, h1, c1, h2, c2, w1, w2, second.bias_ih + second.bias_hh,
        output.weight, output.bias,
    )  # fmt: skip
    return poses.transpose(0, 1)


class _Unroll(torch.autograd.Function):
    """Two LSTM layers and a tanh output that is fed back; gates in torch's order i, f, g, o.

    Time first: `seen` is (T, B, 4U), the poses that come out (T, B, J).
    """

    @staticmethod
    def forward(ctx, seen, start, h1, c1, h2, c2, w1, w2, b2, wo, bo):
        steps, batch, units = len(seen), len(start), h1.shape[1]
        joints = start.shape[1]
        # inputs of each product, side by side: [h1 | pose] and [h1 | h2]
        in1 = seen.new_empty(steps + 1, batch, units + joints)
        in2 = seen.new_empty(steps + 1, batch, 2 * units)
        gates1, gates2 = seen.clone(), seen.new_empty(steps, batch, 4 * units)
        cells = seen.new_empty(2, steps + 1, batch, units)
        in1[0, :, :units], in1[0, :, units:], in2[0, :, units:] = h1, start, h2
        cells[0, 0], cells[1, 0] = c1, c2
        for t in range(steps):
            gates1[t].addmm_(in1[t], w1.T)
            _cell(gates1[t], cells[0, t], cells[0, t + 1], in1[t + 1, :, :units])
            in2[t, :, :units] = in1[t + 1, :, :units]
            torch.addmm(b2, in2[t], w2.T, out=gates2[t])
            _cell(gates2[t], cells[1, t], cells[1, t + 1], in2[t + 1, :, units:])
            raw = torch.addmm(bo, in2[t + 1, :, units:], wo.T)
            torch.tanh(raw, out=raw)
            in1[t + 1, :, units:] = raw
        poses = in1[1:, :, units:].contiguous()
        ctx.save_for_backward(in1, in2, gates1, gates2, cells, poses, w1, w2, wo)
        return poses

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        in1, in2, gates1, gates2, cells, poses, w1, w2, wo = ctx.saved_tensors
        steps, batch, units = len(grad), grad.shape[1], cells.shape[3]
        slope = 1 - poses.square()
        grads = torch.empty_like(poses)
        d1, leak1 = _slopes(gates1, cells[0])
        d2, leak2 = _slopes(gates2, cells[1])
        h2 = in2.new_zeros(batch, units)
        back1 = in1.new_zeros(batch, in1.shape[2])  # to h1 and the pose of the step before
        c1, c2 = torch.zeros_like(h2), torch.zeros_like(h2)
        for t in reversed(range(steps)):
            torch.mul(grad[t] + back1[:, units:], slope[t], out=grads[t])
            back2 = _cell_back(d2[t], leak2[t], gates2[t], h2.addmm(grads[t], wo), c2) @ w2
            h2 = back2[:, units:]
            h1 = back1[:, :units] + back2[:, :units]
            back1 = _cell_back(d1[t], leak1[t], gates1[t], h1, c1) @ w1
        flat1, flat2 = d1.flatten(0, 1), d2.flatten(0, 1)
        flat = grads.flatten(0, 1)
        return (
            d1, back1[:, units:], back1[:, :units], c1, h2, c2,
            flat1.T @ in1[:-1].flatten(0, 1), flat2.T @ in2[:-1].flatten(0, 1), flat2.sum(0),
            flat.T @ in2[1:, :, units:].flatten(0, 1), flat.sum(0),
        )  # fmt: skip


def _cell(gates, before, after, hidden) -> None:
    """One LSTM cell in place: `gates` become their activations, `after` and `hidden` are filled."""
    units = before.shape[1]
    gates[:, : 2 * units].sigmoid_()
    gates[:, 2 * units : 3 * units].tanh_()
    gates[:, 3 * units :].sigmoid_()
    i, f, g, o = gates.split(units, dim=1)
    torch.mul(f, before, out=after)
    after.addcmul_(i, g)
    torch.mul(o, after.tanh(), out=hidden)


def _slopes(gates, cells):
    """For all steps at once: gate gradients per gradient of the cell (of h, for o), and dc/dh."""
    i, f, g, o = gates.chunk(4, dim=-1)
    tanh = cells[1:].tanh()
    slopes = torch.cat(
        [g * i * (1 - i), cells[:-1] * f * (1 - f), i * (1 - g * g), tanh * o * (1 - o)], dim=-1
    )
    return slopes, o * (1 - tanh * tanh)


def _cell_back(slopes, leak, gates, hidden, cell):
    """Turn `slopes` into gate gradients in place; `cell` becomes the gradient one step earlier."""
    units = cell.shape[1]
    cell.addcmul_(hidden, leak)
    slopes[:, : 3 * units].unflatten(1, (3, units)).mul_(cell[:, None])
    slopes[:, 3 * units :].mul_(hidden)
    cell.mul_(gates[:, units : 2 * units])
    return slopes

"""Recurrent layers over sequences of different lengths, with a gradient written by hand.

Sequences are sorted by length, and a step computes only those that have not ended. Autograd would
add to the gradient of each weight matrix at every step (up to 100). Here the steps are stored, and
one matrix product at the end gives the gradient. The results are those of `recurrent` and
`decoders`; a test compares them.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.autograd.function import once_differentiable


class Packed(NamedTuple):
    """Sequences of different lengths as R rows, step after step, the longest sequence first.

    Args:
        order: the samples, the longest first.
        sample: the sample of each row.
        step: the step of each row.
        spans: the first row of each step, and the row after its last.
    """

    order: Int[Tensor, " B"]
    sample: Int[Tensor, " R"]
    step: Int[Tensor, " R"]
    spans: list[tuple[int, int]]

    @classmethod
    def of(cls, lengths: Int[Tensor, " B"]) -> Packed:
        """The rows of sequences with these lengths."""
        order = lengths.argsort(descending=True, stable=True)
        step = torch.arange(int(lengths.max()), device=lengths.device)
        going = step[:, None] < lengths[order]
        step, place = going.nonzero(as_tuple=True)
        ends = going.sum(1).cumsum(0).tolist()
        return cls(order, order[place], step, list(zip([0, *ends], ends, strict=False)))


class _Tape:
    """The steps of one layer of U units, stored for the backward pass: R rows.

    Views of the stored arrays are made once, because a view at each step costs time.
    """

    def __init__(self, spans, gates: Float[Tensor, "R G"], peep):
        self.gates, self.peep = gates, peep
        self.units = u = gates.shape[1] // 4
        self.before, self.after, self.squashed = (gates.new_empty(len(gates), u) for _ in range(3))
        parts = (gates, gates[:, u : 3 * u].unflatten(1, (2, u)), gates[:, : 3 * u],
                 *gates.split(u, dim=1), self.before, self.after, self.squashed)  # fmt: skip
        self.steps = steps_of(spans, *parts)

    def forward(self, t: int, before, hidden) -> None:
        """Turn the gates of step t into activations, and write the new hidden state to `hidden`."""
        _, both, sigmoids, o, i, f, g, kept, after, squashed = self.steps[t]
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
        """The part of the gates' gradients that can be computed for all steps at once.

        Returns:
            This part, and its views for each step, which `backward` completes.
        """
        gates, u = self.gates, self.units
        o, i, f, g = gates.split(u, dim=1)
        made, one = torch.addcmul(gates, gates, gates, value=-1), gates.new_ones(())
        to_o, to_i, to_f, to_g = made.split(u, dim=1)
        torch.addcmul(one, g, g, value=-1, out=to_g)
        to_o.mul_(self.squashed), to_i.mul_(g), to_f.mul_(self.before), to_g.mul_(i)
        steep = torch.addcmul(one, self.squashed, self.squashed, value=-1).mul_(o)
        by_memory = made[:, u:].unflatten(1, (3, u))
        return made, steps_of(spans, made, to_o, by_memory, to_i, to_f, steep, f)

    def backward(self, hidden, cell, slopes) -> None:
        """Complete the gradients of a step. `cell` becomes the gradient of the memory before it."""
        _, to_o, by_memory, to_i, to_f, steep, f = slopes
        to_o.mul_(hidden)
        cell.addcmul_(steep, hidden)
        if self.peep is not None:
            cell.addcmul_(to_o, self.peep[2])
        by_memory.mul_(cell[:, None])
        cell.mul_(f)
        if self.peep is not None:
            cell.addcmul_(to_i, self.peep[0]).addcmul_(to_f, self.peep[1])

    def peep_gradient(self, slopes):
        if self.peep is None:
            return None
        to_o, to_i, to_f, _ = slopes.split(self.units, dim=1)
        seen = ((to_i, self.before), (to_f, self.before), (to_o, self.after))
        return torch.stack([(slope * memory).sum(0) for slope, memory in seen])


def steps_of(spans, *rows: Tensor) -> list[tuple[Tensor, ...]]:
    """The rows of each step, for each of the tensors."""
    sizes = [b - a for a, b in spans]
    return list(zip(*(part.split(sizes) for part in rows), strict=True))


class Layer(torch.autograd.Function):
    """One recurrent layer over packed rows, from a state of zero."""

    @staticmethod
    def forward(ctx, spans, seen, weight_hh, peep):
        """Hidden states and memories, (R, U) each.

        Args:
            seen: what the gates get from the input, (R, 4 U).
            weight_hh: recurrent weights, (4 U, U).
            peep: peepholes, or None.
        """
        tape = _Tape(spans, seen.clone(), peep)
        hidden = seen.new_empty(len(seen), tape.units)
        turns = [h for (h,) in steps_of(spans, hidden)]
        memory = seen.new_zeros(len(turns[0]), tape.units)
        for t, now in enumerate(turns):
            n = len(now)
            if t:
                tape.steps[t][0].addmm_(turns[t - 1][:n], weight_hh.T)
            tape.forward(t, memory[:n], now)
            memory = tape.steps[t][-2]
        ctx.tape, ctx.spans = tape, spans
        ctx.save_for_backward(hidden, weight_hh)
        return hidden, tape.after.clone()  # a copy: the tape must not hold an output of autograd

    @staticmethod
    @once_differentiable
    def backward(ctx, to_hidden, to_memory):
        """The gradients by `seen`, the recurrent weights and the peepholes."""
        tape, spans = ctx.tape, ctx.spans
        hidden, weight_hh = ctx.saved_tensors
        made, slopes = tape.slopes(spans)
        earlier = torch.zeros_like(hidden)  # each row's hidden state one step before
        steps = steps_of(spans, hidden, earlier, to_hidden, to_memory)
        h, c = (hidden.new_zeros(spans[0][1], tape.units) for _ in range(2))
        for t in reversed(range(len(spans))):
            _, before, from_hidden, from_memory = steps[t]
            n = len(before)
            c[:n] += from_memory
            tape.backward(h[:n] + from_hidden, c[:n], slopes[t])
            if t:
                torch.mm(slopes[t][0], weight_hh, out=h[:n])
                before.copy_(steps[t - 1][0][:n])
        return None, made, made.T @ earlier, tape.peep_gradient(made)


class Unroll(torch.autograd.Function):
    """Two recurrent layers with a tanh output that is the next step's input, over packed rows."""

    @staticmethod
    def forward(ctx, spans, seen, start, h1, c1, h2, c2, w1, w2, b2, peep1, peep2, wo, bo):
        """The poses (R, J), from the pose `start` and the first states of both layers."""
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
            if len(to1) < len(pose):  # some sequences have ended
                last = pose, hidden1, hidden2, c1, c2
                pose, hidden1, hidden2, c1, c2 = (rows[: len(to1)] for rows in last)
            was1.copy_(hidden1), posed.copy_(pose), was2.copy_(hidden2)
            gates1, gates2 = first.steps[t][0], second.steps[t][0]
            gates1.addmm_(to1, w1)
            first.forward(t, c1, now1)
            torch.addmm(b2, to2, w2, out=gates2)
            second.forward(t, c2, now2)
            torch.addmm(bo, now2, wo.T, out=pose_out).tanh_()
            c1, c2 = first.steps[t][-2], second.steps[t][-2]
            pose, hidden1, hidden2 = pose_out, now1, now2
        ctx.tapes, ctx.spans = (first, second), spans
        ctx.save_for_backward(in1, in2, out, poses, w1, w2, wo)
        return poses

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        """The gradients by all inputs but `spans`."""
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
        going = 0
        for t in reversed(range(len(spans))):
            from_pose, steep, to_pose = steps[t]
            if len(to_pose) > going:  # some more end here; views are cut once
                going = len(to_pose)
                to1, to2, cell1, cell2 = (rows[:going] for rows in (back1, back2, c1, c2))
                to_h1, to_posed = to1.tensor_split([units], dim=1)
                to_now1, to_h2 = to2.tensor_split([units], dim=1)
            torch.mul(from_pose + to_posed, steep, out=to_pose)
            second.backward(torch.addmm(to_h2, to_pose, wo), cell2, slopes2[t])
            torch.mm(slopes2[t][0], w2, out=to2)
            first.backward(to_h1 + to_now1, cell1, slopes1[t])
            torch.mm(slopes1[t][0], w1, out=to1)
        return (
            None, made1, back1[:, units:], back1[:, :units], c1, back2[:, units:], c2,
            made1.T @ in1, made2.T @ in2, made2.sum(0),
            first.peep_gradient(made1), second.peep_gradient(made2), grads.T @ out, grads.sum(0),
        )  # fmt: skip

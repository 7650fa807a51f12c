"""LSTMs with peepholes, and an encoder that reads a sequence to its own end.

PGAE and PVAE are built of them (published code). A peephole lets each gate see the memory cell::

    i, f = sigmoid(W [x, h] + p * c)        c' = f * c + i * tanh(W [x, h])
    o    = sigmoid(W [x, h] + p * c')       h' = o * tanh(c')
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn


class PeepholeCell(nn.Module):
    """One step of an LSTM with peepholes; called as `torch.nn.LSTMCell` is.

    Weights start uniform within 1 / sqrt(units), as published.

    Args:
        inputs: length of the input vector at each step.
        units: length of the hidden state and of the memory.
    """

    def __init__(self, inputs: int, units: int):
        super().__init__()
        self.weight_ih = nn.Linear(inputs, 4 * units)  # gates: input, forget, cell, output
        self.weight_hh = nn.Linear(units, 4 * units, bias=False)
        self.peepholes = nn.Parameter(torch.empty(3, units))  # input, forget, output
        for parameter in self.parameters():
            nn.init.uniform_(parameter, -(units**-0.5), units**-0.5)

    def forward(self, x: Float[Tensor, "B I"], state: tuple[Tensor, Tensor]):
        """The new hidden state and the new memory, (B, units) each."""
        return self.step(self.weight_ih(x), state)

    def step(self, seen: Float[Tensor, "B G"], state: tuple[Tensor, Tensor]):
        """The same, given what the G = 4 x units gates get from the input."""
        hidden, memory = state
        i, f, g, o = (seen + self.weight_hh(hidden)).chunk(4, dim=1)
        see_i, see_f, see_o = self.peepholes
        kept = torch.sigmoid(f + see_f * memory) * memory
        memory = kept + torch.sigmoid(i + see_i * memory) * torch.tanh(g)
        return torch.sigmoid(o + see_o * memory) * torch.tanh(memory), memory

    def run(self, rows: Float[Tensor, "T B I"]) -> tuple[Tensor, Tensor]:
        """Hidden states and memories after each row, (T, B, units) each, from a state of zero.

        Time comes first here; what the gates get from the inputs is one product for all rows.
        """
        zero = rows.new_zeros(rows.shape[1], self.weight_hh.in_features)
        states = [(zero, zero)]
        for seen in self.weight_ih(rows).unbind():
            states.append(self.step(seen, states[-1]))
        hidden, memory = zip(*states[1:], strict=True)
        return torch.stack(hidden), torch.stack(memory)


def make_cell(inputs: int, units: int, forget_bias: float, peepholes: bool = False) -> nn.Module:
    """An LSTM cell; `forget_bias` opens the forget gate, so that it keeps its memory at first."""
    cell = PeepholeCell(inputs, units) if peepholes else nn.LSTMCell(inputs, units)
    with torch.no_grad():  # gates lie in the order input, forget, cell, output
        if peepholes:
            cell.weight_ih.bias[units : 2 * units] = forget_bias
        else:
            cell.bias_ih[units : 2 * units] = forget_bias
            cell.bias_hh[units : 2 * units] = 0
    return cell


class RecurrentEncoder(nn.Module):
    """Layers of peephole cells; the last states of all layers sum a sequence up."""

    def __init__(self, inputs: int, units: int, layers: int, forget_bias: float):
        super().__init__()
        sizes = [inputs] + [units] * (layers - 1)
        self.cells = nn.ModuleList(make_cell(size, units, forget_bias, True) for size in sizes)

    def forward(
        self, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]
    ) -> Float[Tensor, "B S"]:
        """Memory and hidden state of each layer after a sample's last row: S = layers x 2 units."""
        hidden = rows.transpose(0, 1)[: int(lengths.max())]
        item = torch.arange(len(rows), device=rows.device)
        parts = []
        for cell in self.cells:
            hidden, memory = cell.run(hidden)
            parts += [memory[lengths - 1, item], hidden[lengths - 1, item]]
        return torch.cat(parts, dim=1)


def reverse(rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]) -> Float[Tensor, "B T I"]:
    """Each sequence backwards within its own length; what lies beyond stays where it is."""
    place, end = torch.arange(rows.shape[1], device=rows.device), lengths[:, None]
    turned = torch.where(place < end, end - 1 - place, place)
    return rows.gather(1, turned[..., None].expand_as(rows))


def spread(parts: Iterable[nn.Module], gain: float) -> None:
    """Start the weight matrices of parts of a model by Xavier's rule times `gain`, gate by gate.

    Ours. Published weights start within 0.1, so small that after a few such maps in a row a
    sentence hardly changes the answer. Trained to repeat sentences alone (batches of 54, one cycle
    to 0.005), a PGAE had none right after 600 steps; from a gain of 1, all of them after 200.
    """
    for name, matrix in nn.ModuleList(parts).named_parameters():
        if name.endswith("weight"):
            of_gates = name.endswith(("weight_ih.weight", "weight_hh.weight"))
            for part in matrix.detach().chunk(4 if of_gates else 1):
                nn.init.xavier_uniform_(part, gain)

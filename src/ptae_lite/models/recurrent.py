"""LSTMs with peepholes, and an encoder made of them. PGAE and PVAE use them (published code).

A peephole `p` lets a gate see the memory cell `c`::

    i, f = sigmoid(W [x, h] + p * c)        c' = f * c + i * tanh(W [x, h])
    o    = sigmoid(W [x, h] + p * c')       h' = o * tanh(c')
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn


class PeepholeCell(nn.Module):
    """One step of an LSTM with peepholes. Call it as `torch.nn.LSTMCell`.

    Weights start uniform in +-1 / sqrt(units), as published.

    Args:
        inputs: length I of the input vector.
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
        """The same as `forward`, from what the G = 4 x units gates get from the input."""
        hidden, memory = state
        i, f, g, o = (seen + self.weight_hh(hidden)).chunk(4, dim=1)
        see_i, see_f, see_o = self.peepholes
        kept = torch.sigmoid(f + see_f * memory) * memory
        memory = kept + torch.sigmoid(i + see_i * memory) * torch.tanh(g)
        return torch.sigmoid(o + see_o * memory) * torch.tanh(memory), memory

    def run(self, rows: Float[Tensor, "T B I"]) -> tuple[Tensor, Tensor]:
        """Hidden states and memories after each row, (T, B, units) each. The first state is zero.

        Time is the first axis here. One matrix product gives the gates their inputs of all rows.
        """
        zero = rows.new_zeros(rows.shape[1], self.weight_hh.in_features)
        states = [(zero, zero)]
        for seen in self.weight_ih(rows).unbind():
            states.append(self.step(seen, states[-1]))
        hidden, memory = zip(*states[1:], strict=True)
        return torch.stack(hidden), torch.stack(memory)


def make_cell(inputs: int, units: int, forget_bias: float, peepholes: bool = False) -> nn.Module:
    """An LSTM cell.

    Args:
        forget_bias: bias of the forget gate at the start of a training. A high value opens the
            gate, so that the cell first keeps its memory. The published code has 0.8.
        peepholes: whether the gates see the memory.
    """
    cell = PeepholeCell(inputs, units) if peepholes else nn.LSTMCell(inputs, units)
    with torch.no_grad():  # gates lie in the order input, forget, cell, output
        if peepholes:
            cell.weight_ih.bias[units : 2 * units] = forget_bias
        else:
            cell.bias_ih[units : 2 * units] = forget_bias
            cell.bias_hh[units : 2 * units] = 0
    return cell


class RecurrentEncoder(nn.Module):
    """Layers of LSTMs with peepholes, which turn a sequence into one vector."""

    def __init__(self, inputs: int, units: int, layers: int, forget_bias: float):
        super().__init__()
        sizes = [inputs] + [units] * (layers - 1)
        self.cells = nn.ModuleList(make_cell(size, units, forget_bias, True) for size in sizes)

    def forward(
        self, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]
    ) -> Float[Tensor, "B S"]:
        """Memory and hidden state of each layer after the last row of each sample.

        Args:
            rows: sequences, padded.
            lengths: how many rows each sequence has.

        Returns:
            The memory, then the hidden state of each layer, side by side (S = layers x 2 x units).
        """
        hidden = rows.transpose(0, 1)[: int(lengths.max())]
        item = torch.arange(len(rows), device=rows.device)
        parts = []
        for cell in self.cells:
            hidden, memory = cell.run(hidden)
            parts += [memory[lengths - 1, item], hidden[lengths - 1, item]]
        return torch.cat(parts, dim=1)


def reverse(rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]) -> Float[Tensor, "B T I"]:
    """Each sequence in reverse order. Its padding stays at the end."""
    place, end = torch.arange(rows.shape[1], device=rows.device), lengths[:, None]
    turned = torch.where(place < end, end - 1 - place, place)
    return rows.gather(1, turned[..., None].expand_as(rows))


def spread(parts: Iterable[nn.Module], gain: float) -> None:
    """Start weight matrices by Xavier's rule (uniform) times `gain`, each gate for itself. Ours.

    The published weights start in +-0.1. They are so small that a sentence hardly changes the
    answer after several such maps. A PGAE that was trained only to repeat sentences (batches of 54,
    one cycle to 0.005) had none right after 600 steps. With a gain of 1 it had all right after 200.
    """
    for name, matrix in nn.ModuleList(parts).named_parameters():
        if name.endswith("weight"):
            of_gates = name.endswith(("weight_ih.weight", "weight_hh.weight"))
            for part in matrix.detach().chunk(4 if of_gates else 1):
                nn.init.xavier_uniform_(part, gain)


def open_forget_gates(lstm: nn.LSTM, bias: float = 1.0) -> None:
    """Start each layer of an LSTM with open forget gates, see `make_cell`."""
    units = lstm.hidden_size
    with torch.no_grad():
        for layer in range(lstm.num_layers):
            getattr(lstm, f"bias_ih_l{layer}")[units : 2 * units] = bias
            getattr(lstm, f"bias_hh_l{layer}")[units : 2 * units] = 0

"""Peephole LSTMs: a step by hand, all steps at once, to each sequence's own end, backwards."""

import pytest
import torch

from ptae_lite.models.decoders import ActionDecoder
from ptae_lite.models.recurrent import PeepholeCell, RecurrentEncoder, make_cell, reverse, spread

LENGTHS = torch.tensor([7, 3, 1])


@pytest.fixture
def rows():
    return torch.randn(3, 9, 4, generator=torch.Generator().manual_seed(0))


def by_hand(cell, x, hidden, memory):
    """One step, gate by gate."""
    gates = x @ cell.weight_ih.weight.T + cell.weight_ih.bias + hidden @ cell.weight_hh.weight.T
    i, f, g, o = gates.chunk(4, dim=1)
    p = cell.peepholes
    new = (f + p[1] * memory).sigmoid() * memory + (i + p[0] * memory).sigmoid() * g.tanh()
    return (o + p[2] * new).sigmoid() * new.tanh(), new


def test_a_step_is_the_formula():
    torch.manual_seed(0)
    cell, x, hidden, memory = PeepholeCell(4, 5), *(torch.randn(3, n) for n in (4, 5, 5))
    for made, wanted in zip(cell(x, (hidden, memory)), by_hand(cell, x, hidden, memory),
                            strict=True):  # fmt: skip
        torch.testing.assert_close(made, wanted)


def test_all_rows_at_once_are_step_after_step(rows):
    torch.manual_seed(0)
    cell, state = PeepholeCell(4, 5), (torch.zeros(3, 5), torch.zeros(3, 5))
    hidden, memory = cell.run(rows.transpose(0, 1))
    for t in range(9):
        state = cell(rows[:, t], state)
        torch.testing.assert_close((hidden[t], memory[t]), state)


def test_a_cell_starts_as_configured():
    torch.manual_seed(0)
    cell = make_cell(4, 25, 0.8, peepholes=True)
    assert (cell.weight_ih.bias[25:50] == 0.8).all()
    others = [
        cell.weight_ih.weight,
        cell.weight_hh.weight,
        cell.peepholes,
        cell.weight_ih.bias[:25],
    ]
    assert all(0.15 < part.abs().max() <= 0.2 for part in others)


def test_a_summary_is_memory_and_hidden_state_of_each_layer_at_the_last_row(rows):
    torch.manual_seed(0)
    encoder = RecurrentEncoder(4, 5, 2, 0.8)
    summary = encoder(rows, LENGTHS)
    for row, length, made in zip(rows, LENGTHS, summary, strict=True):
        below, memory = encoder.cells[0].run(row[:length, None])
        above, memory_above = encoder.cells[1].run(below)
        wanted = torch.cat([x[-1, 0] for x in (memory, below, memory_above, above)])
        torch.testing.assert_close(made, wanted)


def test_what_lies_beyond_a_sequence_is_not_read_and_its_last_row_is(rows):
    torch.manual_seed(0)
    encoder = RecurrentEncoder(4, 5, 2, 0.8)
    beyond, within = rows.clone(), rows.clone()
    for i, length in enumerate(LENGTHS):
        beyond[i, length:] += 1
        within[i, length - 1] += 1
    summary = encoder(rows, LENGTHS)
    assert torch.equal(encoder(beyond, LENGTHS), summary)
    assert (encoder(within, LENGTHS) - summary).abs().amax(1).min() > 1e-3


def test_a_sequence_is_reversed_within_its_own_length(rows):
    turned = reverse(rows, LENGTHS)
    for row, length, back in zip(rows, LENGTHS, turned, strict=True):
        assert torch.equal(back[:length], row[:length].flip(0))
        assert torch.equal(back[length:], row[length:])
    assert torch.equal(reverse(turned, LENGTHS), rows)


def test_a_decoder_with_peepholes_sees_a_frame_and_its_own_last_pose():
    torch.manual_seed(0)
    decoder, code = ActionDecoder(6, 5, 16, 8, 2, 1.0, peepholes=True), torch.randn(4, 16)
    video, pose = torch.randn(4, 3, 6), torch.randn(4, 5)
    made = decoder(code, video, pose)
    h0, c0, h1, c1 = decoder.start(code).chunk(4, dim=1)
    for t in range(3):
        h0, c0 = by_hand(decoder.cells[0], torch.cat([video[:, t], pose], dim=1), h0, c0)
        h1, c1 = by_hand(decoder.cells[1], h0, h1, c1)
        pose = decoder.output(h1).tanh()
        torch.testing.assert_close(made[:, t], pose)


def test_starting_weights_are_spread_gate_by_gate_and_biases_stay():
    torch.manual_seed(0)
    encoder = RecurrentEncoder(30, 50, 2, 0.8)
    before = {name: p.clone() for name, p in encoder.named_parameters()}
    spread([encoder], 1.5)
    for name, p in encoder.named_parameters():
        if name.endswith("weight"):
            limit = 1.5 * (6 / (50 + p.shape[1])) ** 0.5
            for gate in p.chunk(4):
                assert 0.95 * limit < gate.abs().max() <= limit
        else:
            assert torch.equal(p, before[name])

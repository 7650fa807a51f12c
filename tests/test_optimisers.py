"""Muon for hidden matrices, Adam for the rest, one schedule for both."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch.nn import Parameter

from ptae_lite import optimisers
from ptae_lite.models import MODELS
from ptae_lite.recipe import Recipe

MUON = Recipe(epochs=2, batch=8, learning_rate=1e-3, muon_lr=4e-3, warmup=0.1)


@pytest.mark.parametrize("shape", [(5, 64, 256), (5, 64, 35), (3, 20, 20)])
def test_singular_values_come_near_to_one(shape):
    made = optimisers.orthogonal(torch.randn(shape, generator=torch.manual_seed(0)))
    values = torch.linalg.svdvals(made)
    assert made.shape == shape
    # the published coefficients bring all but the tiniest values between about 0.7 and 1.2
    assert values[:, : min(shape[1:]) // 2].min() > 0.6 and values.max() < 1.3


@pytest.mark.parametrize(("height", "rows", "count"), [(512, 64, 8), (400, 64, 8), (50, 64, 1)])
def test_a_matrix_is_cut_into_few_equal_blocks(height, rows, count):
    matrix = torch.randn(height, 7)
    blocks = optimisers.blocks_of(matrix, rows)
    assert blocks.shape == (count, height // count, 7)
    assert torch.equal(blocks.flatten(0, 1), matrix)


@pytest.mark.parametrize("decay", [0.0, 5.0])
def test_with_whole_matrices_it_is_pytorchs_muon(decay):
    start = torch.randn(40, 60, generator=torch.manual_seed(0))
    ours, theirs = Parameter(start.clone()), Parameter(start.clone())
    mine = optimisers.Muon([ours], lr=1e-2, weight_decay=decay, rows=40)
    other = torch.optim.Muon(
        [theirs], lr=1e-2, weight_decay=decay, adjust_lr_fn="match_rms_adamw", momentum=0.95
    )
    for _ in range(3):
        ours.grad = torch.randn(40, 60)
        theirs.grad = ours.grad.clone()
        mine.step(), other.step()
    moved, wanted = ours.detach() - start, theirs.detach() - start  # theirs is in bfloat16
    assert (moved - wanted).norm() < 0.02 * wanted.norm()


def test_blocks_do_not_mix():
    matrix = Parameter(torch.zeros(128, 30))
    matrix.grad = torch.zeros(128, 30)
    matrix.grad[:64] = torch.randn(64, 30)
    optimisers.Muon([matrix], rows=64).step()
    assert matrix[:64].abs().min() > 0 and not matrix[64:].any()


@pytest.mark.parametrize("model", ["ptae", "pgae", "pvae"])
def test_muon_moves_hidden_matrices_and_adam_all_else(model):
    network = MODELS[model].network(MODELS[model].config(features=30))
    names = {id(p): name for name, p in network.named_parameters()}
    adam, muon = optimisers.Optimiser(network, MUON, 10).parts
    by = {kind: {names[id(p)] for group in part.param_groups for p in group["params"]}
          for kind, part in (("adam", adam), ("muon", muon))}  # fmt: skip
    assert by["adam"] | by["muon"] == set(names.values()) and not by["adam"] & by["muon"]
    assert {"language.output.weight", "action.output.weight"} <= by["adam"]
    assert not any("bias" in name or "peep" in name or "norm" in name for name in by["muon"])
    assert {"action.start.weight", "language.start.weight"} <= by["muon"]
    assert len(optimisers.Optimiser(network, replace(MUON, muon_lr=0), 10).parts) == 1


def test_the_action_decoder_has_rates_of_its_own(tiny):
    network = MODELS["ptae"].network(replace(tiny, decoder_units=32, hidden=32))
    own = {id(p) for p in network.action.parameters()}
    parts = optimisers.Optimiser(network, replace(MUON, action_lr_scale=3), 10).parts
    for part, rate in zip(parts, (1e-3, 4e-3), strict=True):
        for group in part.param_groups:
            scale = 3 if id(group["params"][0]) in own else 1
            assert all((id(p) in own) == (scale == 3) for p in group["params"])
            assert group["initial_lr"] == pytest.approx(rate * scale)


def test_rates_rise_and_fall_to_zero():
    steps, weight = 50, Parameter(torch.zeros(3))
    optimiser = torch.optim.Adam([weight], lr=2.0)
    rates, schedule = [], optimisers.schedule(optimiser, MUON, steps)
    for _ in range(steps):
        rates.append(optimiser.param_groups[0]["lr"])
        optimiser.step()
        schedule.step()
    top = max(rates)
    assert rates.index(top) == 4 and top == pytest.approx(2.0)  # a tenth of 50
    assert rates[:5] == sorted(rates[:5]) and rates[4:] == sorted(rates[4:], reverse=True)
    assert rates[-1] == pytest.approx(0.0)


def test_weights_decay_outside_the_action_decoder_only(tiny):
    network = MODELS["ptae"].network(replace(tiny, decoder_units=32, hidden=32))
    own = {id(p) for p in network.action.parameters()}
    adam, muon = optimisers.Optimiser(network, replace(MUON, muon_decay=0.5), 10).parts
    decays = {id(group["params"][0]) in own: group["weight_decay"] for group in muon.param_groups}
    assert decays == {True: 0.0, False: 0.5}
    assert not any(group["weight_decay"] for group in adam.param_groups)

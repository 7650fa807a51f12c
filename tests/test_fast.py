"""The fast forms give what the readable ones give, values and gradients."""

from dataclasses import replace

import pytest
import torch

from ptae_lite.data.signals import SIGNALS, build, signal_number
from ptae_lite.models import MODELS
from ptae_lite.models.common import losses


@pytest.fixture(params=[99, 5], ids=["all steps", "held poses short"])
def mixed(request, source):
    """Three samples, two slow and a fast one, under each signal."""
    numbers = torch.tensor([signal_number(s) for s in SIGNALS for _ in range(3)])
    indices = torch.tensor([0, 500, 70] * 5)
    batch = build(source, indices, numbers, torch.arange(15) % 8, hold_steps=request.param)
    parts = ("keys", "video", "start", "joints")
    return replace(batch, **{name: getattr(batch, name).double() for name in parts})


def make(kind, **sizes):
    torch.manual_seed(3)
    model, config, _ = MODELS[kind]
    return model(config(features=6, **sizes)).double()


def costs_and_gradients(model, batch, readable):
    """What training minimises, by the readable forms or as training does it."""
    model.zero_grad(set_to_none=True)
    torch.manual_seed(5)  # PVAE draws
    costs = readable(batch) if readable else model.loss(batch)
    sum(costs).backward()
    return torch.stack(costs), {name: p.grad for name, p in model.named_parameters()}


def assert_same(model, batch, readable, unseen=()):
    expected, slopes = costs_and_gradients(model, batch, readable)
    found, gradients = costs_and_gradients(model, batch, None)
    assert torch.allclose(expected, found, rtol=0, atol=1e-10)
    for name in unseen:
        for found in (slopes.pop(name), gradients.pop(name)):
            assert found is None or found.abs().max() < 1e-12
    for name, slope in slopes.items():
        assert slope.abs().max() > 0, name
        assert torch.allclose(slope, gradients[name], rtol=1e-8, atol=1e-12), name


OTHERWISE = [
    {}, {"decoder_layers": 1}, {"queries": "both"}, {"queries": "action"},
    {"condition_on_code": True, "pad_still_frame": False},
]  # fmt: skip


@pytest.mark.parametrize("choices", OTHERWISE)
def test_a_fast_ptae_equals_the_readable_one(mixed, choices):
    sizes = {"hidden": 32, "feed_forward": 64, "decoder_units": 24}
    model = make("ptae", dropout=0.0, **sizes | choices)  # chance would tell the two apart
    # A key bias adds the same to every key, so it has no gradient; a fast form leaves it out.
    unseen = [n for n, _ in model.named_parameters() if n.endswith("attention.key.bias")]
    assert_same(model, mixed, lambda batch: losses(model(batch), batch), unseen)
    quick, answer = model.forward_fast(mixed), model(mixed)
    assert torch.allclose(quick.code, answer.code, rtol=0, atol=1e-12)
    counts = mixed.step_mask
    assert torch.allclose(quick.joints[counts], answer.joints[counts], rtol=0, atol=1e-12)
    assert quick.joints[~counts].abs().max() == 0


def test_a_fast_pgae_equals_the_readable_one(mixed):
    model = make("pgae", code=8, units=10)
    assert_same(model, mixed, lambda batch: losses(model(batch), batch, model.word_weights))


@pytest.mark.parametrize("kind", ["pvae", "prae"])
def test_a_fast_pvae_equals_the_readable_one(mixed, kind, monkeypatch):
    from ptae_lite.models import fast
    from ptae_lite.models.recurrent import RecurrentEncoder

    model = make(kind, code=8, units=10)

    def readable(batch):
        with monkeypatch.context() as patch:
            patch.setattr(fast, "encode_fast", RecurrentEncoder.__call__)
            patch.setattr(
                fast,
                "decode_fast",
                lambda decoder, code, b: decoder(code, b.video, b.start) * b.step_mask[..., None],
            )
            return model.loss(batch)

    assert_same(model, mixed, readable)

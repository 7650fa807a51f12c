"""The fast forms give what the readable ones give, values and gradients."""

from dataclasses import replace

import pytest
import torch

from ptae_lite.models import PTAE, PTAEConfig, fast
from ptae_lite.models.common import losses
from ptae_lite.signals import PTAE_SIGNALS, build, signal_number


@pytest.fixture
def mixed(source):
    """Two samples, a slow and a fast one, under each signal."""
    numbers = torch.tensor([signal_number(s) for s in PTAE_SIGNALS for _ in range(2)])
    return build(source, torch.tensor([0, 500] * 4), numbers, torch.arange(8))


def answers_and_gradients(model, answer, batch):
    model.zero_grad(set_to_none=True)
    given = answer(batch)
    language, action = losses(given, batch)
    (language + action).backward()
    return given, {name: p.grad for name, p in model.named_parameters()}


@pytest.mark.parametrize("layers", [1, 2])
def test_the_fast_form_equals_the_readable_one(mixed, layers):
    torch.manual_seed(3)
    features = mixed.video.shape[2]
    sizes = {"hidden": 32, "feed_forward": 64, "decoder_units": 24, "decoder_layers": layers}
    sizes["dropout"] = 0.0  # chance would tell the two apart
    model = PTAE(PTAEConfig(features=features, **sizes)).double()
    parts = ("keys", "video", "start", "joints")
    mixed = replace(mixed, **{name: getattr(mixed, name).double() for name in parts})
    readable, expected = answers_and_gradients(model, model, mixed)
    quick, gradients = answers_and_gradients(model, lambda b: fast.answer(model, b), mixed)
    for a, b in zip(readable, quick, strict=True):
        assert torch.allclose(a, b, rtol=0, atol=1e-10)
    # The key bias adds the same to every frame, so it has no gradient; the fast form leaves it out.
    unseen = "encoder.attention.key.bias"
    assert expected.pop(unseen).abs().max() < 1e-12 and gradients.pop(unseen) is None
    for name, gradient in expected.items():
        assert gradient.abs().max() > 0, name
        assert torch.allclose(gradient, gradients[name], rtol=1e-8, atol=1e-12), name

"""PTAE: sizes, attention against torch's, decoders against a re-implementation, storing."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from ptae_lite import artefacts
from ptae_lite.data.signals import Source, build
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.evaluation import correct, respond
from ptae_lite.language import SIGNALS
from ptae_lite.models import PTAE, PTAEConfig, checkpoint
from ptae_lite.models.common import Answer, losses
from ptae_lite.models.crossmodal import Attention, positions
from ptae_lite.models.decoders import ActionDecoder, LanguageDecoder


def parameters(module):
    return sum(p.numel() for p in module.parameters())


@pytest.fixture
def mixed(source):
    """Ten samples, slow and fast, with all five signals."""
    samples = torch.cat([torch.arange(0, 5), torch.arange(500, 505)])
    return build(source, samples, torch.arange(10) % 5, torch.arange(10) % 8)


def test_parameters_are_the_papers():
    model = PTAE()
    assert parameters(model) == 1_500_700
    assert parameters(model.encoder) == 806_912
    assert parameters(model.language) == 213_399 + 131_584
    assert parameters(model.action) == 217_221 + 131_584


def test_attention_is_torchs():
    torch.manual_seed(0)
    ours, theirs = Attention(16, 4), nn.MultiheadAttention(16, 4, batch_first=True)
    with torch.no_grad():
        for linear in (ours.query, ours.key, ours.value, ours.output):
            linear.bias.normal_()
        parts = (ours.query, ours.key, ours.value)
        theirs.in_proj_weight.copy_(torch.cat([linear.weight for linear in parts]))
        theirs.in_proj_bias.copy_(torch.cat([linear.bias for linear in parts]))
        theirs.out_proj.load_state_dict(ours.output.state_dict())
    query, keys = torch.randn(3, 6, 16), torch.randn(3, 20, 16)
    mixed, weights = ours(query, keys)
    wanted, wanted_weights = theirs(query, keys, keys, average_attn_weights=False)
    torch.testing.assert_close(mixed, wanted)
    torch.testing.assert_close(weights, wanted_weights)


def test_positions_are_interleaved_sines_and_cosines():
    code = positions(16, 8)
    for place in (0, 1, 15):
        for i in range(4):
            angle = place / 10000 ** (2 * i / 8)
            assert code[place, 2 * i].item() == pytest.approx(np.sin(angle), abs=1e-5)
            assert code[place, 2 * i + 1].item() == pytest.approx(np.cos(angle), abs=1e-5)


def test_keys_are_a_set(tiny, mixed):
    model = PTAE(tiny)
    order = torch.randperm(100, generator=torch.Generator().manual_seed(0))
    code, weights = model.encode(mixed)
    moved, moved_weights = model.encode(replace(mixed, keys=mixed.keys[:, order]))
    torch.testing.assert_close(moved, code, atol=1e-5, rtol=0)
    torch.testing.assert_close(moved_weights, weights[..., order], atol=1e-5, rtol=0)


def test_with_a_clock_keys_have_an_order_and_padding_is_hidden(tiny, mixed):
    model = PTAE(replace(tiny, frame_positions=True))
    code, weights = model.encode(mixed)
    inside = torch.arange(100) < mixed.frames[:, None]
    assert weights.masked_select(~inside[:, None, None]).abs().max() == 0
    other = torch.where(inside[..., None], mixed.keys, mixed.keys + 1)
    torch.testing.assert_close(model.encode(replace(mixed, keys=other))[0], code)
    backwards = torch.where(inside[..., None], mixed.keys.flip(1), mixed.keys)
    slow = mixed.frames == 100
    moving = slow & (mixed.keys[:, 0] != mixed.keys[:, 99]).any(1)
    change = (model.encode(replace(mixed, keys=backwards))[0] - code).abs().amax(1)
    assert moving.sum() == 3 and change[moving].min() > 1e-4


def test_when_action_asks_frames_have_an_order_and_words_have_none(tiny, mixed):
    model = PTAE(replace(tiny, queries="action"))
    code, weights = model.encode(mixed)
    assert weights.shape == (10, 2, 100, 6)
    assert weights.masked_select(~mixed.token_mask[:, None, None]).abs().max() == 0
    swapped = replace(mixed, tokens=mixed.tokens[:, [0, 1, 4, 3, 2, 5]])
    whole = mixed.token_mask.all(1)
    torch.testing.assert_close(model.encode(swapped)[0][whole], code[whole])
    inside = torch.arange(100) < mixed.frames[:, None]
    other = torch.where(inside[..., None], mixed.keys, mixed.keys + 1)
    torch.testing.assert_close(model.encode(replace(mixed, keys=other))[0], code)


def test_both_ways_are_the_mean_of_each_with_weights_of_its_own(tiny, mixed):
    model = PTAE(replace(tiny, queries="both"))
    code, weights = model.encode(mixed)
    ways = {}
    for queries, way in (("language", "words_ask"), ("action", "frames_ask")):
        alone = PTAE(replace(tiny, queries=queries))
        alone.encoder.load_state_dict(getattr(model.encoder, way).state_dict())
        ways[queries] = alone.encode(mixed)
    torch.testing.assert_close(code, (ways["language"][0] + ways["action"][0]) / 2)
    assert torch.equal(weights, ways["language"][1])
    assert (ways["language"][0] - ways["action"][0]).abs().max() > 0.1
    count = {q: sum(p.numel() for p in PTAE(PTAEConfig(queries=q)).parameters())
             for q in ("language", "both")}  # fmt: skip
    assert count == {"language": 1_500_700, "both": 1_500_700 + 806_912}


def test_the_order_of_words_matters(tiny, mixed):
    model, swapped = PTAE(tiny), replace(mixed, tokens=mixed.tokens[:, [0, 1, 4, 3, 2, 5]])
    whole = mixed.token_mask.all(1)
    assert whole.sum() == 6
    difference = model.encode(mixed)[0] - model.encode(swapped)[0]
    assert difference[whole].abs().amax(1).min() > 1e-3


def test_tokens_beyond_a_short_query_have_no_effect(tiny, mixed):
    model = PTAE(tiny)
    short = ~mixed.token_mask.all(1)
    other = replace(mixed, tokens=torch.where(mixed.token_mask, mixed.tokens, 5))
    torch.testing.assert_close(model.encode(other)[0][short], model.encode(mixed)[0][short])


def test_padding_is_attended_to(tiny, mixed):
    _, weights = PTAE(tiny).encode(mixed)
    fast = weights[5:]
    assert fast[..., 50:].min() > 0
    torch.testing.assert_close(fast.sum(-1), torch.ones_like(fast.sum(-1)))


def test_a_first_frame_alone_is_all_that_its_action_decoder_sees(tiny, mixed):
    model = PTAE(replace(tiny, freeze_video=True))
    later = replace(mixed, video=torch.cat([mixed.video[:, :1], mixed.video[:, 1:] + 1], dim=1))
    first = replace(mixed, video=mixed.video + 1)
    torch.testing.assert_close(model(later).joints, model(mixed).joints)
    assert (model(first).joints - model(mixed).joints).abs().max() > 1e-3
    quick = model.forward_fast(mixed).joints[mixed.step_mask]
    torch.testing.assert_close(quick, model(mixed).joints[mixed.step_mask])


def test_gradients_reach_every_parameter(tiny, mixed):
    """But the bias of the keys: it adds the same to all scores, so the softmax ignores it."""
    torch.manual_seed(0)
    model = PTAE(tiny)
    sum(losses(model(mixed), mixed)).backward()
    silent = [name for name, p in model.named_parameters() if p.grad.abs().max() < 1e-8]
    assert silent == ["encoder.attention.key.bias"]


def lstm(cell, x, state):
    """One LSTM step written out: gates lie in the order input, forget, cell, output."""
    h, c = state
    gates = x @ cell.weight_ih.T + cell.bias_ih + h @ cell.weight_hh.T + cell.bias_hh
    i, f, g, o = gates.chunk(4, dim=1)
    c = torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(g)
    return torch.sigmoid(o) * torch.tanh(c), c


def run_by_hand(decoder, code, inputs, after):
    """Feed `inputs(t, last answer)` step by step; `after` makes an answer of the raw output."""
    h0, c0, h1, c1 = (code @ decoder.start.weight.T + decoder.start.bias).chunk(4, dim=1)
    low, high, answers = (h0, c0), (h1, c1), []
    for t in range(3):
        low = lstm(decoder.cells[0], inputs(t, answers[-1] if t else None), low)
        high = lstm(decoder.cells[1], low[0], high)
        answers.append(after(high[0] @ decoder.output.weight.T + decoder.output.bias))
    return torch.stack(answers, dim=1)


def test_the_language_decoder_feeds_back_its_softmax():
    torch.manual_seed(0)
    decoder, code = LanguageDecoder(16, 8, 2, 1.0), torch.randn(4, 16)
    bos = torch.eye(23)[:1].expand(4, 23)
    wanted = run_by_hand(
        decoder, code, lambda t, last: bos if t == 0 else last, lambda raw: raw.softmax(1)
    )
    torch.testing.assert_close(decoder(code, 3).exp(), wanted)


def test_the_action_decoder_sees_a_frame_and_its_own_last_pose():
    torch.manual_seed(0)
    decoder, code = ActionDecoder(6, 5, 16, 8, 2, 1.0), torch.randn(4, 16)
    video, start = torch.randn(4, 3, 6), torch.randn(4, 5)
    wanted = run_by_hand(
        decoder,
        code,
        lambda t, last: torch.cat([video[:, t], start if t == 0 else last], dim=1),
        torch.tanh,
    )
    torch.testing.assert_close(decoder(code, video, start), wanted)


def test_forget_gates_start_with_the_configured_bias():
    cell = ActionDecoder(6, 5, 16, 8, 2, 0.7).cells[1]
    torch.testing.assert_close((cell.bias_ih + cell.bias_hh)[8:16], torch.full((8,), 0.7))


def test_answers_are_probabilities_and_poses_in_range(tiny, mixed):
    answer = PTAE(tiny)(mixed)
    assert answer.words.shape == (10, 4, 23) and answer.joints.shape == (10, 99, 5)
    torch.testing.assert_close(answer.words.exp().sum(2), torch.ones(10, 4))
    assert answer.joints.abs().max() <= 1


def test_it_learns_to_describe_eight_samples(samples, source):
    """Of eight meanings, by the language loss alone."""
    torch.manual_seed(0)
    indices = torch.arange(8) * 108
    number = torch.full((8,), SIGNALS.index("describe"))
    batch = build(source, indices, number, torch.zeros(8, dtype=torch.long))
    sizes = {"features": 6, "hidden": 32, "feed_forward": 64, "decoder_units": 32, "dropout": 0.0}
    model = PTAE(PTAEConfig(**sizes))
    optimiser = torch.optim.Adam(model.parameters(), lr=0.01)
    for _ in range(60):
        optimiser.zero_grad()
        code, attention = model.encode(batch)
        # the action decoder takes most of the time and no part in this loss
        answer = Answer(model.language(code, 4), batch.joints, code, attention)
        losses(answer, batch)[0].backward()
        optimiser.step()
    assert len(set(source.meaning[indices].tolist())) == 8
    assert correct(model.eval()(batch), samples, indices.numpy()).all()


def test_a_model_comes_back_from_its_file_and_answers_the_same(tmp_path, trained, few):
    path = tmp_path / "model.safetensors"
    checkpoint.save(path, trained)
    again = checkpoint.load(path)
    assert again.model.config == trained.model.config and not again.model.training
    assert again.about["recipe"] == trained.about["recipe"]
    assert again.about["history"] == trained.about["history"]
    for signal in SIGNALS:
        first, second = (
            respond(one, Source(one.dataset(few)), np.arange(len(few.frames)), signal)
            for one in (trained, again)
        )
        assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


def test_a_file_of_something_else_is_no_model(tmp_path):
    path = tmp_path / "eye.safetensors"
    artefacts.save_weights(path, {"x": torch.zeros(1)}, {"kind": "separated"})
    with pytest.raises(
        ArtefactError, match="holds no model of ours but 'separated'; models are pt"
    ):
        checkpoint.load(path)


def test_weights_that_do_not_say_by_which_eye_are_refused(tmp_path):
    path = tmp_path / "w.safetensors"
    artefacts.save_weights(path, {"x": torch.zeros(1)}, {"kind": "ptae"})
    with pytest.raises(ArtefactError, match="does not say whose features it was trained on"):
        checkpoint.load(path)


def test_features_of_another_eye_are_refused(trained, few):
    with pytest.raises(ArtefactError, match="features of the CAE eeeeeeeeeeee, .* of ffffffffffff"):
        trained.dataset(replace(few, encoder="f" * 64))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"hidden": 30}, r"hidden \(30\) must be a multiple of heads \(4\)"),
        ({"decoder_layers": 0}, "decoder_layers is 0; it must be 1 or more"),
        ({"dropout": 1.0}, "dropout is 1.0; it must be from 0 to below 1"),
    ],
)
def test_sizes_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ConfigError, match=message):
        PTAEConfig(**wrong)


def test_a_model_whose_weights_do_not_fit_its_sizes_is_refused(tmp_path, trained):
    path = tmp_path / "model.safetensors"
    checkpoint.save(path, trained)
    tensors, about = artefacts.load_weights(path)
    for wrong in ({"hidden": 64}, {"unheard_of": 1}):
        artefacts.save_weights(path, tensors, about | {"config": about["config"] | wrong})
        with pytest.raises(ArtefactError, match="do not fit the sizes written in it"):
            checkpoint.load(path)

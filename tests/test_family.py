"""PGAE, PVAE and PRAE: sizes, wiring, costs by hand, learning, storing."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptae_lite import training
from ptae_lite.data.batches import draw_signals, epoch_batches
from ptae_lite.data.signals import Source, build, signal_number
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import correct, respond
from ptae_lite.language import SIGNALS, WORD_INDEX
from ptae_lite.models import (
    MODELS,
    PGAE,
    PVAE,
    PGAEConfig,
    PRAEConfig,
    PTAEConfig,
    PVAEConfig,
    checkpoint,
)
from ptae_lite.models.common import Answer, class_weights, losses
from ptae_lite.models.pgae import GatedUnit
from ptae_lite.models.pvae import Code, binding, divergence
from ptae_lite.training import Recipe

FAMILY = ("pgae", "pvae", "prae")
BY_ACTION, BY_LANGUAGE = ("describe", "repeat action"), ("execute", "repeat language")


@pytest.fixture
def make_model(small_configs):
    """A function: a small model of a kind, the same each time."""

    def make(kind):
        torch.manual_seed(0)
        return MODELS[kind].network(small_configs[kind])

    return make


@pytest.fixture
def mixed(source):
    """Ten samples, slow and fast, with all five signals."""
    samples = torch.cat([torch.arange(0, 5), torch.arange(500, 505)])
    return build(source, samples, torch.arange(10) % 5, torch.arange(10) % 8)


def parameters(module):
    return sum(p.numel() for p in module.parameters())


def test_parameters_are_the_published():
    pgae = PGAE()
    assert parameters(pgae) == 657_778
    assert parameters(pgae.words_in) == 132_600 and parameters(pgae.clip_in) == 135_400
    assert parameters(pgae.fuse) == 80_150
    assert parameters(pgae.language) == 20_400 + 132_923
    assert parameters(pgae.action) == 20_400 + 135_905
    assert parameters(PVAE()) == 464_228


def test_a_prae_lacks_the_variances_and_the_inputs_for_signals_that_the_published_one_counts():
    published, signals, units = 436_128, 5, 100
    assert parameters(PVAE(PRAEConfig())) == published - signals * 4 * units


@pytest.mark.slow
def test_the_gate_chooses_between_the_modalities():
    torch.manual_seed(0)
    unit, action, language = GatedUnit(6, 7, 4), torch.randn(3, 6), torch.randn(3, 7)
    torch.nn.init.zeros_(unit.gate.weight)
    halves = unit.action(action).tanh(), unit.language(language).tanh()
    for bias, share in ((50.0, 1.0), (-50.0, 0.0), (0.0, 0.5)):
        torch.nn.init.constant_(unit.gate.bias, bias)
        wanted = share * halves[0] + (1 - share) * halves[1]
        torch.testing.assert_close(unit(action, language), wanted)


def test_the_gate_sees_both_modalities():
    torch.manual_seed(0)
    unit, action, language = GatedUnit(6, 7, 4), torch.randn(3, 6), torch.randn(3, 7)
    code = unit(action, language)
    torch.nn.init.zeros_(unit.gate.weight[:, :6])
    other = unit(action, language)
    torch.nn.init.zeros_(unit.gate.weight[:, 6:])
    assert (other - code).abs().max() > 1e-3 < (unit(action, language) - other).abs().max()


def test_word_weights_are_the_published():
    weights = class_weights(True)
    assert weights.sum().item() == pytest.approx(23)
    wanted = {"<eos>": 0.1168, "fast": 0.467, "unhurriedly": 0.467, "push": 0.7005,
              "move-down": 0.7005, "red": 1.401, "greenish-blue": 1.401}  # fmt: skip
    for word, weight in wanted.items():
        assert weights[WORD_INDEX[word]].item() == pytest.approx(weight, abs=1e-4)


def test_word_weights_multiply_the_cross_entropy_of_the_word_asked_for(mixed):
    words = torch.full((10, 4, 23), 1 / 23).log()
    answer = Answer(words, mixed.joints, torch.zeros(10, 1), torch.zeros(10, 0, 6, 100))
    weights = class_weights(True)
    wanted = [
        np.mean([weights[w].item() for w, there in zip(said, mask, strict=True) if there])
        for said, mask in zip(mixed.words.tolist(), mixed.word_mask.tolist(), strict=True)
    ]
    language, _ = losses(answer, mixed, weights)
    assert language.item() == pytest.approx(np.mean(wanted) * np.log(23), rel=1e-5)


def test_pgae_weighs_words_unless_told_otherwise(mixed, small_configs):
    costs = []
    for weigh in (True, False):
        torch.manual_seed(0)
        model = PGAE(replace(small_configs["pgae"], weigh_words=weigh))
        costs.append(model.loss(mixed)[0].item())
        weights = class_weights(True) if weigh else None
        assert costs[-1] == pytest.approx(losses(model(mixed), mixed, weights)[0].item())
    assert costs[0] != pytest.approx(costs[1], rel=0.01)


@pytest.mark.parametrize("kind", FAMILY)
def test_without_a_gain_weights_start_as_published(kind):
    make, make_config, _ = MODELS[kind]
    for gain, smaller in ((0.0, True), (1.5, False)):
        model = make(make_config(gain=gain))
        cells = [
            p
            for name, p in model.named_parameters()
            if "weight_hh" in name or "weight_ih.w" in name
        ]
        assert (max(p.abs().max() for p in cells) <= 0.1) == smaller


@pytest.mark.parametrize("kind", FAMILY)
def test_padding_is_not_read(make_model, mixed, kind):
    model = make_model(kind)
    keys, tokens = mixed.keys.clone(), mixed.tokens.clone()
    keys[5:, 50:] = 1.0
    tokens[~mixed.token_mask] = 7
    first, second = model(mixed), model(replace(mixed, keys=keys, tokens=tokens))
    assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))
    keys[5:, 49] = 1.0
    assert not torch.equal(model(replace(mixed, keys=keys)).code, first.code)


@pytest.mark.parametrize("signal", SIGNALS)
def test_pgae_answers_from_one_code_of_both_inputs(make_model, make_batch, signal):
    model, batch = make_model("pgae"), make_batch([3, 503], signal)
    answer, tokens = model(batch), batch.tokens.clone()
    torch.testing.assert_close(model.language(answer.code, 4), answer.words)
    torch.testing.assert_close(model.action(answer.code, batch.video, batch.start), answer.joints)
    tokens[:, 0] = signal_number("describe") if signal != "describe" else WORD_INDEX[SIGNALS[1]]
    for changed in (replace(batch, keys=batch.keys * 0.5), replace(batch, tokens=tokens)):
        assert (model(changed).code - answer.code).abs().amax(1).min() > 1e-4


@pytest.mark.parametrize("kind", ["pvae", "prae"])
@pytest.mark.parametrize("signal", SIGNALS)
def test_the_signal_says_whose_code_is_decoded(make_model, make_batch, kind, signal):
    """The answers of each decoder depend on one of the two inputs and not on the other."""
    model, batch = make_model(kind), make_batch([3, 503], signal)
    tokens = batch.tokens.clone()
    tokens[:, 1] = 5
    answer, other_words = model(batch), model(replace(batch, tokens=tokens))
    other_clip = model(replace(batch, keys=batch.keys * 0.5))
    by_words = {"words": signal not in BY_ACTION, "joints": signal in BY_LANGUAGE}
    for name, from_words in by_words.items():
        said, with_words, with_clip = (
            getattr(a, name) for a in (answer, other_words, other_clip)
        )  # fmt: skip
        assert torch.equal(said, with_words) != from_words
        assert torch.equal(said, with_clip) == from_words


@pytest.mark.parametrize("kind", ["pvae", "prae"])
def test_codes_come_of_reversed_inputs_without_the_signal(make_model, mixed, kind):
    model = make_model(kind)
    said, done = model.encode(mixed)
    for i in range(10):
        words, frames = mixed.token_mask[i].sum(), mixed.step_mask[i].sum() + 1
        sentence = torch.eye(23)[mixed.tokens[i, 1:words]].flip(0)[None]
        clip = mixed.keys[i, :frames].flip(0)[None]
        for half, rows, code in ((model.words_in, sentence, said), (model.clip_in, clip, done)):
            summary = half.encoder(rows, torch.tensor([rows.shape[1]]))
            torch.testing.assert_close(half.mean(summary)[0], code.mean[i])


def test_binding_by_hand():
    torch.manual_seed(0)
    first, second = torch.randn(4, 3), torch.randn(4, 3)
    apart = [[(a - b).norm().item() for b in second] for a in first]
    wanted = sum(apart[i][i] for i in range(4)) / 4
    for i in range(4):
        for j in range(4):
            if i != j:
                for gap in (apart[i][j], apart[j][i]):
                    wanted += max(0, apart[i][i] - gap + 0.5) / 16
    assert binding(first, second, 0.5).item() == pytest.approx(wanted, rel=1e-5)


def test_binding_of_codes_that_agree_has_a_gradient():
    code = torch.zeros(3, 2, requires_grad=True)
    binding(code, torch.zeros(3, 2), 1.0).backward()
    assert code.grad.isfinite().all()


def test_divergence_is_that_from_a_standard_normal():
    torch.manual_seed(0)
    code = Code(torch.randn(4, 3), torch.randn(4, 3))
    mine = torch.distributions.Normal(code.mean, (code.log_variance / 2).exp())
    wanted = torch.distributions.kl_divergence(mine, torch.distributions.Normal(0.0, 1.0))
    torch.testing.assert_close(divergence(code), wanted.mean())


def test_a_pvae_is_moved_by_chance_in_training_alone(make_model, mixed):
    model = make_model("pvae")
    code = Code(torch.ones(5000, 2), torch.tensor([[1.0, 4.0]]).log().expand(5000, 2))
    drawn = model.draw(code)
    np.testing.assert_allclose(drawn.mean(0), 1, atol=0.02)
    np.testing.assert_allclose(drawn.std(0), [0.1, 0.2], rtol=0.05)
    assert not torch.equal(*(torch.stack(model.loss(mixed)) for _ in range(2)))
    assert torch.equal(model(mixed).joints, model(mixed).joints)


def test_a_seed_moves_a_pvae_alike_wherever_it_is_trained(make_model):
    model, code, drawn = make_model("pvae"), Code(torch.zeros(2, 4), torch.zeros(2, 4)), []
    for device in ("cpu", "meta"):  # a training sets its device for all that a model makes itself
        torch.manual_seed(1)
        with torch.device(device):
            drawn.append(model.draw(code))
    assert torch.equal(*drawn) and drawn[0].abs().min() > 0


def test_a_prae_knows_no_chance(make_model, mixed):
    model = make_model("prae")
    assert torch.equal(*(torch.stack(model.loss(mixed)) for _ in range(2)))
    said, done = model.encode(mixed)
    _, _, bound = model.loss(mixed)
    torch.testing.assert_close(bound, 2 * binding(said.mean, done.mean, 1.0))


def test_what_binds_a_pvae_is_weighed_as_configured(make_model, mixed, small_configs):
    model = make_model("pvae")
    said, done = model.encode(mixed)
    wanted = 2 * binding(said.mean, done.mean, 1.0) + divergence(said) + divergence(done)
    torch.testing.assert_close(model.loss(mixed)[2], wanted)


@pytest.mark.parametrize("kind", FAMILY)
def test_gradients_reach_every_parameter(make_model, make_batch, mixed, kind):
    model = make_model(kind)
    batch = mixed if kind == "pgae" else make_batch([0, 3, 500, 505], "repeat both")
    sum(model.loss(batch)).backward()
    assert not [name for name, p in model.named_parameters() if p.grad.abs().max() < 1e-9]


@pytest.mark.parametrize("kind", FAMILY)
def test_it_learns_to_describe_eight_samples(unchecked, samples, source, kind):
    """Of eight meanings, by its costs in training; clips are cut to 10 frames for speed."""
    torch.manual_seed(0)
    indices = torch.arange(8) * 108

    def batch(signal):
        numbers = torch.full((8,), signal_number(signal))
        whole = build(source, indices, numbers, torch.zeros(8, dtype=torch.long))
        cut = {"keys": 10, "video": 9, "joints": 9, "step_mask": 9}
        parts = {name: getattr(whole, name)[:, :n] for name, n in cut.items()}
        return replace(whole, frames=torch.full((8,), 10), **parts)

    make, make_config, _ = MODELS[kind]
    model = make(make_config(features=6, code=16, units=24))
    learnt = batch("describe" if kind == "pgae" else "repeat both")
    optimiser = torch.optim.Adam(model.parameters(), lr=0.01)
    for _ in range(60):
        optimiser.zero_grad()
        sum(model.loss(learnt)).backward()
        optimiser.step()
    assert len(set(source.meaning[indices].tolist())) == 8
    assert correct(model(batch("describe")), samples, indices.numpy()).all()


@pytest.mark.parametrize("kind", FAMILY)
def test_a_model_is_trained_and_comes_back_from_its_file(tmp_path, few, small_configs, kind):
    config, path = small_configs[kind], tmp_path / "model.safetensors"
    trained = training.train(few, Recipe(epochs=1, batch=8), model=kind, config=config)
    checkpoint.save(path, trained)
    again = checkpoint.load(path)
    assert again.about["kind"] == kind and again.model.config == config
    assert len(again.about["history"][0]) == (2 if kind == "pgae" else 3)
    for signal in SIGNALS:
        first, second = (
            respond(one, Source(one.dataset(few)), np.arange(len(few.frames)), signal)
            for one in (trained, again)
        )
        assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


def test_training_binds_the_halves(few, small_configs):
    made = []
    for weight in (2.0, 0.0):
        config = replace(small_configs["prae"], binding=weight)
        trained = training.train(few, Recipe(epochs=1, batch=8), model="prae", config=config)
        made.append(trained.model.words_in.mean.weight)
    assert not torch.equal(*made)


def shares(signals):
    drawn = torch.bincount(signals, minlength=5) / len(signals)
    return {s: drawn[signal_number(s)].item() for s in SIGNALS}


@pytest.mark.parametrize(
    ("mix", "supervised", "wanted"),
    [
        (PGAEConfig().mix.regular, 2 / 3, [1 / 3, 1 / 3, 1 / 9, 1 / 9, 1 / 9]),
        (PGAEConfig().mix.limited, 1.0, [1 / 3, 1 / 3, 0, 1 / 3, 0]),
        (PGAEConfig().mix.limited, 0.0, [0, 0, 1 / 2, 0, 1 / 2]),
        (PVAEConfig().mix.regular, 2 / 3, [0, 0, 0, 1, 0]),
    ],
)
def test_each_model_draws_its_own_signals(mix, supervised, wanted):
    drawn = draw_signals(np.random.default_rng(0), 60_000, supervised, mix)
    assert shares(drawn) == pytest.approx(dict(zip(SIGNALS, wanted, strict=True)), abs=0.008)


def test_repeat_both_needs_a_label(samples):
    train = samples.split("train")
    labelled = training.label(train, 10, seed=0)
    rng = np.random.default_rng(0)
    epoch = epoch_batches(rng, train, labelled, Recipe(), PGAEConfig().mix.limited)
    parts, signals = (np.concatenate(column) for column in zip(*epoch, strict=True))
    both = signals == signal_number("repeat both")
    assert both.any() and np.isin(parts[both], labelled).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model": "gpt"}, "no model 'gpt'; there are ptae, pgae, pvae, prae"),
        ({"model": "pgae", "config": PTAEConfig()}, "pgae needs a PGAEConfig, not a PTAEConfig"),
        ({"model": "prae", "config": PVAEConfig()}, "prae needs a PRAEConfig, not a PVAEConfig"),
    ],
)
def test_trainings_that_make_no_sense_are_refused(few, options, message):
    with pytest.raises(ConfigError, match=message):
        training.train(few, Recipe(epochs=1, batch=8), **options)


@pytest.mark.parametrize(
    ("make", "wrong", "message"),
    [
        (PGAEConfig, {"code": 0}, "code is 0; it must be 1 or more"),
        (PVAEConfig, {"language_layers": 0}, "language_layers is 0; it must be 1 or more"),
        (PVAEConfig, {"noise": -0.1}, "noise is -0.1; it must be 0 or more"),
        (PRAEConfig, {"margin": -1.0}, "margin is -1.0; it must be 0 or more"),
    ],
)
def test_sizes_that_make_no_sense_are_refused(make, wrong, message):
    with pytest.raises(ConfigError, match=message):
        make(**wrong)


def test_each_model_has_a_recipe():
    assert MODELS["ptae"].recipe == Recipe()

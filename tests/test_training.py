"""The training loop: losses by hand, who draws which signal, labelled samples, seeds."""

from collections import Counter
from dataclasses import replace
from math import log

import numpy as np
import pytest
import torch

from ptae_lite import training
from ptae_lite.data import batches
from ptae_lite.data.batches import draw_partners, draw_signals, epoch_batches
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.data.signals import SUPERVISED, UNSUPERVISED, Batch, build, mixup, signal_number
from ptae_lite.errors import ConfigError
from ptae_lite.language import COLOURS, patterns
from ptae_lite.models.common import Answer, losses
from ptae_lite.training import Recipe

SUPERVISED_NUMBERS = [signal_number(s) for s in SUPERVISED]
UNSUPERVISED_NUMBERS = [signal_number(s) for s in UNSUPERVISED]


def answer_of(batch: Batch, chances, error) -> Answer:
    """An answer that gives each wanted word a chance, and misses each pose by `error`."""
    count = len(batch.words)
    words = torch.full((count, 4, 23), -50.0)
    words.scatter_(2, batch.words[..., None], torch.tensor(chances).log()[:, :, None])
    return Answer(words, batch.joints + error, torch.zeros(count, 1), torch.zeros(count, 1, 6, 100))


def test_losses_by_hand(source):
    """Four steps of a sentence against one of EOS alone; 99 and 49 of 99 steps count."""
    slow, fast = 0, 500
    signals = torch.tensor([signal_number("describe"), signal_number("execute")])
    batch = build(source, torch.tensor([slow, fast]), signals, torch.tensor([0, 3]))
    chances = [[0.5, 0.25, 0.5, 0.25], [0.1, 0.9, 0.9, 0.9]]
    language, action = losses(answer_of(batch, chances, 0.2), batch)
    first = -(log(0.5) + log(0.25) + log(0.5) + log(0.25)) / 4
    assert language.item() == pytest.approx((first - log(0.1)) / 2, rel=1e-5)
    assert action.item() == pytest.approx(0.2**2 * (99 + 49) / (2 * 99), rel=1e-5)


@pytest.mark.slow
def test_a_share_of_the_samples_has_a_true_extra_input(few, tiny, monkeypatch):
    given, real = [], batches.build

    def build(source, samples, signals, alternative, hold_steps, congruent_input, sentence_from):
        given.append(congruent_input)
        return real(
            source, samples, signals, alternative, hold_steps, congruent_input, sentence_from
        )

    monkeypatch.setattr(batches, "build", build)
    training.train(few, Recipe(epochs=20, batch=8, p_congruent_input=0.25), config=tiny)
    assert torch.cat(given).float().mean() == pytest.approx(0.25, abs=0.06)
    given.clear()
    training.train(few, Recipe(epochs=1, batch=8), config=tiny)
    assert given == [None] * 3


@pytest.mark.parametrize("congruent_input", [-0.1, 1.5])
def test_a_wrong_share_of_extra_input_is_refused(congruent_input):
    with pytest.raises(ConfigError, match=f"is {congruent_input}; it is a share from 0 to 1"):
        Recipe(p_congruent_input=congruent_input)


def test_a_perfect_answer_costs_nothing(source):
    batch = build(source, torch.arange(10), torch.arange(10) % 5, torch.arange(10) % 8)
    language, action = losses(answer_of(batch, [[1.0] * 4] * 10, 0.0), batch)
    assert language.item() == action.item() == 0


@pytest.mark.parametrize("supervised", [2 / 3, 0.02, 0.5])
def test_signals_are_drawn_in_their_proportions(supervised):
    drawn = draw_signals(np.random.default_rng(0), 60_000, supervised)
    shares = torch.bincount(drawn, minlength=5) / len(drawn)
    wanted = [0.0] * 5
    for numbers, share in (
        (SUPERVISED_NUMBERS, supervised),
        (UNSUPERVISED_NUMBERS, 1 - supervised),
    ):
        for number in numbers:
            wanted[number] = share / 2
    np.testing.assert_allclose(shares, wanted, atol=0.008)


def test_an_epoch_takes_every_sample_once(samples):
    train = samples.split("train")
    epoch = list(epoch_batches(np.random.default_rng(0), train, None, Recipe()))
    assert [len(part) for part, _ in epoch] == [27] * 24
    assert sorted(np.concatenate([part for part, _ in epoch])) == train.tolist()


@pytest.mark.parametrize("share", [1, 10, 50, 66.6, 99])
@pytest.mark.parametrize("balanced", [False, True])
def test_only_labelled_samples_take_supervised_signals_and_only_they(samples, share, balanced):
    train = samples.split("train")
    labelled = training.label(train, share, seed=0)
    epoch = epoch_batches(np.random.default_rng(0), train, labelled, Recipe(balanced=balanced))
    parts, signals = (np.concatenate(column) for column in zip(*epoch, strict=True))
    supervised = np.isin(signals, SUPERVISED_NUMBERS)
    assert np.isin(signals[~supervised], UNSUPERVISED_NUMBERS).all()
    np.testing.assert_array_equal(np.isin(parts, labelled), supervised)
    assert supervised.mean() == (0.5 if balanced else len(labelled) / len(train))


def test_where_half_of_each_batch_has_a_label_the_others_come_in_turn(samples):
    train = samples.split("train")
    labelled = training.label(train, 1, seed=0)
    epoch = epoch_batches(np.random.default_rng(0), train, labelled, Recipe(balanced=True))
    parts = np.concatenate([part for part, _ in epoch])
    assert set(labelled) <= set(parts)
    others = parts[~np.isin(parts, labelled)]
    assert len(set(others)) == len(others) == 324


@pytest.mark.parametrize(
    ("percent", "count"), [(1, 7), (2, 13), (5, 33), (10, 65), (50, 324), (100, 648)]
)
def test_labelled_shares_are_rounded_up_as_in_the_paper(samples, percent, count):
    train = samples.split("train")
    labelled = training.label(train, percent, seed=3)
    assert len(set(labelled)) == count and set(labelled) <= set(train)
    np.testing.assert_array_equal(labelled, training.label(train, percent, seed=3))


def test_another_seed_labels_other_samples(samples):
    train = samples.split("train")
    first, second = (training.label(train, 10, seed) for seed in (0, 1))
    assert not np.array_equal(first, second)


@pytest.mark.parametrize("share", [0, -1, 100.1])
def test_a_share_that_does_not_exist_is_refused(samples, share):
    with pytest.raises(ConfigError, match=f"a share of {share} % does not exist"):
        training.label(samples.split("train"), share, seed=0)


def weights(trained):
    return torch.cat([p.flatten() for p in trained.model.parameters()])


def test_the_same_seed_gives_the_same_weights_and_another_others(few, tiny):
    made = [
        weights(training.train(few, Recipe(epochs=1, batch=12, seed=seed), config=tiny))
        for seed in (1, 1, 2)
    ]
    assert torch.equal(made[0], made[1])
    assert not torch.equal(made[0], made[2])


def test_training_lowers_both_losses_and_tells_every_epoch(few, tiny):
    sentence_from = []
    trained = training.train(
        few,
        Recipe(epochs=10, batch=8, learning_rate=0.02),
        config=tiny,
        on_epoch=lambda epoch, now: sentence_from.append((epoch, len(now.about["history"]))),
    )
    assert sentence_from == [(epoch, epoch) for epoch in range(1, 11)]
    first, last = (np.array(trained.about["history"][i]) for i in (0, -1))
    assert (last < first).all()
    assert trained.about["steps"] == 10 * 3 and not trained.model.training


def test_scaling_is_fitted_on_training_samples_only(few, tiny):
    changed = few.joints.copy()
    changed[few.split("test")] *= 5
    recipe = Recipe(epochs=1, batch=12)
    first = training.train(few, recipe, config=tiny)
    second = training.train(replace(few, joints=changed), recipe, config=tiny)
    np.testing.assert_array_equal(first.scaling.joint_range, second.scaling.joint_range)
    assert torch.equal(weights(first), weights(second))


def test_all_samples_labelled_is_the_regular_training(few, tiny):
    train, recipe = few.split("train"), Recipe(epochs=1, batch=12)
    regular = training.train(few, recipe, config=tiny)
    labelled = training.train(few, recipe, config=tiny, labelled=train)
    assert torch.equal(weights(regular), weights(labelled))
    assert regular.about["labelled"] == labelled.about["labelled"] == len(train)


def test_a_labelled_training_says_how_many_were_labelled(few, tiny):
    labelled = few.split("train")[:5]
    trained = training.train(few, Recipe(epochs=1, batch=12), config=tiny, labelled=labelled)
    assert trained.about["labelled"] == 5


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"epochs": 0}, "at least one epoch"),
        ({"batch": 1}, "batches of at least two"),
        ({"supervised": 0.0}, "supervised is 0.0; it is a share between 0 and 1"),
        ({"warmup": 1.0}, "warmup is 1.0, muon_lr 0.004 and muon_decay 1.0; .* 0 to below 1"),
        ({"muon_lr": -1.0}, "a learning rate and a decay are not below 0"),
        ({"muon_decay": -1.0}, "muon_decay -1.0; .* are not below 0"),
        ({"supervised": 1.0}, "supervised is 1.0"),
    ],
)
def test_recipes_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ConfigError, match=message):
        Recipe(**wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"recipe": Recipe(batch=54)}, "24 samples do not fill a batch of 54"),
        ({"labelled": np.array([35])}, "labelled samples must belong to the split 'train'"),
        ({"split": "all"}, "no split 'all'; there are train, test, held_out, fit"),
    ],
)
def test_trainings_that_make_no_sense_are_refused(few, tiny, wrong, message):
    with pytest.raises(ConfigError, match=message):
        training.train(few, **({"recipe": Recipe(epochs=1, batch=8), "config": tiny} | wrong))


def test_scaling_whitens_features_and_brings_joints_to_their_room(samples, scaling):
    train = samples.split("train")
    inside = np.arange(100) < samples.frames[train, None]
    joints = scaling.joints(samples.joints[train][inside])
    np.testing.assert_allclose([joints.min(0), joints.max(0)], [[-0.9] * 5, [0.9] * 5], atol=1e-6)
    whitened = fit_scaling(samples, train, 0.5)
    features = whitened.features(samples.features[train][inside])
    np.testing.assert_allclose(features.mean(0), 0, atol=1e-6)
    np.testing.assert_allclose(np.cov(features, rowvar=False), 0.25 * np.eye(6), atol=1e-3)


def test_scaled_joints_come_back(samples, scaling):
    np.testing.assert_allclose(
        scaling.joints_back(scaling.joints(samples.joints)), samples.joints, atol=1e-6
    )


@pytest.mark.parametrize(("exponent", "power"), [(0.0, 1.0), (0.25, 0.5)])
def test_a_smaller_exponent_keeps_more_of_the_features_own_spread(samples, exponent, power):
    """Variances after scaling are the principal ones to the power 1 - 2 exponent."""
    changed = replace(samples, features=samples.features * np.float32([1, 2, 3, 4, 5, 6]))
    train = changed.split("train")
    inside = np.arange(100) < changed.frames[train, None]
    raw = changed.features[train][inside].astype(float)
    scaled = fit_scaling(changed, train, exponent).features(raw)
    wanted = np.linalg.eigvalsh(np.cov(raw, rowvar=False)) ** power
    np.testing.assert_allclose(scaled.var(0), 0.25 * wanted / wanted.mean(), rtol=1e-3)


def test_held_out_patterns_ask_what_the_test_patterns_ask(samples):
    held_out, fit = samples.split("held_out"), samples.split("fit")
    assert sorted([*held_out, *fit]) == samples.split("train").tolist()
    held = [patterns()[i] for i in sorted({samples.pattern[i] for i in held_out})]
    rest = [patterns()[i] for i in sorted({samples.pattern[i] for i in fit})]
    assert len(held) == len({p.meaning for p in held}) == 16
    assert {p.target_colour for p in held} == set(COLOURS)
    for p in held:  # as for a test pattern, its meaning is known on this side, in another scene
        assert any((q.meaning, q.side) == (p.meaning, p.side) for q in rest)
    shown = Counter(p.arrangement for p in rest)
    assert {shown[p.arrangement] for p in held} == {7}  # of 12


def test_the_action_decoder_learns_at_its_own_pace(few, tiny):
    """Without a pace it stays as it was made; the rest does not."""
    torch.manual_seed(0)
    recipe = Recipe(epochs=1, batch=8, action_lr_scale=0, seed=3)
    trained = training.train(few, recipe, config=tiny).model
    torch.manual_seed(3)
    fresh = type(trained)(tiny)
    for name, p in trained.named_parameters():
        same = torch.equal(p, dict(fresh.named_parameters())[name])
        assert same == name.startswith("action.") or name.endswith("key.bias"), name


def test_partners_have_the_same_signal_and_shares_are_of_the_larger_part():
    signals = torch.tensor([0, 1, 0, 0, 2, 1])
    share, partner = draw_partners(np.random.default_rng(0), signals)
    assert torch.equal(signals[partner], signals) and sorted(partner.tolist()) == list(range(6))
    assert share.min() >= 0.5 and share.max() <= 1
    assert partner.tolist() != list(range(6))


def test_a_blended_clip_asks_for_both_sentences_in_its_shares(make_batch):
    batch = make_batch([0, 500], "describe")
    answer = Answer(torch.randn(2, 4, 23).log_softmax(2), torch.zeros(2, 99, 5),
                    torch.zeros(2, 1), torch.zeros(2, 1, 6, 100))  # fmt: skip
    shares, partner = torch.tensor([0.7, 0.6]), torch.tensor([1, 0])
    found = losses(answer, mixup(batch, shares, partner))[0]
    own = losses(answer, batch)[0]
    swapped = losses(answer, replace(batch, words=batch.words[partner]))[0]
    steps = -answer.words.gather(2, batch.words[..., None])[..., 0].mean(1)
    others = -answer.words.gather(2, batch.words[partner][..., None])[..., 0].mean(1)
    torch.testing.assert_close(found, (shares * steps + (1 - shares) * others).mean())
    torch.testing.assert_close((steps.mean(), others.mean()), (own, swapped))


def test_without_mixup_no_clip_is_blended(few, tiny, monkeypatch):
    seen, real = [], batches.mixup
    monkeypatch.setattr(batches, "mixup", lambda *parts: seen.append(1) or real(*parts))
    for used, steps in ((False, 0), (True, 3)):
        training.train(few, Recipe(epochs=1, batch=8, mixup=used), config=tiny)
        assert len(seen) == steps

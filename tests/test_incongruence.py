"""Conflicts: false in exactly the named aspects, put before the model, and a fair control."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
import torch
from conftest import EYE
from torch import nn

from ptae_lite.data.signals import Source
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import incongruence
from ptae_lite.experiments.incongruence import EXTRA_INPUT, Condition, conflict_sets
from ptae_lite.language import SYNONYMS, Meaning, encode, parse, pattern, patterns, sentence
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.ptae import Answer

SUBSETS = [s for count in range(4) for s in combinations(("action", "colour", "speed"), count)]
MOVED = [s for count in range(4) for s in combinations(("action", "position", "speed"), count)]
every_signal = pytest.mark.parametrize("signal", EXTRA_INPUT)


class Spy(nn.Module):
    """Answers nothing of use, and keeps every batch that it was given."""

    def __init__(self):
        super().__init__()
        self.seen = []

    def forward(self, batch):
        self.seen.append(batch)
        count = len(batch.tokens)
        shapes = [(count, 4, 23), (count, 99, 5), (count, 1), (count, 1, 6, 100)]
        return Answer(*(torch.zeros(shape) for shape in shapes))


@pytest.fixture
def spy(scaling):
    return Trained(Spy(), scaling, {"encoder": EYE})


@pytest.mark.parametrize(("conflicts", "count"), [(0, 1), (1, 3), (2, 3), (3, 1)])
@every_signal
def test_conflict_sets(signal, conflicts, count):
    found = conflict_sets(signal, conflicts)
    assert len(set(found)) == len(found) == count
    allowed = ("action", "colour", "speed")
    if signal in ("execute", "repeat language"):
        allowed = ("action", "position", "speed")
    assert all(len(set(s)) == conflicts and set(s) <= set(allowed) for s in found)


@pytest.mark.parametrize("signal", ["repeat both", "sing"])
def test_a_signal_without_a_conflict_is_refused_with_those_that_have_one(signal, samples):
    message = f"no conflict for signal {signal!r}; there are describe, repeat action, execute, rep"
    with pytest.raises(ConfigError, match=message):
        conflict_sets(signal, 1)
    with pytest.raises(ConfigError, match=message):
        incongruence.extra_inputs(samples, [0], Condition(signal, "language", ("action",)))


@pytest.mark.parametrize("conflicts", [-1, 4])
def test_another_number_of_conflicts_is_refused(conflicts):
    message = f"{conflicts} conflicts do not exist; there are 0, 1, 2 or 3"
    with pytest.raises(ConfigError, match=message):
        conflict_sets("execute", conflicts)


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (("describe", "language", ("position",)), "'position' in language; there are action, col"),
        (("execute", "action", ("colour",)), "'colour' in action; there are action, position, s"),
        (
            ("describe", "vision", ("action",)),
            "describe has no condition 'vision' with 1 conflicts",
        ),
        (
            ("repeat language", "blank"),
            "no condition 'blank' with 0 conflicts; there are none, con",
        ),
        (
            ("execute", "action"),
            "no condition 'action' with 0 conflicts; there are none, congruent",
        ),
        (
            ("execute", "none", ("speed",)),
            "action, vision, proprioception with 1 to 3, in the order",
        ),
    ],
)
def test_a_condition_that_does_not_exist_is_refused_with_those_that_do(samples, condition, message):
    with pytest.raises(ConfigError, match=message):
        incongruence.extra_inputs(samples, [0], Condition(*condition))


def test_every_choice_of_aspects_is_a_condition_and_so_are_the_controls():
    found = {signal: incongruence.conditions(signal) for signal in EXTRA_INPUT}
    counts = {signal: len(set(some)) for signal, some in found.items()}
    assert counts == {"describe": 10, "repeat action": 10, "execute": 25, "repeat language": 24}
    for signal, some in found.items():
        for place in incongruence.PLACES[EXTRA_INPUT[signal]]:
            aspects = [c.aspects for c in some if c.conflict_in == place]
            assert aspects == [a for n in (1, 2, 3) for a in conflict_sets(signal, n)]
        controls = [c.conflict_in for c in some if not c.aspects]
        assert controls[:3] == ["none", "congruent", "congruent_other"]
        assert ("blank" in controls) == (signal == "execute")


@pytest.mark.parametrize("aspects", SUBSETS, ids=" ".join)
def test_a_false_sentence_is_false_in_the_named_aspects_and_keeps_its_register(aspects):
    rng = np.random.default_rng(0)
    second = set(SYNONYMS.values())
    for p in patterns()[::3]:
        for alternative in range(8):
            text = sentence(p.meaning, alternative)
            false = incongruence.false_sentence(text, aspects, rng)
            pairs = zip(p.meaning, parse(false), strict=True)
            differs = [a for a, (x, y) in zip(Meaning._fields, pairs, strict=True) if x != y]
            assert tuple(differs) == aspects
            assert [w in second for w in false.split()] == [w in second for w in text.split()]


def test_every_false_word_is_as_likely():
    rng = np.random.default_rng(0)
    texts = [incongruence.false_sentence("push red fast", ("colour",), rng) for _ in range(2000)]
    counts = Counter(parse(text).colour for text in texts)
    assert set(counts) == {"green", "blue", "yellow", "cyan", "violet"}
    assert min(counts.values()) > 330 and max(counts.values()) < 470


@pytest.mark.parametrize("aspects", MOVED, ids=" ".join)
def test_a_partner_differs_in_the_named_aspects_and_has_the_same_cubes(aspects):
    rng = np.random.default_rng(0)
    for p in patterns():
        other = incongruence.partner(p, aspects, rng)
        assert (other.left, other.right) == (p.left, p.right)
        fields = {"action": "action", "position": "side", "speed": "speed"}
        differs = [a for a, f in fields.items() if getattr(p, f) != getattr(other, f)]
        assert tuple(differs) == aspects
        assert (other.target_colour != p.target_colour) == ("position" in aspects)


def test_both_other_actions_are_taken():
    rng = np.random.default_rng(0)
    taken = {incongruence.partner(pattern(0), ("action",), rng).action for _ in range(50)}
    assert taken == {"pull", "slide"}


def most(signal):
    (aspects,) = conflict_sets(signal, 3)
    return Condition(signal, EXTRA_INPUT[signal], aspects)


@every_signal
def test_extra_inputs_follow_their_seed(samples, signal):
    indices = samples.split("test")
    made = [incongruence.extra_inputs(samples, indices, most(signal), seed) for seed in (0, 0, 1)]
    assert made[0] == made[1] != made[2]


def test_the_partners_clip_is_the_same_variation(samples):
    indices = samples.split("test")
    chosen = incongruence.extra_inputs(samples, indices, most("execute"))
    np.testing.assert_array_equal(samples.variation[chosen], samples.variation[indices])
    for mine, other in zip(samples.pattern[indices], samples.pattern[chosen], strict=True):
        p, q = pattern(int(mine)), pattern(int(other))
        assert p.action != q.action and p.side != q.side and p.speed != q.speed
        assert (p.left, p.right) == (q.left, q.right)


@every_signal
def test_vision_and_proprioception_have_the_partners_of_the_whole_conflict(samples, signal):
    if EXTRA_INPUT[signal] == "language":
        return
    indices = samples.split("test")
    drawn = [
        incongruence.extra_inputs(samples, indices, Condition(signal, place, ("action",)))
        for place in ("action", "vision", "proprioception")
    ]
    assert drawn[0] == drawn[1] == drawn[2]


@pytest.mark.parametrize("signal", ["describe", "repeat action"])
def test_false_sentences_reach_the_query_and_nothing_else_changes(spy, samples, source, signal):
    """216 samples take two batches, so the order is tested too."""
    indices = samples.split("test")
    condition = Condition(signal, "language", ("action", "speed"))
    plain, seen = asked(spy, source, indices, Condition(signal), condition)
    texts = incongruence.extra_inputs(samples, indices, condition)
    tokens = torch.cat([batch.tokens for batch in seen])
    assert tokens[:, 1:].tolist() == [encode(text) for text in texts]
    assert len(plain) == len(seen) == 2
    for before, after in zip(plain, seen, strict=True):
        assert torch.equal(before.tokens[:, 0], after.tokens[:, 0])  # the signal
        assert not before.token_mask[:, 2:].any() and after.token_mask.all()
        assert changed(before, after) == {"tokens", "token_mask"}


def asked(spy, source, indices, *conditions):
    """The batches that a model is given under each condition."""
    given = []
    for condition in conditions:
        spy.model.seen = []
        incongruence.respond_under(spy, source, indices, condition)
        given.append(spy.model.seen)
    return given


def changed(before, after):
    return {
        name for name, old in vars(before).items() if not torch.equal(old, getattr(after, name))
    }


@pytest.mark.parametrize("place", ["action", "vision", "proprioception"])
@pytest.mark.parametrize("signal", ["execute", "repeat language"])
def test_false_clips_reach_keys_and_values_and_nothing_else(spy, samples, source, signal, place):
    indices = samples.split("test")
    condition = Condition(signal, place, ("position", "speed"))
    plain, seen = asked(spy, source, indices, Condition(signal), condition)
    partners = incongruence.extra_inputs(samples, indices, condition)
    assert (samples.frames[partners] != samples.frames[indices]).all()
    watched = indices if place == "proprioception" else partners
    felt = indices if place == "vision" else partners
    # each with its own length, zero behind it
    wanted = torch.cat([source.features[watched], source.joints[felt]], dim=2)
    assert torch.equal(torch.cat([batch.keys for batch in seen]), wanted)
    frames = np.maximum(samples.frames[watched], samples.frames[felt])
    assert torch.cat([batch.frames for batch in seen]).tolist() == frames.tolist()
    for before, after in zip(plain, seen, strict=True):
        assert {"keys"} <= changed(before, after) <= {"keys", "frames"}


def test_blank_keys_are_zero_and_nothing_else_changes(spy, samples, source):
    indices = samples.split("test")[:20]
    (plain,), (seen,) = asked(
        spy, source, indices, Condition("execute"), Condition("execute", "blank")
    )
    assert not seen.keys.any() and changed(plain, seen) == {"keys"}


@every_signal
def test_the_control_is_the_extra_input_without_a_conflict(
    spy, samples, source, make_batch, signal
):
    """All true: the sample's own sentence, or its own moving clip, as `repeat both` has both."""
    indices = samples.split("test")[:20]
    condition = Condition(signal, "congruent")
    ((batch,),) = asked(spy, source, indices, condition)
    whole = make_batch(indices.tolist(), "repeat both")
    if EXTRA_INPUT[signal] == "language":
        texts = incongruence.extra_inputs(samples, indices, condition)
        assert [parse(text) for text in texts] == [
            pattern(int(i)).meaning for i in samples.pattern[indices]
        ]
        assert len({tuple(w in SYNONYMS for w in text.split()) for text in texts}) > 2
        assert torch.equal(batch.token_mask, whole.token_mask)
        assert batch.tokens[:, 1:].tolist() == [encode(text) for text in texts]
    else:
        assert torch.equal(batch.keys, whole.keys) and torch.equal(batch.frames, whole.frames)


@every_signal
def test_the_other_control_is_of_the_same_meaning_and_another_one(samples, signal):
    indices = samples.split("test")
    own, other = (
        incongruence.extra_inputs(samples, indices, Condition(signal, place))
        for place in ("congruent", "congruent_other")
    )
    assert all(a != b for a, b in zip(own, other, strict=True))
    if EXTRA_INPUT[signal] == "language":
        assert [parse(text) for text in own] == [parse(text) for text in other]
    else:
        assert own == indices.tolist()
        np.testing.assert_array_equal(samples.pattern[own], samples.pattern[other])


def test_a_real_model_answers_otherwise_under_a_conflict_and_the_same_each_time(trained, samples):
    source, indices = Source(trained.dataset(samples)), samples.split("test")[:10]
    plain, *told = (
        incongruence.respond_under(trained, source, indices, condition).joints
        for condition in (Condition("execute"), *[Condition("execute", "action", ("speed",))] * 2)
    )
    assert torch.equal(told[0], told[1]) and not torch.equal(told[0], plain)

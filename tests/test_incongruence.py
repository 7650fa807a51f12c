"""Conflicts: false in exactly the named aspects, put before the model, and a fair control."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
import torch
from conftest import EYE
from torch import nn

from ptae_lite.errors import ConfigError
from ptae_lite.language import SYNONYMS, Meaning, encode, parse, pattern, patterns, sentence
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.ptae import Answer
from ptae_lite.signals import Source
from ptae_lite.studies import incongruence
from ptae_lite.studies.incongruence import ASPECTS, EXTRA_INPUT, conflict_sets

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

    def column(self, name):
        return torch.cat([getattr(batch, name) for batch in self.seen])


@pytest.fixture
def spy(scaling):
    return Trained(Spy(), scaling, {"eye": EYE})


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
        incongruence.conflicting_inputs(samples, [0], signal, ("action",))


@pytest.mark.parametrize("conflicts", [-1, 4])
def test_another_number_of_conflicts_is_refused(conflicts):
    message = f"{conflicts} conflicts do not exist; there are 0, 1, 2 or 3"
    with pytest.raises(ConfigError, match=message):
        conflict_sets("execute", conflicts)


@pytest.mark.parametrize(
    ("signal", "aspect", "message"),
    [
        ("describe", "position", "'position' in language; there are action, colour, speed"),
        ("execute", "colour", "'colour' in action; there are action, position, speed"),
    ],
)
def test_an_aspect_that_the_input_does_not_have_is_refused(samples, signal, aspect, message):
    with pytest.raises(ConfigError, match=f"no conflict of {message}"):
        incongruence.conflicting_inputs(samples, [0], signal, (aspect,))


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


@every_signal
def test_extra_inputs_follow_their_seed(samples, signal):
    indices = samples.split("test")
    (aspects,) = conflict_sets(signal, 3)
    made = [
        incongruence.conflicting_inputs(samples, indices, signal, aspects, seed)
        for seed in (0, 0, 1)
    ]
    assert made[0] == made[1] != made[2]


def test_the_partners_clip_is_the_same_variation(samples):
    indices = samples.split("test")
    aspects = ("action", "position", "speed")
    chosen = incongruence.conflicting_inputs(samples, indices, "execute", aspects)
    np.testing.assert_array_equal(samples.variation[chosen], samples.variation[indices])
    for mine, other in zip(samples.pattern[indices], samples.pattern[chosen], strict=True):
        p, q = pattern(int(mine)), pattern(int(other))
        assert p.action != q.action and p.side != q.side and p.speed != q.speed
        assert (p.left, p.right) == (q.left, q.right)


@pytest.mark.parametrize("signal", ["describe", "repeat action"])
def test_false_sentences_reach_the_query_and_nothing_else_changes(spy, samples, source, signal):
    """216 samples take two batches, so the order is tested too."""
    indices, aspects = samples.split("test"), ("action", "speed")
    incongruence.respond(spy, source, indices, signal)
    plain, spy.model.seen = spy.model.seen, []
    incongruence.respond_with_extra(spy, source, indices, signal, aspects)
    texts = incongruence.conflicting_inputs(samples, indices, signal, aspects)
    tokens = spy.model.column("tokens")
    assert tokens[:, 1:].tolist() == [encode(text) for text in texts]
    assert spy.model.column("token_mask").all()
    assert len(plain) == len(spy.model.seen) == 2
    for before, after in zip(plain, spy.model.seen, strict=True):
        assert torch.equal(before.tokens[:, 0], after.tokens[:, 0])  # the signal
        assert not before.token_mask[:, 2:].any()
        for name in ("keys", "video", "start", "words", "word_mask", "joints", "step_mask"):
            assert torch.equal(getattr(before, name), getattr(after, name))


@pytest.mark.parametrize("signal", ["execute", "repeat language"])
def test_false_clips_reach_keys_and_values_and_nothing_else_changes(spy, samples, source, signal):
    indices, aspects = samples.split("test"), ("position", "speed")
    incongruence.respond(spy, source, indices, signal)
    plain, spy.model.seen = spy.model.seen, []
    incongruence.respond_with_extra(spy, source, indices, signal, aspects)
    chosen = incongruence.conflicting_inputs(samples, indices, signal, aspects)
    wanted = torch.cat([source.features[chosen], source.joints[chosen]], dim=2)
    assert torch.equal(spy.model.column("keys"), wanted)
    swapped = samples.frames[chosen] != samples.frames[indices]
    assert swapped.all()  # the partner's own length, padding included
    for before, after in zip(plain, spy.model.seen, strict=True):
        for name in vars(before):
            same = torch.equal(getattr(before, name), getattr(after, name))
            assert same == (name != "keys")


@every_signal
def test_the_control_is_the_extra_input_without_a_conflict(
    spy, samples, source, make_batch, signal
):
    """All true: the sentence of the sample's own meaning, or the sample's own moving clip."""
    indices = samples.split("test")[:20]
    incongruence.respond_with_extra(spy, source, indices, signal, ())
    (batch,) = spy.model.seen
    extra = incongruence.conflicting_inputs(samples, indices, signal, ())
    # `repeat both` has the whole sentence and the moving clip by its wiring
    whole = make_batch(indices.tolist(), "repeat both")
    if EXTRA_INPUT[signal] == "language":
        meanings = [pattern(int(i)).meaning for i in samples.pattern[indices]]
        assert [parse(text) for text in extra] == meanings
        assert len({tuple(w in SYNONYMS for w in text.split()) for text in extra}) > 2
        assert torch.equal(batch.token_mask, whole.token_mask)
        assert batch.tokens[:, 1:].tolist() == [encode(text) for text in extra]
    else:
        assert extra == indices.tolist()
        assert torch.equal(batch.keys, whole.keys)


@pytest.fixture(scope="module")
def table(samples, scaling):
    return incongruence.run(Trained(Spy(), scaling, {"eye": EYE}), samples, "held_out")


def test_the_table_has_a_row_for_every_choice_and_the_control(table):
    assert list(table.columns) == [
        "signal", "conflict_in", "conflicts", "aspects", "accuracy", "nrmse", "nrmse_valid",
    ]  # fmt: skip
    assert len(table) == 4 * 9
    assert not table.duplicated(["signal", "conflict_in", "aspects"]).any()
    for signal, place in EXTRA_INPUT.items():
        rows = table[table["signal"] == signal]
        counts = Counter(zip(rows["conflict_in"], rows["conflicts"], strict=True))
        assert counts == {
            ("none", 0): 1, ("congruent", 0): 1, (place, 1): 3, (place, 2): 3, (place, 3): 1,
        }  # fmt: skip
        for aspects, count in zip(rows["aspects"], rows["conflicts"], strict=True):
            named = tuple(aspects.split())
            assert len(named) == count and set(named) <= set(ASPECTS[place])


def test_words_have_an_accuracy_and_actions_an_error(table):
    words = table["signal"].isin(["describe", "repeat language"])
    assert table.loc[words, "accuracy"].notna().all()
    assert table.loc[words, ["nrmse", "nrmse_valid"]].isna().all(axis=None)
    assert table.loc[~words, "accuracy"].isna().all()
    assert (table.loc[~words, "nrmse"] < table.loc[~words, "nrmse_valid"]).all()


def test_a_real_model_answers_otherwise_under_a_conflict_and_the_same_each_time(trained, samples):
    source, indices = Source(trained.dataset(samples)), samples.split("test")[:10]
    plain = incongruence.respond(trained, source, indices, "execute")
    told = [
        incongruence.respond_with_extra(trained, source, indices, "execute", ("speed",))
        for _ in range(2)
    ]
    assert torch.equal(told[0].joints, told[1].joints)
    assert not torch.equal(told[0].joints, plain.joints)


def test_a_story_tells_what_was_asked_and_answered(trained, samples):
    source = Source(trained.dataset(samples))
    calm = incongruence.story(trained, source, 0, "describe", None)
    assert calm["sample"] == "push left cube slowly" and calm["extra"] == "none"
    assert calm["asked"] == "push red slowly"
    assert calm["right"] == (calm["answer"] in {sentence(pattern(0).meaning, k) for k in range(8)})
    false = incongruence.story(trained, source, 0, "describe", ("action", "colour", "speed"))
    assert not set(parse(false["extra"])) & set(pattern(0).meaning)
    moved = incongruence.story(trained, source, 0, "execute", ("position",))
    assert moved["extra"] == "a clip, push right cube slowly" and moved["joints"].shape == (99, 5)

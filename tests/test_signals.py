"""The signal table, cell by cell, against the published wiring written out once more here."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptae_lite.data import signals
from ptae_lite.data.scaling import prepare
from ptae_lite.errors import ConfigError, LanguageError
from ptae_lite.language import SIGNALS, WORD_INDEX, alternatives, pattern
from ptae_lite.models import PTAE
from ptae_lite.models.ptae import PTAEConfig

# What follows the signal word; keys and values; what is to be said; what the action decoder sees;
# where it starts; what it is to do.
PUBLISHED = {
    "describe": ("EOS", "all", "sentence", "last", "last", "last"),
    "execute": ("sentence", "first", "EOS", "all", "first", "all"),
    "repeat action": ("EOS", "all", "EOS", "all", "first", "all"),
    "repeat both": ("sentence", "all", "sentence", "all", "first", "all"),
    "repeat language": ("sentence", "first", "sentence", "first", "first", "first"),
}
SLOW, FAST = 6 * 2 + 1, 6 * 80 + 4  # sample numbers
EIGHTH = 5
every_cell = [
    pytest.param(signal, sample, id=f"{signal}, {speed}")
    for signal in PUBLISHED
    for speed, sample in (("slow", SLOW), ("fast", FAST))
]


@pytest.fixture(scope="module")
def data(source):
    return source.dataset


@pytest.fixture
def wired(make_batch):
    """A function: the one row of a batch of a sample and a signal, beside another row."""

    def wire(signal, sample):
        batch = make_batch([100, sample], signal, EIGHTH)
        return {name: array[1].numpy() for name, array in vars(batch).items()}

    return wire


def words_of(sample):
    text = alternatives(pattern(sample // 6).meaning)[EIGHTH]
    return [WORD_INDEX[word] for word in text.split()]


def at(frame, length):
    return {"first": 0, "last": length - 1}[frame]


@pytest.mark.parametrize(("signal", "sample"), every_cell)
def test_query_tokens(wired, signal, sample):
    row, (query, *_) = wired(signal, sample), PUBLISHED[signal]
    sentence = [0, *words_of(sample), 0]
    wanted = [23 + SIGNALS.index(signal)] + ([0] if query == "EOS" else sentence)
    assert row["tokens"][row["token_mask"]].tolist() == wanted
    assert row["token_mask"].tolist() == [True] * len(wanted) + [False] * (6 - len(wanted))


@pytest.mark.parametrize(("signal", "sample"), every_cell)
def test_keys_and_values(wired, data, signal, sample):
    row, (_, keys, *_) = wired(signal, sample), PUBLISHED[signal]
    length = data.samples.frames[sample]
    wanted = np.zeros((100, 11), np.float32)
    for t in range(length):
        seen = t if keys == "all" else 0
        wanted[t] = [*data.features[sample, seen], *data.joints[sample, seen]]
    np.testing.assert_array_equal(row["keys"], wanted)


@pytest.mark.parametrize(("signal", "sample"), every_cell)
def test_language_target(wired, signal, sample):
    row, (_, _, said, *_) = wired(signal, sample), PUBLISHED[signal]
    wanted = [0] if said == "EOS" else [*words_of(sample), 0]
    assert row["words"][row["word_mask"]].tolist() == wanted
    assert row["word_mask"].tolist() == [True] * len(wanted) + [False] * (4 - len(wanted))


@pytest.mark.parametrize(("signal", "sample"), every_cell)
def test_video_of_the_action_decoder(wired, data, signal, sample):
    """Frames 1 to 99, of which a fast clip has 50; a still frame is shown at every step."""
    row, (*_, video, _, _) = wired(signal, sample), PUBLISHED[signal]
    length = data.samples.frames[sample]
    shown = range(99) if video == "all" else [at(video, length)] * 99
    wanted = np.stack([data.features[sample, t] for t in shown])
    np.testing.assert_array_equal(row["video"], wanted)
    if video == "all":
        assert not row["video"][length:].any()


@pytest.mark.parametrize(("signal", "sample"), every_cell)
def test_first_pose_of_the_action_decoder(wired, data, signal, sample):
    row, (*_, start, _) = wired(signal, sample), PUBLISHED[signal]
    wanted = data.joints[sample, at(start, data.samples.frames[sample])]
    np.testing.assert_array_equal(row["start"], wanted)


@pytest.mark.parametrize(("signal", "sample"), every_cell)
def test_action_target(wired, data, signal, sample):
    row, (*_, joints) = wired(signal, sample), PUBLISHED[signal]
    length = data.samples.frames[sample]
    wanted = np.zeros((99, 5), np.float32)
    for step in range(length - 1):
        wanted[step] = data.joints[sample, step + 1 if joints == "all" else at(joints, length)]
    np.testing.assert_array_equal(row["joints"], wanted)
    assert row["step_mask"].tolist() == [True] * (length - 1) + [False] * (100 - length)


def test_first_and_last_frames_differ_so_that_the_tests_above_can_tell_them_apart(data):
    for sample in (SLOW, FAST):
        last = data.samples.frames[sample] - 1
        assert (data.features[sample, 0] != data.features[sample, last]).all()
        assert (data.joints[sample, 0] != data.joints[sample, last]).all()


def test_signals_mixed_in_one_batch_are_wired_as_each_alone(source, wired):
    samples = torch.tensor([SLOW, FAST, SLOW, FAST, SLOW])
    mixed = signals.build(source, samples, torch.arange(5), torch.full((5,), EIGHTH))
    for i, signal in enumerate(SIGNALS):
        alone = wired(signal, samples[i].item())
        for name, array in alone.items():
            np.testing.assert_array_equal(getattr(mixed, name)[i].numpy(), array)


def test_wiring_a_batch_changes_no_data(source):
    before = source.features.clone(), source.joints.clone(), source.sentences.clone()
    signals.build(source, torch.arange(10), torch.arange(10) % 5, torch.arange(10) % 8)
    after = source.features, source.joints, source.sentences
    assert all(torch.equal(a, b) for a, b in zip(before, after, strict=True))


def test_scaled_padding_is_exactly_zero(data):
    beyond = np.arange(100) >= data.samples.frames[:, None]
    assert not data.joints[beyond].any() and not data.features[beyond].any()
    assert data.joints[~beyond].any(axis=1).all()


def test_only_padding_tells_a_fast_clip_from_a_slow_one(samples, scaling):
    """Half the frames of a clip, unpadded, have nearly its code; padded, they have another."""
    torch.manual_seed(0)
    slow = np.flatnonzero(samples.frames == 100)[::20]
    thin = replace(
        samples,
        joints=np.zeros_like(samples.joints),
        features=np.zeros_like(samples.features),
        frames=np.full(864, 50),
    )
    thin.joints[:, :50], thin.features[:, :50] = samples.joints[:, ::2], samples.features[:, ::2]
    model = PTAE(PTAEConfig(features=samples.features.shape[2], hidden=64)).eval()

    def codes(of, frames):
        source = signals.Source(prepare(of, scaling))
        number = torch.full((len(slow),), signals.signal_number("describe"))
        batch = signals.build(source, torch.from_numpy(slow), number, torch.zeros_like(number))
        with torch.no_grad():
            words = model.words_in(batch.tokens, batch.token_mask)
            inside = torch.ones(len(slow), frames, dtype=torch.bool)
            return model.encoder(words, batch.token_mask, batch.keys[:, :frames], inside)[0]

    whole = codes(samples, 100)
    cut, padded = codes(thin, 50), codes(thin, 100)
    assert (cut - whole).norm(dim=1).mean() < 0.1 * (padded - whole).norm(dim=1).mean()


def test_the_shown_table_is_the_wiring():
    shown = {row["signal"]: tuple(row.values())[1:] for row in signals.table()}
    said = {"EOS": "eos", "all": "clip"}
    assert shown == {s: tuple(said.get(x, x) for x in row) for s, row in PUBLISHED.items()}


def test_a_batch_that_makes_no_sense_is_refused(unchecked, source):
    with pytest.raises(ConfigError, match="as many signals and alternatives as samples"):
        signals.build(source, torch.arange(3), torch.arange(2), torch.arange(3))
    with pytest.raises(LanguageError, match="no signal 'sing'; the signals are describe"):
        signals.signal_number("sing")


@pytest.mark.parametrize("signal", ["describe", "execute", "repeat action", "repeat language"])
def test_a_true_extra_input_is_the_sentence_and_the_moving_clip(source, signal):
    """`repeat both` has both by its wiring; all else stays the signal's own."""
    samples, sentences = torch.tensor([SLOW, FAST, SLOW]), torch.tensor([EIGHTH, 0, 3])

    def build(name, congruent_input=None):
        numbers = torch.full((3,), signals.signal_number(name))
        return signals.build(source, samples, numbers, sentences, congruent_input=congruent_input)

    given, plain = build(signal, torch.tensor([True, True, False])), build(signal)
    whole = build("repeat both")
    assert torch.equal(given.tokens[:2, 1:], whole.tokens[:2, 1:])
    assert given.token_mask[:2].all() and torch.equal(given.keys[:2], whole.keys[:2])
    for name in ("tokens", "token_mask", "keys"):
        assert torch.equal(getattr(given, name)[2], getattr(plain, name)[2])
        changed = not torch.equal(getattr(given, name)[:2], getattr(plain, name)[:2])
        shown = {"describe": "tokens", "repeat action": "tokens"}.get(signal, "keys")
        assert changed == (name == shown or (name == "token_mask" and shown == "tokens"))
    for name in ("frames", "video", "start", "words", "word_mask", "joints", "step_mask"):
        assert torch.equal(getattr(given, name), getattr(plain, name))


def test_a_clip_whose_sentence_is_told_is_not_blended(source):
    numbers = torch.full((3,), signals.signal_number("describe"))
    sentence_from = torch.tensor([True, False, False])
    batch = signals.build(
        source, torch.tensor([0, 500, 7]), numbers, 0 * numbers, congruent_input=sentence_from
    )
    mixed = signals.mixup(batch, torch.full((3,), 0.6), torch.tensor([1, 2, 0]))
    assert torch.equal(mixed.share, torch.tensor([1, 0.6, 1]))
    assert torch.equal(mixed.keys[[0, 2]], batch.keys[[0, 2]])


def test_two_clips_are_blended_only_where_both_are_to_be_described(source):
    asked = ("describe", "describe", "execute", "describe")
    numbers = torch.tensor([signals.signal_number(signal) for signal in asked])
    batch = signals.build(
        source, torch.tensor([0, 500, 7, 30]), numbers, torch.zeros(4, dtype=torch.long)
    )
    share = torch.tensor([0.75, 0.5, 0.6, 0.7])
    mixed = signals.mixup(batch, share, torch.tensor([1, 0, 3, 2]))
    expected = 0.75 * batch.keys[0] + 0.25 * batch.keys[1]
    torch.testing.assert_close(mixed.keys[0], expected)
    assert torch.equal(mixed.keys[2:], batch.keys[2:])
    assert torch.equal(mixed.share, torch.tensor([0.75, 0.5, 1, 1]))
    assert mixed.frames.tolist() == [100, 100, *batch.frames[2:].tolist()]  # as long as the longer
    assert torch.equal(mixed.other_words[:2], batch.words[[1, 0]])
    for name in ("tokens", "video", "start", "joints", "words", "step_mask"):
        assert torch.equal(getattr(mixed, name), getattr(batch, name))

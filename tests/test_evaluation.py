"""The measures: any of eight sentences, NRMSE by hand, and what a model that knows little gets."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ptae_lite import baselines, controls, evaluation
from ptae_lite.data.scaling import Scaling, prepare
from ptae_lite.data.signals import Source
from ptae_lite.errors import LanguageError
from ptae_lite.language import (
    COLOURS,
    EOS,
    MEANINGS,
    SPEEDS,
    decode,
    encode,
    parse,
    pattern,
    sentence,
)
from ptae_lite.models.ptae import Answer


def saying(outputs) -> Answer:
    """An answer that says these tokens."""
    words = torch.nn.functional.one_hot(torch.tensor(outputs), 23).float()
    count = len(outputs)
    return Answer(
        words, torch.zeros(count, 99, 5), torch.zeros(count, 1), torch.zeros(count, 1, 6, 9)
    )


def told(samples, indices, alternative):
    """What a perfect model says of each sample, in one of the eight ways."""
    meanings = [pattern(int(i)).meaning for i in samples.pattern[indices]]
    return [encode(sentence(meaning, alternative))[1:] for meaning in meanings]


@pytest.mark.parametrize("alternative", range(8))
def test_any_of_the_eight_sentences_is_right(samples, alternative):
    indices = samples.split("test")
    assert evaluation.correct(saying(told(samples, indices, alternative)), samples, indices).all()


@pytest.mark.parametrize("place", range(4))
def test_one_wrong_word_or_a_missing_end_is_not(samples, place):
    indices = samples.split("test")
    outputs = told(samples, indices, 0)
    for output in outputs[::2]:
        output[place] = 1 if place != 1 else 5  # azure is no action, speed or end; fast no colour
    right = evaluation.correct(saying(outputs), samples, indices)
    assert right.tolist() == [i % 2 == 1 for i in range(len(indices))]


def test_words_are_scored_each_for_itself(samples):
    indices = samples.split("test")
    outputs = told(samples, indices, 7)
    for output in outputs[:54]:
        output[1] = 5
    scores = evaluation.word_accuracy(saying(outputs), samples, indices)
    assert scores == {"action_accuracy": 100, "colour_accuracy": 75, "speed_accuracy": 100}


def test_chance_is_one_of_36_meanings(samples):
    """Always the same sentence is right in 6 of the 216 test samples: 2.78 %."""
    assert round(evaluation.CHANCE, 2) == 2.78
    indices = samples.split("test")
    for meaning in MEANINGS:
        outputs = [encode(sentence(meaning))[1:]] * len(indices)
        right = evaluation.correct(saying(outputs), samples, indices)
        assert 100 * right.mean() == pytest.approx(evaluation.CHANCE)


def test_sentences_are_the_words_without_the_tag(samples):
    said = evaluation.sentences(saying(told(samples, [0, 863], 0)))
    assert said == ["push red slowly", "slide violet fast"]


@pytest.fixture
def two(samples):
    """A slow and a fast sample, both at rest, and a scaling with a range of 2 (joint 5: 4)."""
    indices = np.array([0, 863])
    still = replace(samples, joints=np.zeros_like(samples.joints))
    high = np.array([1.0, 1.0, 1.0, 1.0, 3.0])
    return still, indices, Scaling(-np.ones(5), high, np.zeros(6), np.eye(6))


def test_nrmse_by_both_definitions(two):
    """Off by a tenth of the range: 10 % over valid frames, less where padding counts as right."""
    samples, indices, scaling = two
    predicted = np.zeros((2, 99, 5)) + 0.1 * scaling.joint_range
    padded, valid = evaluation.nrmse(predicted, samples, indices, scaling)
    assert valid == pytest.approx(10)
    assert padded == pytest.approx(10 * np.sqrt((99 + 49) / (2 * 99)))


def test_nrmse_pools_squares_over_frames_and_joints(two):
    samples, indices, scaling = two
    predicted = np.zeros((2, 99, 5))
    predicted[0, 3, 4] = 2.0  # half of the range of joint 5, in one frame of the slow clip
    padded, valid = evaluation.nrmse(predicted, samples, indices, scaling)
    assert valid == pytest.approx(100 * np.sqrt(0.5**2 / ((99 + 49) * 5)))
    assert padded == pytest.approx(100 * np.sqrt(0.5**2 / (2 * 99 * 5)))


def test_what_is_answered_beyond_a_clip_does_not_count(two):
    samples, indices, scaling = two
    predicted = np.zeros((2, 99, 5))
    predicted[1, 49:] = 100
    assert evaluation.nrmse(predicted, samples, indices, scaling) == (0, 0)


def test_predicted_poses_are_compared_with_the_next_frames(samples, scaling):
    indices = samples.split("test")
    scaled = torch.from_numpy(prepare(samples, scaling).joints[indices, 1:])
    answer = saying(told(samples, indices, 0))._replace(joints=scaled)
    made = evaluation.poses(answer, scaling)
    assert evaluation.nrmse(made, samples, indices, scaling)[1] < 1e-4


def test_a_signal_that_does_not_exist_is_refused(trained, samples):
    source = Source(trained.dataset(samples))
    message = "no signal 'sing'; the signals are describe, execute, repeat action"
    with pytest.raises(LanguageError, match=message):
        evaluation.respond(trained, source, [0], "sing")


def test_references_by_hand(two):
    """Clips of one joint: the pose is +-1 by the action's side, plus its place in the clip."""
    samples, _, scaling = two
    side = np.array([1.0 if pattern(int(i)).side == "left" else -1.0 for i in samples.pattern])
    inside = np.arange(100) < samples.frames[:, None]
    joints = np.zeros((864, 100, 5))
    joints[..., 0] = (side[:, None] * (np.arange(100) > 0)) * inside
    found = baselines.references(replace(samples, joints=joints), scaling)
    assert found["mean of action word and side"] == (0, 0)
    # off by 1 of a range of 2 in one of five joints, at every step
    assert found["hold the first pose"][1] == pytest.approx(100 * np.sqrt(0.5**2 / 5))
    # the mean of 52 clips at 1 and 56 at -1 (of 108 training patterns) is nearly 0
    assert found["mean trajectory"][1] == pytest.approx(100 * np.sqrt(0.5**2 / 5), rel=0.05)
    assert found["mean trajectory"][0] == pytest.approx(
        found["mean trajectory"][1] * 0.8646, rel=1e-3
    )


def test_knowing_more_of_the_action_never_hurts_on_training_samples(samples, scaling):
    found = baselines.references(samples, scaling, "train")
    names = ["mean trajectory", "mean of action word", "mean of action word and side"]
    valid = [found[name][1] for name in names]
    assert valid == sorted(valid, reverse=True)


def test_where_no_training_clip_is_alike_the_mean_is_of_those_that_are_most_alike(few, scaling):
    """Of the few, no slow slide is in training: what is left to know of it is the speed."""
    shown = [pattern(int(i)) for i in few.pattern]
    trained_on = {(shown[i].speed, shown[i].action) for i in few.split("train")}
    asked = [shown[i] for i in few.split("test")]
    assert any((p.speed, p.action) not in trained_on for p in asked)
    made = baselines._group_means(few, few.split("test"), few.split("train"), ("speed", "action"))
    for p, mean in zip(asked, made, strict=True):
        whole = (p.speed, p.action) in trained_on
        alike = [
            i for i in few.split("train")
            if shown[i].speed == p.speed and (shown[i].action == p.action or not whole)
        ]  # fmt: skip
        np.testing.assert_allclose(mean, few.joints[alike][:, 1:].mean(0), atol=1e-6)


def test_answers_come_in_order_whatever_the_batch(trained, few):
    source = Source(trained.dataset(few))
    indices = np.array([30, 2, 17, 5, 11])
    together = evaluation.respond(trained, source, indices, "execute")
    parts = evaluation.respond(trained, source, indices, "execute", size=2)
    one = evaluation.respond(trained, source, indices[3:4], "execute")
    torch.testing.assert_close(parts.joints, together.joints)
    torch.testing.assert_close(one.joints, together.joints[3:4])
    assert not torch.equal(together.joints[0], together.joints[1])


def test_a_batch_can_be_changed_before_the_model_sees_it(trained, few):
    source = Source(trained.dataset(few))
    blank = evaluation.respond(
        trained, source, [0, 1], "execute",
        change=lambda batch: replace(batch, video=torch.zeros_like(batch.video)),
    )  # fmt: skip
    assert not torch.equal(
        blank.joints, evaluation.respond(trained, source, [0, 1], "execute").joints
    )


def test_each_sample_is_always_given_the_same_sentence():
    first = evaluation.alternatives_for(864)
    assert torch.equal(first, evaluation.alternatives_for(864))
    assert not torch.equal(first, evaluation.alternatives_for(864, seed=1))
    assert set(first.tolist()) == set(range(8))


def test_an_evaluation_names_its_numbers(trained, few):
    scores = evaluation.evaluate(trained, few)
    assert set(scores) == {
        "describe_accuracy", "repeat_language_accuracy", "execute_nrmse", "execute_nrmse_valid",
        "repeat_action_nrmse", "repeat_action_nrmse_valid",
    }  # fmt: skip
    assert all(score >= 0 for score in scores.values())
    assert scores["execute_nrmse"] < scores["execute_nrmse_valid"]


def test_controls_change_what_they_name_and_nothing_else(samples, make_batch):
    batch = make_batch([0, 6, 432, 500], "execute", 5)
    changed = {name: change(batch) for name, change in controls.CONTROLS.items()}
    for name, part in (("sentence blanked", "tokens"), ("sentences shuffled", "tokens"),
                       ("speed word swapped", "tokens"), ("video frozen", "video")):  # fmt: skip
        for field, value in vars(batch).items():
            assert torch.equal(getattr(changed[name], field), value) == (field != part), name
    assert changed["as trained"] is batch
    said = [decode(row[2:].tolist()) for row in batch.tokens]
    blank = changed["sentence blanked"].tokens
    assert torch.equal(blank[:, 0], batch.tokens[:, 0]) and blank[:, 1:].abs().max() == EOS
    shuffled = [decode(row[2:].tolist()) for row in changed["sentences shuffled"].tokens]
    assert shuffled == [said[1], said[0], said[3], said[2]]  # among clips of one length
    for text, row in zip(said, changed["speed word swapped"].tokens, strict=True):
        other = decode(row[2:].tolist())
        assert other.split()[:2] == text.split()[:2]
        assert {parse(text).speed, parse(other).speed} == {"slowly", "fast"}
        plain = text.split()[2] in SPEEDS
        assert (other.split()[2] in SPEEDS) == plain  # in the same register
    video = changed["video frozen"].video
    assert torch.equal(video, batch.video[:, :1].expand_as(video))


def test_controls_are_scored_on_execute(trained, few):
    found = controls.execute_errors(trained, few)
    assert list(found) == list(controls.CONTROLS)
    scores = evaluation.evaluate(trained, few)
    assert found["as trained"] == (scores["execute_nrmse"], scores["execute_nrmse_valid"])
    assert len(set(found.values())) == len(found)


def test_a_scene_is_new_where_neither_speed_of_it_is_for_training(samples):
    new = evaluation.new_scenes(samples)
    indices = samples.split("test")
    assert new.sum() == 72  # twelve patterns
    found = set(samples.pattern[indices[new]])
    assert found == {2, 6, 9, 38, 42, 45, 74, 78, 81, 110, 114, 117}


def test_accuracy_by_scenes_splits_the_answers(samples):
    new = evaluation.new_scenes(samples)
    found = evaluation.accuracy_by_scenes(~new, samples)
    assert found == {"describe_accuracy_new_scenes": 0, "describe_accuracy_known_scenes": 100}


@pytest.fixture
def telling(samples):
    """Samples in which length, place of the arm and colours are in plain view."""
    told = [pattern(int(i)) for i in samples.pattern]
    joints = np.zeros_like(samples.joints)
    item, last = np.arange(864), samples.frames - 1
    middle = np.round(last / 2).astype(int)
    joints[item, middle, 0] = [1 if p.side == "left" else -1 for p in told]
    for i, p in enumerate(told):
        joints[i, middle[i], 1 + ["push", "pull", "slide"].index(p.action)] = 1
    features = np.zeros((864, 100, 12), np.float32)
    for side, first in (("left", 0), ("right", 6)):
        features[item, 0, [first + COLOURS.index(getattr(p, side)) for p in told]] = 1
    return replace(samples, joints=joints, features=features)


def test_the_linear_baseline_reads_what_is_in_plain_view(telling):
    train, test = telling.split("train"), telling.split("test")
    said = baselines.linear_describe(telling, train, test)
    assert said == [pattern(int(i)).meaning for i in telling.pattern[test]]
    assert baselines.linear_describe_accuracy(telling, train) == 100


def test_the_linear_baseline_is_taught_by_labelled_samples_alone(telling):
    one = telling.split("train")[:1]
    said = baselines.linear_describe(telling, one, telling.split("test"))
    assert set(said) == {pattern(int(telling.pattern[one[0]])).meaning}


def test_the_linear_baseline_cannot_read_what_is_not_there(telling):
    blind = replace(telling, features=np.zeros_like(telling.features))
    assert baselines.linear_describe_accuracy(blind, blind.split("train")) < 40

"""Who is followed: what answers say, in words and in motions, and whose it is."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch

from ptae_lite.data.samples import load_samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.experiments import answer_source
from ptae_lite.experiments.answer_source import DecodedAnswer, Motions
from ptae_lite.experiments.incongruence import Condition
from ptae_lite.language import EOS, WORD_INDEX, encode, pattern
from ptae_lite.models.common import Answer

TRUTH, FALSE = DecodedAnswer("push", "red", "fast"), DecodedAnswer("pull", "blue", "slowly")


@pytest.mark.parametrize(
    ("decoded", "distractor", "expected"),
    [
        (TRUTH, FALSE, "truth"),
        (FALSE, FALSE, "distractor"),
        (DecodedAnswer("push", "blue", "fast"), FALSE, "mixture"),
        (DecodedAnswer("pull", "blue", "fast"), FALSE, "mixture"),
        (DecodedAnswer("slide", "red", "fast"), FALSE, "neither"),
        (DecodedAnswer(), FALSE, "neither"),
        (DecodedAnswer("pull", "red", "fast"), DecodedAnswer("pull", "red", "fast"), "distractor"),
        # the distractor's cube is none that there is
        (DecodedAnswer("pull", "red", "fast"), DecodedAnswer("pull", None, "fast"), "mixture"),
        (DecodedAnswer(), DecodedAnswer(None, None, None), "neither"),
        (TRUTH, TRUTH, "truth"),  # nothing in conflict
        (FALSE, TRUTH, "neither"),
    ],
)
def test_an_answer_follows_one_of_four(decoded, distractor, expected):
    assert answer_source.follows(decoded, TRUTH, distractor) == expected


def test_shares_add_up_and_say_which_aspects_are_the_distractors():
    decoded = [TRUTH, FALSE, DecodedAnswer("push", "blue", "fast"), DecodedAnswer()]
    found = answer_source.shares(decoded, [TRUTH] * 4, [FALSE] * 4)
    assert [found[name] for name in answer_source.SOURCES] == [25, 25, 25, 25]
    assert (found["action_taken"], found["cube_taken"], found["speed_taken"]) == (25, 50, 25)
    one = answer_source.shares(decoded, [TRUTH] * 4, [TRUTH._replace(speed="slowly")] * 4)
    assert np.isnan(one["action_taken"]) and one["speed_taken"] == 25


def test_words_say_their_meaning_and_anything_else_says_nothing():
    assert answer_source.decode_words(encode("move-up scarlet quickly")[1:]) == TRUTH
    push, red, fast = (WORD_INDEX[word] for word in ("push", "red", "fast"))
    for wrong in ([push, red, fast, red], [red, push, fast, EOS], [push, EOS, fast, EOS],
                  [EOS] * 4, [push, red, fast]):  # fmt: skip
        assert answer_source.decode_words(wrong) == DecodedAnswer()


@pytest.fixture(scope="module")
def acted(samples):
    """Samples whose motions are those of their actions, at their own speed, and a little noise."""
    rng = np.random.default_rng(2)
    shapes = {key: rng.normal(size=(2, 5)) for key in product(("push", "pull", "slide"), "lr")}
    joints = np.zeros_like(samples.joints)
    for i, number in enumerate(samples.pattern):
        p, count = pattern(int(number)), samples.frames[i]
        phase = np.pi * np.linspace(0, 1, count)[:, None]
        first, second = shapes[p.action, p.side[0]]
        joints[i, :count] = first * np.sin(phase) + second * np.sin(2 * phase)
        joints[i, :count] += rng.normal(scale=0.02, size=5)
    return replace(samples, joints=joints)


@pytest.fixture(scope="module")
def motions(acted):
    return Motions(acted, fit_scaling(acted, acted.split("train")))


def test_there_are_twelve_means_and_every_clip_is_nearest_to_its_own(acted, motions):
    assert len(motions.tracks) == 12
    assert all(track.shape == (100, 5) for track in motions.tracks.values())
    for i in acted.split("test").tolist():
        p = pattern(int(acted.pattern[i]))
        what, distance = motions.nearest(acted.joints[i, 1 : acted.frames[i]])
        assert what == (p.action, p.side, p.speed) and distance < 2 * motions.reach


def test_a_mean_is_played_at_either_speed_and_the_fast_one_rests(motions):
    slow, fast = (
        motions.tracks[DecodedAnswer("push", "left", speed)] for speed in ("slowly", "fast")
    )
    np.testing.assert_allclose(fast[:50:7], slow[np.linspace(0, 99, 50)[::7].round().astype(int)],
                               atol=0.05)  # fmt: skip
    np.testing.assert_array_equal(fast[50:], np.repeat(fast[49:50], 50, axis=0))


def test_a_fast_motion_in_a_slow_clip_is_told_by_its_course(acted, motions):
    fast = motions.tracks[DecodedAnswer("pull", "right", "fast")]
    assert motions.nearest(fast[1:])[0] == ("pull", "right", "fast")


def test_distances_are_percent_of_the_joints_range(motions):
    decoded = DecodedAnswer("slide", "left", "slowly")
    moved = motions.tracks[decoded][1:] + 0.03 * motions.scaling.joint_range
    assert motions.nearest(moved) == (decoded, pytest.approx(3))


def test_answers_farther_than_any_clip_say_nothing():
    decoded = [(TRUTH, 3.0), (FALSE, 5.0)]
    assert answer_source.within(decoded, 4.0) == [TRUTH, DecodedAnswer()]


def test_answers_are_read_in_the_order_of_the_samples(acted, motions):
    indices = acted.split("test")[[0, 50, 100]]
    target = torch.from_numpy(motions.scaling.joints(acted.joints[indices][:, 1:]))
    words = torch.zeros(3, 4, 23)
    for row, text in enumerate(("push red fast", "pull azure slowly", "slide cyan fast")):
        words[row, range(4), encode(text)[1:]] = 1
    answer = Answer(words, target.float(), torch.zeros(3, 1), torch.zeros(3, 1, 6, 100))
    said = answer_source.decoded_answers(answer, acted, indices, "describe", motions)
    assert [what for what, _ in said] == [TRUTH, FALSE, ("slide", "cyan", "fast")]
    did = answer_source.decoded_answers(answer, acted, indices, "execute", motions)
    assert [what for what, _ in did] == [
        answer_source.truth_of(acted, int(i), "execute") for i in indices
    ]


def test_what_the_distractor_would_have(samples):
    index = int(np.flatnonzero(samples.pattern == 0)[0])  # push left slowly, red and blue
    assert answer_source.truth_of(samples, index, "describe") == ("push", "red", "slowly")
    assert answer_source.truth_of(samples, index, "execute") == ("push", "left", "slowly")

    def distractor(signal, place, extra):
        return answer_source.distractor_of(samples, index, extra, Condition(signal, place))

    assert distractor("describe", "language", "pull azure quickly") == ("pull", "blue", "fast")
    in_motion = distractor("repeat action", "language", "pull azure quickly")
    assert in_motion == ("pull", "right", "fast")
    nowhere = distractor("repeat action", "language", "pull cyan quickly")
    assert nowhere == ("pull", None, "fast")
    other = int(np.flatnonzero(samples.pattern == 76)[0])  # pull right fast, the same cubes
    assert distractor("repeat language", "action", other) == ("pull", "blue", "fast")
    assert distractor("execute", "vision", other) == ("pull", "right", "fast")


def test_in_our_recording_all_test_clips_are_told():
    samples = load_samples("recording")
    motions = Motions(samples, fit_scaling(samples, samples.split("train")))
    assert 7 < motions.reach < 8
    test = samples.split("test")
    found = [motions.nearest(samples.joints[i, 1 : samples.frames[i]]) for i in test]
    assert [what for what, _ in found] == [
        answer_source.truth_of(samples, int(i), "execute") for i in test
    ]
    within = answer_source.within(found, motions.reach)
    assert sum(what != DecodedAnswer() for what in within) >= 214

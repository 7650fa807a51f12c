"""What an answer follows: the truth, the distractor, a mixture of the two, or neither.

An answer says three things: which action, which cube, how fast. A sentence says them in words, the
cube by its colour. For a motion, we find the nearest of the mean motions of the 12 actions. In a
mixture, each of the three is the truth's or the distractor's, and not all come from the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.scaling import Scaling
from ptae_lite.errors import LanguageError
from ptae_lite.evaluation import poses
from ptae_lite.experiments.incongruence import ANSWERS_WORDS, EXTRA_INPUT, Condition
from ptae_lite.language import ACTIONS, EOS, SIDES, SPEEDS, Pattern, decode, parse, pattern
from ptae_lite.models.common import Answer

SOURCES = ("truth", "distractor", "mixture", "neither")
TAKEN = ("action", "cube", "speed")
LENGTHS = {"slowly": MAX_FRAMES, "fast": MAX_FRAMES // 2}


class DecodedAnswer(NamedTuple):
    """What an answer says. The cube is a colour in words, and a side in motions; None: not said."""

    action: str | None = None
    cube: str | None = None
    speed: str | None = None


@dataclass(frozen=True)
class Motions:
    """The mean motions of the 12 actions, made from the training clips.

    Clips of one action and side are stretched to one length and averaged over both speeds. After
    the stretching the speeds hardly differ: in our recording by at most 1.4 % of the joints' range.
    Each mean is then played at both speeds, so that the speed of a motion can be found. A fast mean
    rests in its last pose.

    Distances are root mean squares over frames and joints, in percent of the joints' range, like
    NRMSE.
    """

    samples: Samples
    scaling: Scaling

    @cached_property
    def tracks(self) -> dict[DecodedAnswer, Float[np.ndarray, "100 5"]]:
        """Each mean motion over 100 frames, in the unit of the data."""
        clips: dict = {}
        for i in self.samples.split("train").tolist():
            p, joints = pattern(int(self.samples.pattern[i])), self._clip(i)
            clips.setdefault((p.action, p.side), []).append(_stretch(joints, MAX_FRAMES))
        tracks = {}
        for action, side, speed in product(ACTIONS, SIDES, SPEEDS):
            if (action, side) in clips:
                mean = _stretch(np.mean(clips[action, side], axis=0), LENGTHS[speed])
                rest = np.repeat(mean[-1:], MAX_FRAMES - len(mean), axis=0)
                tracks[DecodedAnswer(action, side, speed)] = np.concatenate([mean, rest])
        return tracks

    @cached_property
    def reach(self) -> float:
        """The largest distance of a training clip from the mean of its action, in percent."""
        own = [
            self._distances(self._clip(i), 0)[_of(pattern(int(self.samples.pattern[i])))]
            for i in self.samples.split("train").tolist()
        ]
        return max(own)

    def nearest(self, made: Float[np.ndarray, "T 5"]) -> tuple[DecodedAnswer, float]:
        """The mean that is nearest to a motion (from its second frame on), and its distance."""
        found = self._distances(made, 1)
        best = min(found, key=found.__getitem__)
        return best, found[best]

    def _clip(self, index: int) -> Float[np.ndarray, "T 5"]:
        return self.samples.joints[index, : self.samples.frames[index]]

    def _distances(self, joints, first: int) -> dict[DecodedAnswer, float]:
        def far(track):
            error = (joints - track[first : first + len(joints)]) / self.scaling.joint_range
            return 100 * float(np.sqrt((error**2).mean()))

        return {decoded: far(track) for decoded, track in self.tracks.items()}


def _stretch(joints: Float[np.ndarray, "T 5"], count: int) -> Float[np.ndarray, "N 5"]:
    """A motion at `count` evenly spaced times from its first to its last frame."""
    at, places = np.linspace(0, len(joints) - 1, count), np.arange(len(joints))
    return np.stack([np.interp(at, places, joint) for joint in joints.T], axis=1)


def _of(p: Pattern) -> DecodedAnswer:
    return DecodedAnswer(p.action, p.side, p.speed)


def decode_words(indices) -> DecodedAnswer:
    """What four tokens say, as first words. They say nothing if they are not a sentence."""
    indices = [int(i) for i in indices]
    if len(indices) != 4 or indices[3] != EOS or EOS in indices[:3]:
        return DecodedAnswer()
    try:
        return DecodedAnswer(*parse(decode(indices)))
    except LanguageError:
        return DecodedAnswer()


def decoded_answers(answer: Answer, samples: Samples, indices, signal: str, motions: Motions):
    """What each answer to a signal says, and its distance in percent.

    A sentence has distance 0. A motion says what its nearest mean says, at any distance.
    """
    if signal in ANSWERS_WORDS:
        return [(decode_words(words), 0.0) for words in answer.words.argmax(2)]
    made = poses(answer, motions.scaling)
    return [
        motions.nearest(one[: samples.frames[i] - 1]) for one, i in zip(made, indices, strict=True)
    ]


def within(decoded: list[tuple[DecodedAnswer, float]], reach: float) -> list[DecodedAnswer]:
    """What the answers say. An answer farther than `reach` says nothing."""
    return [what if distance <= reach else DecodedAnswer() for what, distance in decoded]


def truth_of(samples: Samples, index: int, signal: str) -> DecodedAnswer:
    """What the right answer says."""
    p = pattern(int(samples.pattern[index]))
    return DecodedAnswer(*p.meaning) if signal in ANSWERS_WORDS else _of(p)


def distractor_of(samples: Samples, index: int, extra, condition: Condition) -> DecodedAnswer:
    """What an answer that follows the extra input would say.

    A false sentence may have a colour that no cube has. A motion cannot follow it; then the cube is
    None.
    """
    if EXTRA_INPUT[condition.signal] == "action":
        return truth_of(samples, extra, condition.signal)
    meaning, p = parse(extra), pattern(int(samples.pattern[index]))
    if condition.signal in ANSWERS_WORDS:
        return DecodedAnswer(*meaning)
    sides = dict(zip(p.arrangement, SIDES, strict=True))
    return DecodedAnswer(meaning.action, sides.get(meaning.colour), meaning.speed)


def follows(decoded: DecodedAnswer, truth: DecodedAnswer, distractor: DecodedAnswer) -> str:
    """What an answer follows: one of `SOURCES`."""
    if decoded == truth:
        return "truth"
    if decoded == distractor and None not in decoded:
        return "distractor"
    pairs = zip(decoded, truth, distractor, strict=True)
    mixed = all(one is not None and one in pair for one, *pair in pairs)
    return "mixture" if mixed else "neither"


def shares(
    decoded: list[DecodedAnswer], truth: list[DecodedAnswer], distractor: list[DecodedAnswer]
) -> dict[str, float]:
    """Percentage of the answers that follow each of `SOURCES`.

    `action_taken`, `cube_taken` and `speed_taken` count only answers whose distractor has another
    action, cube or speed: the percentage of them that say the distractor's.
    """
    rows = list(zip(decoded, truth, distractor, strict=True))
    found = [follows(*row) for row in rows]
    result = {name: 100 * found.count(name) / len(found) for name in SOURCES}
    for k, name in enumerate(TAKEN):
        differing = [(a[k], c[k]) for a, b, c in rows if c[k] != b[k]]
        taken = sum(a is not None and a == c for a, c in differing)
        result[f"{name}_taken"] = 100 * taken / len(differing) if differing else float("nan")
    return result

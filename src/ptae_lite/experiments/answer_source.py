"""Who is followed: the truth, the distractor, a mixture of the two, or neither.

An answer says three things: which action, which cube, how fast. A sentence says them in words, the
cube by its colour. A motion says them by its course: it is compared with the mean motions of the 12
actions. In a mixture each of the three is the truth's or the distractor's, and not all are from
one of them.
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
    """What an answer says. The cube is a colour in words, a side in motions; None: says nothing."""

    action: str | None = None
    cube: str | None = None
    speed: str | None = None


@dataclass(frozen=True)
class Motions:
    """The mean motions of the 12 actions, made of the training clips.

    Clips of one action and side are stretched to one length (time normalisation) and averaged over
    both speeds, which hardly differ then: in our recording by 1.4 % of the joints' range at most.
    So that speed can be told, each mean is played at either speed; the fast one rests in its last
    pose. Distances are root mean squares over frames and joints, in percent of the joints' range,
    as NRMSE is.
    """

    samples: Samples
    scaling: Scaling

    @cached_property
    def tracks(self) -> dict[DecodedAnswer, Float[np.ndarray, "100 5"]]:
        """Each of the 12 in the data's unit, over 100 frames."""
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
        """How far, in percent, the farthest training clip lies from the mean of its action."""
        own = [
            self._distances(self._clip(i), 0)[_of(pattern(int(self.samples.pattern[i])))]
            for i in self.samples.split("train").tolist()
        ]
        return max(own)

    def nearest(self, made: Float[np.ndarray, "T 5"]) -> tuple[DecodedAnswer, float]:
        """The mean that a motion, from its second frame on, is nearest to, and how near."""
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
    """A motion at `count` moments, evenly from its beginning to its end."""
    at, places = np.linspace(0, len(joints) - 1, count), np.arange(len(joints))
    return np.stack([np.interp(at, places, joint) for joint in joints.T], axis=1)


def _of(p: Pattern) -> DecodedAnswer:
    return DecodedAnswer(p.action, p.side, p.speed)


def decode_words(indices) -> DecodedAnswer:
    """What four tokens say, in the first word of each pair; nothing, if they are no sentence."""
    indices = [int(i) for i in indices]
    if len(indices) != 4 or indices[3] != EOS or EOS in indices[:3]:
        return DecodedAnswer()
    try:
        return DecodedAnswer(*parse(decode(indices)))
    except LanguageError:
        return DecodedAnswer()


def decoded_answers(answer: Answer, samples: Samples, indices, signal: str, motions: Motions):
    """What each answer to a signal says, and how far in percent it is from what it says.

    Words are what they say, at no distance. A motion says its nearest mean, however far.
    """
    if signal in ANSWERS_WORDS:
        return [(decode_words(words), 0.0) for words in answer.words.argmax(2)]
    made = poses(answer, motions.scaling)
    return [
        motions.nearest(one[: samples.frames[i] - 1]) for one, i in zip(made, indices, strict=True)
    ]


def within(decoded: list[tuple[DecodedAnswer, float]], reach: float) -> list[DecodedAnswer]:
    """What the answers say; those farther than `reach` from it say nothing."""
    return [what if distance <= reach else DecodedAnswer() for what, distance in decoded]


def truth_of(samples: Samples, index: int, signal: str) -> DecodedAnswer:
    """What the right answer says."""
    p = pattern(int(samples.pattern[index]))
    return DecodedAnswer(*p.meaning) if signal in ANSWERS_WORDS else _of(p)


def distractor_of(samples: Samples, index: int, extra, condition: Condition) -> DecodedAnswer:
    """What the extra input would have the answer say.

    A false sentence may name a colour that no cube has; a motion cannot follow it in that (None).
    """
    if EXTRA_INPUT[condition.signal] == "action":
        return truth_of(samples, extra, condition.signal)
    meaning, p = parse(extra), pattern(int(samples.pattern[index]))
    if condition.signal in ANSWERS_WORDS:
        return DecodedAnswer(*meaning)
    sides = dict(zip(p.arrangement, SIDES, strict=True))
    return DecodedAnswer(meaning.action, sides.get(meaning.colour), meaning.speed)


def follows(decoded: DecodedAnswer, truth: DecodedAnswer, distractor: DecodedAnswer) -> str:
    """One of `SOURCES`."""
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
    """Percent of the answers that follow each of `SOURCES`; and, as `action_taken` and so on, of
    those in which the distractor's action differs, how many have the distractor's."""
    rows = list(zip(decoded, truth, distractor, strict=True))
    found = [follows(*row) for row in rows]
    result = {name: 100 * found.count(name) / len(found) for name in SOURCES}
    for k, name in enumerate(TAKEN):
        differing = [(a[k], c[k]) for a, b, c in rows if c[k] != b[k]]
        taken = sum(a is not None and a == c for a, c in differing)
        result[f"{name}_taken"] = 100 * taken / len(differing) if differing else float("nan")
    return result

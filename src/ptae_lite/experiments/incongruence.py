"""Incongruence: what a model gets if language and action disagree (paper, section 4.4).

A conflict is put into the *extra* input, which the task could do without:

- `language` for *describe* and *repeat action*: the query is a whole sentence with 1 to 3 false
  words (action, colour, speed), instead of EOS alone;
- `action` for *execute* and *repeat language*: keys and values are the moving clip of a partner
  sample with another action, position or speed, instead of the first frame repeated. Or only its
  `vision` or its `proprioception` is the partner's, and the rest is the sample's own clip.

The decoder's video, the start pose, the clip length and the right answer stay true, as published.

Without a conflict the paper uses the regular input. Its format differs from that of a conflict. So
there are controls that the paper does not have: the extra input in the conflict's format, but true.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
import torch

from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Batch, Source
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import alternatives_for, respond
from ptae_lite.language import (
    ACTIONS,
    SIDES,
    SPEEDS,
    Meaning,
    Pattern,
    decode,
    encode,
    pattern,
    pattern_at,
    sentence,
    words_of,
)  # fmt: skip
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.common import Answer

EXTRA_INPUT = {
    "describe": "language", "repeat action": "language",
    "execute": "action", "repeat language": "action",
}  # fmt: skip
ASPECTS = {"language": ("action", "colour", "speed"), "action": ("action", "position", "speed")}
PLACES = {"language": ("language",), "action": ("action", "vision", "proprioception")}
ANSWERS_WORDS = ("describe", "repeat language")


class Condition(NamedTuple):
    """A signal, and what is put into its extra input.

    Args:
        conflict_in: where the conflict is, one of `PLACES`; or a control without a conflict: `none`
            (the regular input), `congruent` (the conflict's format with the sample's own sentence
            or clip), `congruent_other` (with another wording of the sentence, or the clip of
            another variation of the pattern), `blank` (*execute* only: keys and values are zero).
        aspects: which aspects are false, in the order of `ASPECTS`.
    """

    signal: str
    conflict_in: str = "none"
    aspects: tuple[str, ...] = ()


def conflict_sets(signal: str, conflicts: int) -> tuple[tuple[str, ...], ...]:
    """Every choice of `conflicts` aspects of a signal: 1, 3, 3 or 1 choices for 0 to 3 conflicts.

    Raises:
        ConfigError: `conflicts` is not 0 to 3, or the signal has no conflicts.
    """
    aspects = ASPECTS[_extra_input(signal)]
    if conflicts not in range(4):
        raise ConfigError(f"{conflicts} conflicts do not exist; there are 0, 1, 2 or 3")
    return tuple(combinations(aspects, conflicts))


def conditions(signal: str) -> list[Condition]:
    """All conditions of a signal: 10 for conflicts in language, 24 or 25 for those in action."""
    controls = ["none", "congruent", "congruent_other", *(["blank"] if signal == "execute" else [])]
    return [
        *(Condition(signal, control) for control in controls),
        *(
            Condition(signal, place, aspects)
            for place in PLACES[_extra_input(signal)]
            for conflicts in (1, 2, 3)
            for aspects in conflict_sets(signal, conflicts)
        ),
    ]


def _extra_input(signal: str) -> str:
    if signal not in EXTRA_INPUT:
        raise ConfigError(f"no conflict for signal {signal!r}; there are {', '.join(EXTRA_INPUT)}")
    return EXTRA_INPUT[signal]


def check(condition: Condition) -> None:
    """Check that a condition exists.

    Raises:
        ConfigError: it does not. The message lists those that do.
    """
    signal, place, aspects = condition
    kind = _extra_input(signal)
    for aspect in aspects:
        if aspect not in ASPECTS[kind]:
            raise ConfigError(
                f"no conflict of {aspect!r} in {kind}; there are {', '.join(ASPECTS[kind])}"
            )
    if condition not in conditions(signal):
        places = list(dict.fromkeys(c.conflict_in for c in conditions(signal) if c.aspects))
        controls = [c.conflict_in for c in conditions(signal) if not c.aspects]
        raise ConfigError(
            f"{signal} has no condition {place!r} with {len(aspects)} conflicts; there are "
            f"{', '.join(controls)} without, {', '.join(places)} with 1 to 3, in the order "
            f"{', '.join(ASPECTS[kind])}"
        )


def false_sentence(text: str, aspects, rng: np.random.Generator) -> str:
    """`text` with a false word for each aspect: another word of its class.

    A first word is replaced by a first word, and a synonym by a synonym.
    """
    words = text.split()
    for place, aspect in enumerate(Meaning._fields):
        if aspect in aspects:
            first, second = np.split(np.array(words_of(aspect)), 2)
            register = first if words[place] in first else second
            words[place] = str(rng.choice(register[register != words[place]]))
    return " ".join(words)


def partner(pattern: Pattern, aspects, rng: np.random.Generator) -> Pattern:
    """A pattern in the same arrangement that differs in exactly these aspects.

    A partner with another position acts on the other cube, so its sentence has another colour, too.
    """
    action, side, speed = pattern.action, pattern.side, pattern.speed
    if "action" in aspects:
        action = ACTIONS[(ACTIONS.index(action) + rng.integers(1, len(ACTIONS))) % len(ACTIONS)]
    if "position" in aspects:
        side = SIDES[1 - SIDES.index(side)]
    if "speed" in aspects:
        speed = SPEEDS[1 - SPEEDS.index(speed)]
    return pattern_at(pattern.arrangement, side, action, speed)


def extra_inputs(samples: Samples, indices, condition: Condition, seed: int = 0) -> list:
    """The content of the extra input: sentences (str), or sample numbers of clips (int).

    The draws depend on `seed` alone. A partner has the sample's arrangement and variation number.
    Without an extra input (`none`, `blank`) this is the sample's own sentence or number.

    Raises:
        ConfigError: there is no such condition.
    """
    check(condition)
    signal, place, aspects = condition
    rng = np.random.default_rng([44, seed])
    shown = [pattern(int(samples.pattern[i])) for i in indices]
    if _extra_input(signal) == "language":
        wording = alternatives_for(len(samples.frames))[torch.as_tensor(np.asarray(indices))]
        if place == "congruent_other":
            wording = (wording + torch.from_numpy(rng.integers(1, 8, len(wording)))) % 8
        true = [sentence(p.meaning, k) for p, k in zip(shown, wording.tolist(), strict=True)]
        return [false_sentence(text, aspects, rng) for text in true]
    number = {pv: i for i, pv in enumerate(zip(samples.pattern, samples.variation, strict=True))}
    variation = [int(samples.variation[i]) for i in indices]
    if place == "congruent_other":
        there = len(np.unique(samples.variation))
        variation = [(v + int(rng.integers(1, there))) % there for v in variation]
    chosen = [partner(p, aspects, rng).index for p in shown]
    return [number[pv] for pv in zip(chosen, variation, strict=True)]


def disturb_language(batch: Batch, texts: list[str]) -> Batch:
    """The batch with whole sentences in the query."""
    tokens = batch.tokens.clone()
    tokens[:, 1:] = torch.tensor([encode(text) for text in texts])
    return replace(batch, tokens=tokens, token_mask=torch.ones_like(batch.token_mask))


def false_word(aspect: str) -> Callable[[Batch], Batch]:
    """A control of tasks with a sentence as query: the word of one aspect is false."""
    rng = np.random.default_rng(0)

    def change(batch: Batch) -> Batch:
        texts = [decode(row[2:].tolist()) for row in batch.tokens]
        return disturb_language(batch, [false_sentence(text, (aspect,), rng) for text in texts])

    return change


def disturb_action(batch: Batch, source: Source, seen, felt) -> Batch:
    """The batch with moving clips as keys and values.

    Each clip keeps its length and is zero after its end. The clip length of a sample is the longer
    of the two; it counts if frames are queries.

    Args:
        seen: numbers of the samples whose video is used.
        felt: numbers of the samples whose joints are used.
    """
    seen, felt = (torch.as_tensor(np.asarray(samples)) for samples in (seen, felt))
    keys = torch.cat([source.features[seen], source.joints[felt]], dim=2)
    return replace(batch, keys=keys, frames=source.frames[seen].maximum(source.frames[felt]))


def respond_under(
    trained: Trained, source: Source, indices, condition: Condition, seed: int = 0, extra=None
) -> Answer:
    """A model's answers under one condition, for all samples in order.

    Args:
        extra: the extra inputs, see `extra_inputs`; None to draw them from the seed.

    Raises:
        ConfigError: there is no such condition.
    """
    check(condition)
    signal, place, _ = condition
    if place == "none":
        return respond(trained, source, indices, signal)
    if extra is None:
        extra = extra_inputs(source.dataset.samples, indices, condition, seed)
    own, done = indices, 0

    def change(batch: Batch) -> Batch:
        nonlocal done
        part = slice(done, done + len(batch.tokens))
        done = part.stop
        if place == "blank":
            return replace(batch, keys=torch.zeros_like(batch.keys))
        if EXTRA_INPUT[signal] == "language":
            return disturb_language(batch, extra[part])
        seen, felt = (own if place == other else extra for other in ("proprioception", "vision"))
        return disturb_action(batch, source, seen[part], felt[part])

    return respond(trained, source, indices, signal, change=change)

"""Incongruence: what a model is given when word and deed shall disagree (paper, section 4.4).

A conflict is put into the *extra* input, the one that the task could do without:

- `language` for describe and repeat action: instead of EOS alone, the query is a whole sentence
  with 1 to 3 false words (action, colour, speed);
- `action` for execute and repeat language: instead of the first frame standing still, keys and
  values are the moving clip of a partner sample that differs in action, position or speed. Or only
  the `vision` or the `proprioception` is the partner's, and the rest the sample's own clip.

Decoder video, start pose, clip length and the answer asked for stay the true ones, as published.
Without a conflict the paper has the regular input. That differs in format as well, so there are
controls that the paper lacks: the extra input in the conflict's format, all of it true.
"""

from __future__ import annotations

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
    """A signal and what is put into its extra input.

    `conflict_in` is one of `PLACES`, with the aspects that are false; or, with none:

    - `none`: the regular input;
    - `congruent`: the conflict's format with the sample's own sentence, or its own clip;
    - `congruent_other`: with another wording of the sentence, or the clip of another variation of
      the same pattern;
    - `blank` (execute alone): keys and values are zero.
    """

    signal: str
    conflict_in: str = "none"
    aspects: tuple[str, ...] = ()


def conflict_sets(signal: str, conflicts: int) -> tuple[tuple[str, ...], ...]:
    """Every choice of that many conflicting aspects for a signal: 1, 3, 3 or 1 choices."""
    aspects = ASPECTS[_extra_input(signal)]
    if conflicts not in range(4):
        raise ConfigError(f"{conflicts} conflicts do not exist; there are 0, 1, 2 or 3")
    return tuple(combinations(aspects, conflicts))


def conditions(signal: str) -> list[Condition]:
    """All that a signal is tried under: 10 for a conflict in language, 24 or 25 in action."""
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
    """Raise `ConfigError` where a condition does not exist, with those that do."""
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
    """`text` with a false word for each aspect: any other of its class, in the same register."""
    words = text.split()
    for place, aspect in enumerate(Meaning._fields):
        if aspect in aspects:
            first, second = np.split(np.array(words_of(aspect)), 2)
            register = first if words[place] in first else second
            words[place] = str(rng.choice(register[register != words[place]]))
    return " ".join(words)


def partner(pattern: Pattern, aspects, rng: np.random.Generator) -> Pattern:
    """A pattern in the same arrangement that differs in exactly these aspects of the action.

    A position conflict is also a colour conflict in the sentence that would describe the partner.
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
    """What the extra input says: sentences (str), or sample numbers whose clips are shown (int).

    Draws come from `seed` alone. A conflicting clip is of the sample's arrangement and variation
    number. Without an extra input (`none`, `blank`) this is what the sample itself would say.
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
    """The batch with whole sentences in the query, where the task has EOS alone."""
    tokens = batch.tokens.clone()
    tokens[:, 1:] = torch.tensor([encode(text) for text in texts])
    return replace(batch, tokens=tokens, token_mask=torch.ones_like(batch.token_mask))


def disturb_action(batch: Batch, source: Source, seen, felt) -> Batch:
    """The batch with moving clips as keys and values: of which samples the video, and the joints.

    Each keeps its own length and is zero behind it. Where frames ask, those of the longer one do.
    """
    seen, felt = (torch.as_tensor(np.asarray(samples)) for samples in (seen, felt))
    keys = torch.cat([source.features[seen], source.joints[felt]], dim=2)
    return replace(batch, keys=keys, frames=source.frames[seen].maximum(source.frames[felt]))


def respond_under(
    trained: Trained, source: Source, indices, condition: Condition, seed: int = 0, extra=None
) -> Answer:
    """A model's answers, for all samples in order, under one condition.

    `extra` are the extra inputs, as `extra_inputs` gives them; drawn from the seed if None.
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

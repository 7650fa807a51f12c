"""Incongruence: what a model does when word and deed disagree (paper, section 4.4).

A conflict is put into the *extra* input, the one that the task could do without:

- `language` for describe and repeat action: instead of EOS alone, the query is a whole sentence
  with 0 to 3 false words (action, colour, speed);
- `action` for execute and repeat language: instead of the first frame standing still, keys and
  values are the moving clip of a partner sample that differs in action, position or speed.

Decoder video, start pose, clip length and the answer asked for stay the true ones, as published.
Without a conflict the paper has the regular input. That differs in format as well, so there is a
control that the paper lacks: `congruent`, the extra input in the conflict's format, all true.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import torch

from ptae_lite.dataset import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import correct, nrmse, poses, respond, sentences
from ptae_lite.language import (
    ACTIONS,
    SIDES,
    SPEEDS,
    Meaning,
    Pattern,
    encode,
    patterns,
    sentence,
    words_of,
)  # fmt: skip
from ptae_lite.models.checkpoint import Trained
from ptae_lite.signals import Batch, Source

EXTRA_INPUT = {
    "describe": "language", "repeat action": "language",
    "execute": "action", "repeat language": "action",
}  # fmt: skip
ASPECTS = {"language": ("action", "colour", "speed"), "action": ("action", "position", "speed")}
ANSWERS_WORDS = ("describe", "repeat language")


def conflict_sets(signal: str, conflicts: int) -> tuple[tuple[str, ...], ...]:
    """Every choice of that many conflicting aspects for a signal: 1, 3, 3 or 1 choices."""
    aspects = ASPECTS[_extra_input(signal)]
    if conflicts not in range(4):
        raise ConfigError(f"{conflicts} conflicts do not exist; there are 0, 1, 2 or 3")
    return tuple(combinations(aspects, conflicts))


def _extra_input(signal: str) -> str:
    if signal not in EXTRA_INPUT:
        raise ConfigError(f"no conflict for signal {signal!r}; there are {', '.join(EXTRA_INPUT)}")
    return EXTRA_INPUT[signal]


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
    action, side, speed = (
        ACTIONS.index(pattern.action), SIDES.index(pattern.side), SPEEDS.index(pattern.speed)
    )  # fmt: skip
    if "action" in aspects:
        action = (action + rng.integers(1, 3)) % 3
    if "position" in aspects:
        side = 1 - side
    if "speed" in aspects:
        speed = 1 - speed
    arrangement = pattern.index % 72 // 6
    return patterns()[72 * speed + 6 * arrangement + 3 * side + action]


def disturb_language(batch: Batch, texts: list[str]) -> Batch:
    """The batch with whole sentences in the query, where the task has EOS alone."""
    tokens = batch.tokens.clone()
    tokens[:, 1:] = torch.tensor([encode(text) for text in texts])
    return replace(batch, tokens=tokens, token_mask=torch.ones_like(batch.token_mask))


def disturb_action(batch: Batch, source: Source, partners) -> Batch:
    """The batch with the partners' moving clips as keys and values."""
    partners = torch.as_tensor(np.asarray(partners))
    keys = torch.cat([source.features[partners], source.joints[partners]], dim=2)
    return replace(batch, keys=keys)


def conflicting_inputs(samples: Samples, indices, signal: str, aspects, seed: int = 0):
    """What the extra input says: false sentences (str), or partners' sample numbers (int).

    Drawn from the seed; the partner has the sample's arrangement and variation number.
    """
    rng, place = np.random.default_rng([44, seed]), _extra_input(signal)
    for aspect in aspects:
        if aspect not in ASPECTS[place]:
            raise ConfigError(
                f"no conflict of {aspect!r} in {place}; there are {', '.join(ASPECTS[place])}"
            )
    if place == "language":
        register = rng.integers(0, 8, len(indices)).tolist()
        true = [
            sentence(patterns()[samples.pattern[i]].meaning, k)
            for i, k in zip(indices, register, strict=True)
        ]
        return [false_sentence(text, aspects, rng) for text in true]
    number = {pv: i for i, pv in enumerate(zip(samples.pattern, samples.variation, strict=True))}
    chosen = (partner(patterns()[samples.pattern[i]], aspects, rng).index for i in indices)
    return [number[p, samples.variation[i]] for p, i in zip(chosen, indices, strict=True)]


def respond_with_extra(trained: Trained, source: Source, indices, signal, aspects, seed=0):
    """A model's answers with the extra input, in conflict in `aspects` (none: congruent)."""
    extra = conflicting_inputs(source.dataset.samples, indices, signal, aspects, seed)
    done = 0

    def change(batch: Batch) -> Batch:
        nonlocal done
        part = extra[done : done + len(batch.tokens)]
        done += len(part)
        if EXTRA_INPUT[signal] == "language":
            return disturb_language(batch, part)
        return disturb_action(batch, source, part)

    return respond(trained, source, indices, signal, change=change)


def score(trained: Trained, source: Source, indices, signal: str, answer) -> dict:
    """Accuracy, or NRMSE by the paper's definition and over valid frames, in percent."""
    samples = source.dataset.samples
    if signal in ANSWERS_WORDS:
        return {"accuracy": 100 * float(correct(answer, samples, indices).mean())}
    error = nrmse(poses(answer, trained.scaling), samples, indices, trained.scaling)
    return dict(zip(("nrmse", "nrmse_valid"), error, strict=True))


def run(trained: Trained, samples: Samples, split: str = "test", seed: int = 0) -> pd.DataFrame:
    """All four signals under 0 to 3 conflicts, every choice of aspects, and the control."""
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    rows = []

    def add(signal, conflict_in, aspects, answer):
        row = {"signal": signal, "conflict_in": conflict_in, "conflicts": len(aspects),
               "aspects": " ".join(aspects)}  # fmt: skip
        rows.append(row | score(trained, source, indices, signal, answer))

    for signal, place in EXTRA_INPUT.items():
        add(signal, "none", (), respond(trained, source, indices, signal))
        for conflicts in range(4):
            for aspects in conflict_sets(signal, conflicts):
                answer = respond_with_extra(trained, source, indices, signal, aspects, seed)
                add(signal, place if aspects else "congruent", aspects, answer)
    return pd.DataFrame(rows)


def story(trained: Trained, source: Source, index: int, signal: str, aspects: tuple | None) -> dict:
    """One sample with the extra input, conflicting in `aspects`; None is the regular input."""
    samples, indices = source.dataset.samples, np.array([index])
    truth = patterns()[samples.pattern[index]]
    told = {"sample": f"{truth.action} {truth.side} cube {truth.speed}"}
    if aspects is None:
        answer, told["extra"] = respond(trained, source, indices, signal), "none"
    else:
        answer = respond_with_extra(trained, source, indices, signal, aspects)
        told["extra"] = conflicting_inputs(samples, indices, signal, aspects)[0]
        if EXTRA_INPUT[signal] == "action":
            other = patterns()[samples.pattern[told["extra"]]]
            told["extra"] = f"a clip, {other.action} {other.side} cube {other.speed}"
    if signal in ANSWERS_WORDS:
        told["asked"] = sentence(truth.meaning)
        told["answer"] = sentences(answer)[0]
        told["right"] = bool(correct(answer, samples, indices)[0])
    else:
        told["joints"] = poses(answer, trained.scaling)[0]
    return told

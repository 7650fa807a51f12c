"""How good a model is: sentence accuracy and joint error.

All numbers are percent. A sentence is right if it is one of the eight sentences of the meaning, so
a guess is right once in 36 (2.78 %). NRMSE is the root mean square joint error, divided by the
range of that joint in the training samples.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.scaling import Scaling
from ptae_lite.data.signals import STEPS, Batch, Source, build, signal_number
from ptae_lite.language import (
    MEANINGS,
    SYNONYMS,
    WORD_INDEX,
    Meaning,
    Pattern,
    decode,
    patterns,
    says,
)
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.common import Answer

CHANCE = 100 / len(MEANINGS)


def alternatives_for(count: int, seed: int = 0) -> Int[torch.Tensor, " S"]:
    """Which of its eight sentences each sample is given in an evaluation; the seed fixes them."""
    return torch.from_numpy(np.random.default_rng([8, seed]).integers(0, 8, count))


@torch.no_grad()
def respond(
    trained: Trained, source: Source, samples, signal: str, *, change=lambda batch: batch, size=108
) -> Answer:
    """A model's answers to one signal, for all `samples` in order.

    Args:
        change: may change each batch first. Controls and conflicts are put in this way.
        size: samples a batch.
    """
    samples = torch.as_tensor(np.asarray(samples))
    number, device = signal_number(signal), _device(trained.model)
    alternative = alternatives_for(len(source.frames))[samples]
    answers = []
    for i in range(0, len(samples), size):
        part = samples[i : i + size]
        signals = torch.full((len(part),), number)
        batch: Batch = change(build(source, part, signals, alternative[i : i + size]))
        answer = trained.model(batch.to(device))
        answers.append([part.cpu() for part in answer])
    return Answer(*(torch.cat(column) for column in zip(*answers, strict=True)))


def _device(model: torch.nn.Module) -> torch.device:
    return next((p.device for p in model.parameters()), torch.device("cpu"))


def sentences(answer: Answer) -> list[str]:
    """The words that a model said, for each sample."""
    return [decode(indices) for indices in answer.words.argmax(2)]


def correct(answer: Answer, samples: Samples, indices) -> Bool[np.ndarray, " M"]:
    """Which answers are right: one of the eight sentences of the meaning, then EOS."""
    said = answer.words.argmax(2).numpy()
    meanings = [patterns()[i].meaning for i in samples.pattern[indices]]
    return np.array([says(out, meaning) for out, meaning in zip(said, meanings, strict=True)])


def word_accuracy(answer: Answer, samples: Samples, indices) -> dict[str, float]:
    """Percentage of answers whose action, colour or speed word, or its synonym, is right."""
    said = answer.words.argmax(2).tolist()
    meanings = [patterns()[i].meaning for i in samples.pattern[indices]]
    results = {}
    for place, kind in enumerate(Meaning._fields):
        right = [
            out[place] in (WORD_INDEX[meaning[place]], WORD_INDEX[SYNONYMS[meaning[place]]])
            for out, meaning in zip(said, meanings, strict=True)
        ]
        results[f"{kind}_accuracy"] = 100 * float(np.mean(right))
    return results


def poses(answer: Answer, scaling: Scaling) -> Float[np.ndarray, "M 99 5"]:
    """Predicted joints 2 to 100, in the unit of the data (radians in our recording)."""
    return scaling.joints_back(answer.joints.numpy().astype(float))


def nrmse(
    predicted: Float[np.ndarray, "M 99 5"], samples: Samples, indices, scaling: Scaling
) -> tuple[float, float]:
    """NRMSE in percent: by the paper's definition, and over valid frames only.

    ::

        100 sqrt(sum of ((predicted - true) / range)^2 / (joints x steps))

    The published code counts all 99 steps of each clip, and the error is 0 in padding. Its number
    is therefore smaller, by the root of the share of valid steps (a factor of 0.87 if half of the
    clips are fast).
    """
    truth = samples.joints[indices][:, 1:]
    valid = (np.arange(1, MAX_FRAMES) < samples.frames[indices, None])[..., None]
    squares = (((predicted - truth) / scaling.joint_range) ** 2) * valid
    per_step = squares.sum() / squares.shape[2]
    return (
        100 * float(np.sqrt(per_step / (len(truth) * STEPS))),
        100 * float(np.sqrt(per_step / valid.sum())),
    )


def evaluate(trained: Trained, samples: Samples, split: str = "test") -> dict[str, float]:
    """The scores of the paper for one split, in percent.

    Returns:
        `describe_accuracy`, `repeat_language_accuracy`, and of `execute` and `repeat_action` the
        `_nrmse` (paper's definition) and the `_nrmse_valid`.
    """
    source = Source(trained.dataset(samples))
    indices = samples.split(split)
    results = {}
    for signal in ("describe", "repeat language"):
        right = correct(respond(trained, source, indices, signal), samples, indices)
        results[f"{signal.replace(' ', '_')}_accuracy"] = 100 * float(right.mean())
    for signal in ("execute", "repeat action"):
        made = poses(respond(trained, source, indices, signal), trained.scaling)
        name = f"{signal.replace(' ', '_')}_nrmse"
        results[name], results[f"{name}_valid"] = nrmse(made, samples, indices, trained.scaling)
    return results


def new_scenes(samples: Samples, split: str = "test") -> Bool[np.ndarray, " M"]:
    """Which samples of a split show a scene that no training clip shows, slow or fast.

    In the authors' data a fast clip is every second frame of a slow one. So training shows all but
    the speed of a test pattern if it has the same pattern with the other speed: 24 of the 36.
    """
    known = {
        _scene(p)
        for p in (patterns()[i] for i in np.unique(samples.pattern[samples.split("train")]))
    }
    asked = samples.pattern[samples.split(split)]
    return np.array([_scene(patterns()[i]) not in known for i in asked])


def accuracy_by_scenes(
    right: Bool[np.ndarray, " M"], samples: Samples, split: str = "test"
) -> dict[str, float]:
    """Percentage of right descriptions of a split, apart for new scenes and known ones.

    A kind of which the split has none is left out.
    """
    new = new_scenes(samples, split)
    return {
        f"describe_accuracy_{name}_scenes": 100 * float(right[part].mean())
        for name, part in {"new": new, "known": ~new}.items()
        if part.any()
    }


def _scene(shown: Pattern) -> tuple:
    """A pattern without its speed."""
    return shown.arrangement, shown.side, shown.action

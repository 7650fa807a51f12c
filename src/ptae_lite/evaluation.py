"""How good is a model: sentence accuracy, joint error, and what to compare them with.

All numbers are percent. A sentence is right if it is any of the eight that say the meaning, so
guessing is right once in 36 (2.78 %). NRMSE is the root mean square joint error over the range of
that joint in the training samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.scaling import Scaling
from ptae_lite.data.signals import STEPS, TOKENS_IN, WIRING, Batch, Source, build, signal_number
from ptae_lite.language import (
    EOS,
    MEANINGS,
    SIDES,
    SYNONYMS,
    TOKENS,
    WORD_INDEX,
    Meaning,
    decode,
    patterns,
    says,
    words_of,
)  # fmt: skip
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.common import Answer
from ptae_lite.robot import inverse, motions
from ptae_lite.vision import probes

CHANCE = 100 / len(MEANINGS)


def alternatives_for(count: int, seed: int = 0) -> Int[torch.Tensor, " S"]:
    """Which of its eight sentences each sample is given in an evaluation; fixed by the seed."""
    return torch.from_numpy(np.random.default_rng([8, seed]).integers(0, 8, count))


@torch.no_grad()
def respond(
    trained: Trained, source: Source, samples, signal: str, *, change=lambda batch: batch, size=108
) -> Answer:
    """A model's answers to one signal, for all `samples` in order.

    `change` may alter each batch first: that is how controls and conflicts are put in.
    """
    samples = torch.as_tensor(np.asarray(samples))
    number, device = signal_number(signal), _device(trained.model)
    alternative = alternatives_for(len(source.frames))[samples]
    answers = []
    for i in range(0, len(samples), size):
        part = samples[i : i + size]
        signals = torch.full((len(part),), number)
        batch: Batch = change(build(source, part, signals, alternative[i : i + size]))
        with device:  # what the model makes itself belongs there, too
            answer = trained.model(batch.to(device))
        answers.append([part.cpu() for part in answer])
    return Answer(*(torch.cat(column) for column in zip(*answers, strict=True)))


def _device(model: torch.nn.Module) -> torch.device:
    return next((p.device for p in model.parameters()), torch.device("cpu"))


def sentences(answer: Answer) -> list[str]:
    """The words that a model said."""
    return [decode(indices) for indices in answer.words.argmax(2)]


def correct(answer: Answer, samples: Samples, indices) -> Bool[np.ndarray, " M"]:
    """Which answers are one of the eight sentences of their sample's meaning, EOS included."""
    said = answer.words.argmax(2).numpy()
    meanings = [patterns()[i].meaning for i in samples.pattern[indices]]
    return np.array([says(out, meaning) for out, meaning in zip(said, meanings, strict=True)])


def word_accuracy(answer: Answer, samples: Samples, indices) -> dict[str, float]:
    """Percent of answers whose action, colour or speed word is right (or its synonym)."""
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
    """Predicted joints 2 to 100 in the data's own unit (radians in our recording)."""
    return scaling.joints_back(answer.joints.numpy().astype(float))


def nrmse(
    predicted: Float[np.ndarray, "M 99 5"], samples: Samples, indices, scaling: Scaling
) -> tuple[float, float]:
    """NRMSE in percent: by the paper's definition, and over valid frames only.

    The paper's divides by all 99 steps, padded ones included, which makes it smaller by the root
    of the share of valid steps (0.87 on a balanced set).
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
    """The numbers of the paper's tables for one split, in percent."""
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


def target_poses(samples: Samples, indices, signal: str) -> Float[np.ndarray, "M 99 5"]:
    """The joints that a signal asks for, in the data's unit: the clip, or a pose held still."""
    signal_number(signal)  # refuses one that does not exist
    joints = samples.joints[indices]
    kind = WIRING[signal].joints
    if kind == "clip":
        return joints[:, 1:]
    at = 0 if kind == "first" else samples.frames[indices] - 1
    return np.repeat(joints[np.arange(len(joints)), at][:, None], STEPS, axis=1)


def blank_sentence(batch: Batch) -> Batch:
    """Control: the signal is left of the query, each word after it is EOS."""
    return replace(batch, tokens=torch.where(torch.arange(TOKENS_IN) == 0, batch.tokens, EOS))


def shuffled_sentences(batch: Batch) -> Batch:
    """Control: each sample gets the sentence of the next one that is as long."""
    tokens = batch.tokens.clone()
    for frames in batch.frames.unique():
        same = (batch.frames == frames).nonzero()[:, 0]
        tokens[same] = batch.tokens[same.roll(-1)]
    return replace(batch, tokens=tokens)


def swapped_speed(batch: Batch) -> Batch:
    """Control: *fast* for *slowly* and the reverse, in the same register; the clip stays."""
    swap = torch.arange(len(TOKENS))
    for one, other in zip(words_of("speed")[::2], words_of("speed")[1::2], strict=True):
        swap[WORD_INDEX[one]], swap[WORD_INDEX[other]] = WORD_INDEX[other], WORD_INDEX[one]
    return replace(batch, tokens=swap[batch.tokens])


def frozen_film(batch: Batch) -> Batch:
    """Control: the action decoder sees the first frame at every step."""
    return replace(batch, video=batch.video[:, :1].expand_as(batch.video))


CONTROLS = {
    "as trained": lambda batch: batch,
    "sentence blanked": blank_sentence,
    "sentences shuffled": shuffled_sentences,
    "speed word swapped": swapped_speed,
    "film frozen": frozen_film,
}


def controls(trained: Trained, samples: Samples, split: str = "test") -> dict[str, tuple]:
    """NRMSE (paper's, valid) of execute when one of its inputs is taken away or made false.

    A blank sentence and a frozen film are new to a model, so a part of the damage may come from
    that; shuffled sentences and swapped words are ordinary sentences.
    """
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    results = {}
    for name, change in CONTROLS.items():
        answer = respond(trained, source, indices, "execute", change=change)
        results[name] = nrmse(poses(answer, trained.scaling), samples, indices, trained.scaling)
    return results


def new_scenes(samples: Samples, split: str = "test") -> Bool[np.ndarray, " M"]:
    """Which samples of a split show a scene that no training clip shows, slow or fast.

    The authors' fast clips are every second frame of slow ones, so a test pattern whose twin of the
    other speed is for training is known but for its speed: 24 of the 36.
    """
    known = {
        p.index % 72
        for p in (patterns()[i] for i in np.unique(samples.pattern[samples.split("train")]))
    }
    return np.array([i % 72 not in known for i in samples.pattern[samples.split(split)]])


def references(samples: Samples, scaling: Scaling, split: str = "test") -> dict[str, tuple]:
    """What NRMSE (paper's, valid) someone gets who knows little: the scale to read ours by.

    The means are of the training clips that agree in what is known, or, where there is none, in as
    much of it, from its first word on, as any do. The last one knows all that
    can be known before the motion begins: the true places of the cubes and the sentence. It makes
    the motion planner's plan without its chances (our recording alone; no places in the authors').
    """
    indices, known = samples.split(split), samples.split("train")
    groups = {
        "hold the first pose": None,
        "mean trajectory": ("speed",),
        "mean of action word": ("speed", "action"),
        "mean of action word and side": ("speed", "action", "side"),
    }
    results = {}
    for name, aspects in groups.items():
        if aspects is None:
            made = np.repeat(samples.joints[indices][:, :1], STEPS, axis=1)
        else:
            made = _group_means(samples, indices, known, aspects)
        results[name] = nrmse(made, samples, indices, scaling)
    if samples.cubes is not None:
        planned = _planned(samples, indices)
        results["plan from the true places"] = nrmse(planned, samples, indices, scaling)
    return results


def _planned(samples: Samples, indices):
    """The plan of each sample for cubes where they lie, and the middle of everything else."""
    paths = [
        motions.fingertip_path(patterns()[samples.pattern[i]], motions.middle(places))
        for i, places in zip(indices, samples.cubes[indices, 0, :, :2], strict=True)
    ]
    joints = inverse.solve(np.concatenate(paths))
    made = np.zeros((len(indices), MAX_FRAMES, joints.shape[1]))
    made[np.arange(MAX_FRAMES) < samples.frames[indices, None]] = joints
    return made[:, 1:]


def _group_means(samples, indices, known, aspects):
    """Means of the training clips that agree in all aspects, or in as many first ones as any do."""

    def keys(i):
        shown = patterns()[samples.pattern[i]]
        aspect = tuple(getattr(shown, name) for name in aspects)
        return [aspect[:n] for n in range(len(aspects), -1, -1)]

    groups: dict = {}
    for i in known:
        for key in keys(i):
            groups.setdefault(key, []).append(i)
    means = {k: samples.joints[group][:, 1:].mean(0) for k, group in groups.items()}
    return np.stack([next(means[key] for key in keys(i) if key in means) for i in indices])


FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a clip, where the linear baseline looks at the joints
BASELINE_PENALTY = 0.3  # of its ridge regressions, a sample; chosen on held-out patterns


def linear_describe(samples: Samples, labelled, indices) -> list[Meaning]:
    """What a weighted sum says of each clip, taught by the `labelled` samples alone.

    It sees the clip's length, the features of the first and the last frame, and the joints at five
    moments; nothing else is given. It reads action, speed and side each by ridge regression, and
    the colour by a regression made of the labelled clips of the side that it has read.
    """
    seen, told = _summary(samples), [patterns()[i] for i in samples.pattern]
    classes = {name: words_of(name)[: len(words_of(name)) // 2] for name in Meaning._fields}

    def read(name, values, known, asked):
        if not len(asked):
            return np.zeros(0, dtype=int)
        labels = np.array([values.index(getattr(told[i], name)) for i in known])
        return probes.fit_labels(seen[known], labels, BASELINE_PENALTY).labels(seen[asked])

    labelled, indices = np.asarray(labelled), np.asarray(indices)
    action, speed = (read(name, classes[name], labelled, indices) for name in ("action", "speed"))
    side, colour = read("side", SIDES, labelled, indices), np.zeros(len(indices), dtype=int)
    for i, name in enumerate(SIDES):
        known = np.array([j for j in labelled if told[j].side == name], dtype=int)
        asked = indices[side == i]
        colour[side == i] = read(
            "target_colour", classes["colour"], known if len(known) else labelled, asked
        )
    return [
        Meaning(classes["action"][a], classes["colour"][c], classes["speed"][s])
        for a, c, s in zip(action, colour, speed, strict=True)
    ]


def linear_describe_accuracy(samples: Samples, labelled, split: str = "test") -> float:
    """Percent of a split that `linear_describe` says right."""
    indices = samples.split(split)
    true = [patterns()[i].meaning for i in samples.pattern[indices]]
    said = linear_describe(samples, labelled, indices)
    return 100 * float(np.mean([a == b for a, b in zip(said, true, strict=True)]))


def _summary(samples: Samples) -> Float[np.ndarray, "S K"]:
    last, item = samples.frames - 1, np.arange(len(samples.frames))
    moments = [np.round(share * last).astype(int) for share in FRACTIONS]
    joints = [samples.joints[item, t] for t in moments]
    features = [samples.features[item, t] for t in (moments[0], moments[-1])]
    return np.column_stack([samples.frames, *features, *joints]).astype(float)

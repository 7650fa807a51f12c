"""Baselines to compare the models with.

`references` are trajectories without learning. They show what an NRMSE means. `linear_describe` is
a linear baseline for sentences.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.scaling import Scaling
from ptae_lite.data.signals import STEPS
from ptae_lite.evaluation import nrmse
from ptae_lite.language import SIDES, Meaning, patterns, words_of
from ptae_lite.robot import inverse, motions
from ptae_lite.vision import probes

FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a clip, where the linear baseline looks at the joints
BASELINE_PENALTY = 0.3  # of its ridge regressions, a sample; chosen on held-out patterns


def references(samples: Samples, scaling: Scaling, split: str = "test") -> dict[str, tuple]:
    """NRMSE (paper's, valid) of predictions that use little knowledge. Ours.

    Each mean trajectory is the mean of the training clips that agree with the sample in the named
    words. If there is none, the last word is left out, and so on. The last reference, only in our
    recording, knows all that can be known before the motion begins: the places of the cubes and the
    sentence. It is the motion planner's plan without random variation.
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
    """The plan of each sample for the true places of its cubes, with no random variation."""
    paths = [
        motions.fingertip_path(patterns()[samples.pattern[i]], motions.middle(places))
        for i, places in zip(indices, samples.cubes[indices, 0, :, :2], strict=True)
    ]
    joints = inverse.solve(np.concatenate(paths))
    made = np.zeros((len(indices), MAX_FRAMES, joints.shape[1]))
    made[np.arange(MAX_FRAMES) < samples.frames[indices, None]] = joints
    return made[:, 1:]


def _group_means(samples, indices, known, aspects):
    """Means of the training clips that agree in all aspects, or in as many as possible."""

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


def linear_describe(samples: Samples, labelled, indices) -> list[Meaning]:
    """What the linear baseline says of each clip, fitted on the `labelled` samples only.

    `linear_read` finds action, speed and side. The colour comes from a regression on the labelled
    clips of the side that was found.
    """
    labelled, indices = np.asarray(labelled), np.asarray(indices)
    action, speed, side = (
        linear_read(samples, labelled, indices, name) for name in ("action", "speed", "side")
    )
    colour = np.empty(len(indices), dtype=object)
    for name in SIDES:
        known = np.array(
            [i for i in labelled if patterns()[samples.pattern[i]].side == name], dtype=int
        )
        colour[side == name] = linear_read(
            samples, known if len(known) else labelled, indices[side == name], "target_colour"
        )
    return [Meaning(a, c, s) for a, c, s in zip(action, colour, speed, strict=True)]


def linear_read(samples: Samples, labelled, indices, name: str) -> np.ndarray:
    """What ridge regressions find in clips: an aspect of their patterns, one name for each clip.

    The inputs are the clip's length, the features of the first and the last frame, and the joints
    at five moments.

    Args:
        labelled: the samples to fit on.
        name: `action`, `speed`, `side` or `target_colour`.
    """
    values = SIDES if name == "side" else words_of(name.removeprefix("target_"))
    if name != "side":
        values = values[: len(values) // 2]  # without synonyms
    if not len(indices):
        return np.zeros(0, dtype=object)
    seen = _summary(samples)
    labels = np.array(
        [values.index(getattr(patterns()[samples.pattern[i]], name)) for i in labelled]
    )
    found = probes.fit_classifier(seen[labelled], labels, BASELINE_PENALTY).labels(seen[indices])
    return np.array(values, dtype=object)[found]


def linear_describe_accuracy(samples: Samples, labelled, split: str = "test") -> float:
    """Percentage of a split for which `linear_describe` is right."""
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

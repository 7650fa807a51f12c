"""Which samples have a label, and what the linear baseline learns from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from ptae_lite.baselines import linear_describe
from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import accuracy_by_scenes
from ptae_lite.language import Meaning, patterns, words_of
from ptae_lite.training import label

LABELS = ("all", "random", "covering", "pseudo", "few updates")


@dataclass(frozen=True)
class Labels:
    """Which samples, or which updates, have a label.

    Attributes:
        chosen: `all`; `random`, that is `percent` of the samples, drawn at random; `covering`, the
            same but drawn so that they have every word (`labels.cover`); `pseudo`: as `random`, and
            the others have a label that was found (`pseudo_labels`); or `few updates`: all samples
            have a label, but few updates use one (the recipe says how many).
        percent: share of the samples, above 0 to 100.

    Raises:
        ConfigError: there is no such choice.
    """

    chosen: str = "all"
    percent: float = 100

    def __post_init__(self):
        if self.chosen not in LABELS:
            raise ConfigError(f"no labels {self.chosen!r}; there are {', '.join(LABELS)}")


def chosen(samples: Samples, split: str, labels: Labels, seed: int) -> Int[np.ndarray, " M"] | None:
    """Numbers of the samples of a split that have a true label; None if all have one."""
    if labels.chosen in ("random", "pseudo"):
        return label(samples.split(split), labels.percent, seed)
    if labels.chosen == "covering":
        return cover(samples, samples.split(split), labels.percent, seed)
    return None


def cover(samples: Samples, train, share_percent: float, seed: int) -> Int[np.ndarray, " M"]:
    """Draw as many labelled samples as `label`, but so that all words appear about equally often.

    Samples are taken one after the other: always a random one of those whose words appeared least
    so far. A word of a large class weighs more, so the first six samples have all six colours.
    Synonyms count as one word.
    """
    count = len(label(train, share_percent, seed))
    left = np.random.default_rng([9, seed]).permutation(train)
    words = [word for kind in Meaning._fields for word in words_of(kind)]
    weight = np.concatenate([[len(words_of(k))] * len(words_of(k)) for k in Meaning._fields])
    said = np.array([[word in _meaning(samples, i) for word in words] for i in left])
    named, taken = np.zeros(len(words)), []
    while len(taken) < count:
        score = said @ (named * weight)
        score[taken] = np.inf
        taken.append(int(np.argmin(score)))
        named += said[taken[-1]]
    return np.sort(left[taken])


def linear_scores(samples: Samples, labelled, split: str = "test") -> dict[str, float]:
    """Percentage of a split for which `baselines.linear_describe` is right; and of each word.

    Apart for new and known scenes as well (`evaluation.accuracy_by_scenes`).
    """
    indices = samples.split(split)
    said = linear_describe(samples, labelled, indices)
    pairs = [(a, _meaning(samples, i)) for a, i in zip(said, indices, strict=True)]
    words = {
        f"{kind}_accuracy": 100 * np.mean([a[k] == b[k] for a, b in pairs])
        for k, kind in enumerate(Meaning._fields)
    }
    right = np.array([a == b for a, b in pairs])
    found = {"describe_accuracy": 100 * right.mean()} | words
    found |= accuracy_by_scenes(right, samples, split)
    return {name: round(float(value), 3) for name, value in found.items()}


def _meaning(samples: Samples, i) -> Meaning:
    return patterns()[samples.pattern[i]].meaning

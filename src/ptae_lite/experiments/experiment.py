"""One training, described completely: what is trained, how, on which data, with which labels.

Two experiments with the same hash are the same training. The hash is of the content (SHA-256 of
names and numbers), so it is the same in every process, on every machine, and in any order of
fields. All settings enter it, the unchanged ones too: where a default changes, so does the hash.
What is off (False, 0, an empty text, None) is left out. So a setting that is added later, and that
is off where nobody asks for it, changes no hash of before.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.models import MODELS

LABELS = ("all", "random", "covering", "few updates")
VIDEOS = ("noisy", "own episodes")


@dataclass(frozen=True)
class Labels:
    """Which samples, or updates, have a label.

    `chosen` is one of `LABELS`: all; `percent` of the samples, drawn at `random` or `covering`
    every word (`labels.cover`); or all samples, but in `few updates` (the recipe says how many).
    """

    chosen: str = "all"
    percent: float = 100

    def __post_init__(self):
        if self.chosen not in LABELS:
            raise ConfigError(f"no labels {self.chosen!r}; there are {', '.join(LABELS)}")


@dataclass(frozen=True)
class Experiment:
    """A training. `config` and `recipe` are complete; the recipe holds the seed of every draw."""

    model: str  # a name in `models.MODELS`
    config: Any  # the model's sizes and choices
    recipe: Any  # how it is trained
    data: str  # `Samples.name` and the hash of their content
    split: str = "train"
    labels: Labels = Labels()
    videos: str = ""  # one of `VIDEOS`, beside the recorded ones; see `videos`
    base: Experiment | None = None  # whose `own episodes` they are
    name: str = field(default="", compare=False)  # of the file of its weights; not of the training

    def __post_init__(self):
        if self.videos and self.videos not in VIDEOS:
            raise ConfigError(f"no videos {self.videos!r}; there are {', '.join(VIDEOS)}")

    @property
    def seed(self) -> int:
        return self.recipe.seed

    @property
    def file(self) -> str:
        """The name of its weights in a folder, such as `ptae_no_blends_seed0.safetensors`."""
        name = (self.name or self.model).lower().replace(", ", "_").replace(" ", "_")
        return f"{name}_seed{self.seed}.safetensors"

    @cached_property
    def hash(self) -> str:
        """64 hexadecimal digits, which stand in the weights as `about["experiment"]`."""
        content = asdict(self)
        del content["name"], content["base"]
        content |= {"base": self.base.hash if self.base else None}
        text = json.dumps(_canonical(content), sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()


def experiment(
    samples: Samples, model: str = "ptae", config: Mapping | None = None,
    recipe: Mapping | None = None, seed: int = 0, **more,
) -> Experiment:  # fmt: skip
    """The regular training of a model, but for some settings.

    Args:
        config: what differs from the model's own choices, by name.
        recipe: what differs from the model's own recipe in `MODELS`, by name.
        more: other fields of `Experiment`.

    Raises:
        ConfigError: no such model.
    """
    if model not in MODELS:
        raise ConfigError(f"no model {model!r}; there are {', '.join(MODELS)}")
    sizes = MODELS[model].config(**{"features": samples.features.shape[2]} | dict(config or {}))
    how = replace(MODELS[model].recipe, **dict(recipe or {}) | {"seed": seed})
    return Experiment(model, sizes, how, samples.fingerprint, **more)


def _canonical(value):
    """Numbers as floats, so that 10 and 10.0 are one; what is off is left out of a mapping."""
    if isinstance(value, Mapping):
        return {name: _canonical(one) for name, one in value.items() if one}
    if isinstance(value, (list, tuple)):
        return [_canonical(one) for one in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    return value

"""One training, described completely: the model, how it is trained, the data and the labels.

Two experiments with the same hash are the same training. The hash is a SHA-256 of names and
numbers. It does not depend on the process, the machine or the order of the fields. All settings are
part of it, also those that have their default value. So if a default changes, the hash changes.

Settings that are off (False, 0, an empty text, None) are left out. So a setting that is added
later, and is off by default, does not change the hashes of earlier experiments.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.experiments.labels import Labels, chosen
from ptae_lite.experiments.pseudo_labels import pseudo_labelled
from ptae_lite.models import MODELS, checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.training import train

VIDEOS = ("noisy", "own episodes")


@dataclass(frozen=True)
class Experiment:
    """A training. Its `config` and `recipe` are complete, and the recipe has the seed of all draws.

    `fit`, `load`, `save`, `hash`, `file` and `base` are all that the runner asks of it. Trainings
    of another kind (`encoder_training`) have the same.

    Attributes:
        model: a name in `models.MODELS`.
        config: the model's sizes and choices.
        recipe: how it is trained.
        data: `Samples.fingerprint`: the name of the data and the hash of their content.
        split: the samples that are trained on.
        labels: which of them have a label.
        videos: further videos beside the recorded ones: one of `VIDEOS`, or none; see `videos`.
        base: the experiment whose model makes the videos of `own episodes`.
        name: the name of its file of weights. It is not part of the hash.

    Raises:
        ConfigError: there are no such videos.
    """

    model: str
    config: Any
    recipe: Any
    data: str
    split: str = "train"
    labels: Labels = Labels()
    videos: str = ""
    base: Experiment | None = None
    name: str = field(default="", compare=False)

    def __post_init__(self):
        if self.videos and self.videos not in VIDEOS:
            raise ConfigError(f"no videos {self.videos!r}; there are {', '.join(VIDEOS)}")

    @property
    def seed(self) -> int:
        """The seed of all draws."""
        return self.recipe.seed

    @property
    def file(self) -> str:
        """The file name of its weights, such as `ptae_no_mixup_seed0.safetensors`."""
        name = (self.name or self.model).lower().replace(", ", "_").replace(" ", "_")
        return f"{name}_seed{self.seed}.safetensors"

    @cached_property
    def hash(self) -> str:
        """The hash, 64 hexadecimal digits. The weights have it as `about["experiment"]`."""
        every = asdict(self) | {"base": self.base.hash if self.base else None}
        content = {one.name: every[one.name] for one in fields(self) if one.compare}
        text = json.dumps(_canonical(content), sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def load(self, path) -> Trained:
        """What `save` wrote."""
        return checkpoint.load(path)

    def save(self, path, trained: Trained) -> None:
        """Write what `fit` made."""
        checkpoint.save(path, trained)

    def fit(
        self, samples: Samples, base: Trained | None = None, watch=None, unfinished=None, **options
    ) -> Trained:
        """Train it. The model says in `about` which `experiment` it is.

        Args:
            base: the trained `base` of this experiment.
            watch: see `runner.Study`.
            unfinished: the file of its state while it runs, see `training.train`.
            options: `device` and `progress`, see `training.train`.

        Raises:
            ConfigError: the experiment is of other samples.
        """
        if samples.fingerprint != self.data:
            raise ConfigError(f"the experiment is of {self.data}, not of {samples.fingerprint}")
        made = None
        if self.videos:
            from ptae_lite.experiments import videos

            made = videos.make(self.videos, samples, samples.split(self.split), self.seed, base)

        def look(epoch: int, trained: Trained) -> dict | None:
            return None if watch is None else watch(trained, samples, epoch)

        own, seen, true = chosen(samples, self.split, self.labels, self.seed), samples, None
        if self.labels.chosen == "pseudo":  # true labels are few, but every sample has a label
            seen, own, true = pseudo_labelled(samples, self.split, own), None, len(own)
        trained = train(
            seen, self.recipe, model=self.model, config=self.config, split=self.split,
            labelled=own, limited=self.labels.chosen == "few updates", videos=made,
            unfinished=unfinished, on_epoch=look, **options,
        )  # fmt: skip
        trained.about["experiment"] = self.hash
        if true:
            trained.about["labelled"] = true
        return trained


def experiment(
    samples: Samples, model: str = "ptae", config: Mapping | None = None,
    recipe: Mapping | None = None, seed: int = 0, **more,
) -> Experiment:  # fmt: skip
    """The regular training of a model, with some settings changed.

    Args:
        config: settings of the model's configuration to change, by name.
        recipe: settings of the model's recipe in `MODELS` to change, by name.
        more: other fields of `Experiment`.

    Raises:
        ConfigError: there is no such model, or a value makes no sense.
    """
    if model not in MODELS:
        raise ConfigError(f"no model {model!r}; there are {', '.join(MODELS)}")
    sizes = MODELS[model].config(**{"features": samples.features.shape[2]} | dict(config or {}))
    how = replace(MODELS[model].recipe, **dict(recipe or {}) | {"seed": seed})
    return Experiment(model, sizes, how, samples.fingerprint, **more)


def _canonical(value):
    """The value in one form for the hash.

    Numbers become floats, so that 10 and 10.0 are the same. Settings that are off are left out.
    """
    if isinstance(value, Mapping):
        return {name: _canonical(one) for name, one in value.items() if one}
    if isinstance(value, (list, tuple)):
        return [_canonical(one) for one in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    return value

"""The training of a watching policy as an experiment: which clips, how many, and what is left out.

Its base is the one-look policy of the closed loop, trained on the same split with the same seed.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from ptae_lite.data import demonstrations
from ptae_lite.data.clips import OF_FRAMES, Clips, load_clips
from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.experiments.closed_loop import MODELS as OF_LOOP
from ptae_lite.experiments.experiment import Experiment, experiment
from ptae_lite.models import ADAM
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.ptae import PTAEConfig
from ptae_lite.models.watching import WatcherConfig
from ptae_lite.watching_training import WatchingRecipe, train

BASE = "one_look_policy"


@dataclass(frozen=True)
class WatchingTraining(Experiment):
    """The training of a watching policy. Its methods are those of `Experiment`.

    Attributes:
        clips: the fingerprint of the corrected clips; none if it learns from recorded ones alone.
        amount: the share of them that is used.
        folder: where they are.
    """

    clips: str = ""
    amount: float = 1.0
    folder: str = field(default="", compare=False)

    def fit(
        self, samples: Samples, base: Trained | None = None, watch=None, unfinished=None
    ) -> Trained:
        """Train it on the recorded clips of its split and its share of the corrected ones.

        Raises:
            ConfigError: the samples or the clips are others than those of the experiment.
        """
        if samples.fingerprint != self.data:
            raise ConfigError(f"the experiment is of {self.data}, not of {samples.fingerprint}")
        shown = demonstrations.recorded(samples, samples.split(self.split))
        if self.clips:
            own = share_of(load_clips(self.folder).of(samples.split(self.split)), self.amount)
            if fingerprint(own) != self.clips:
                raise ConfigError(f"{self.folder} holds other clips than those of the experiment")
            shown = demonstrations.joined([shown, demonstrations.corrected(own)])
        trained = train(base, shown, self.recipe, blind=self.config.blind)
        trained.about["experiment"] = self.hash
        return trained


def share_of(clips: Clips, amount: float) -> Clips:
    """A share of the clips, mixed. A small share is part of a larger one."""
    order = np.random.default_rng(27).permutation(np.argsort(clips.seed))
    chosen = np.zeros(len(clips), dtype=bool)
    chosen[order[: math.ceil(amount * len(clips))]] = True
    return clips.where(chosen)


def fingerprint(clips: Clips) -> str:
    """A SHA-256 of all numbers of the clips. Their order does not matter."""
    order = np.argsort(clips.seed)
    of_frame = np.argsort(np.repeat(clips.seed, clips.frames), kind="stable")
    digest = hashlib.sha256()
    for one in fields(clips):
        values = getattr(clips, one.name)[of_frame if one.name in OF_FRAMES else order]
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def watching_training(
    samples: Samples, name: str, seed: int, split: str = "train", folder: str = "",
    amount: float = 1.0, blind: bool = False, **recipe,
) -> WatchingTraining:  # fmt: skip
    """The experiment of a watching policy.

    Args:
        name: of its file of weights.
        folder: of corrected clips; none if it learns from recorded ones alone.
        amount: the share of the corrected clips that is used.
        blind: see `WatcherConfig`.
        recipe: settings of the recipe to change.

    Raises:
        RecordingError: there are no clips in the folder.
    """
    suffix = "" if split == "train" else f"_{split}"
    base = experiment(samples, "ptae", OF_LOOP[BASE], ADAM["ptae"], seed, split=split,
                      name=BASE + suffix)  # fmt: skip
    config = WatcherConfig(ptae=PTAEConfig(**vars(base.config)), blind=blind)
    clips = ""
    if folder:
        clips = fingerprint(share_of(load_clips(folder).of(samples.split(split)), amount))
    return WatchingTraining(
        "watcher", config, WatchingRecipe(seed=seed, **recipe), samples.fingerprint, split,
        base=base, name=name + suffix, clips=clips, amount=amount,
        folder=str(Path(folder).absolute()) if folder else "",
    )  # fmt: skip

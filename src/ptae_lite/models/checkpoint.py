"""A trained model in one file: weights, sizes, scaling, recipe, and its image encoder's hash."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import nn

from ptae_lite import artefacts, renamed
from ptae_lite.data.samples import Samples
from ptae_lite.data.scaling import Dataset, Scaling, prepare
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.models.registry import NETWORKS


@dataclass(frozen=True)
class TrainingRecord:
    """What a training reports. It is stored with the weights.

    Attributes:
        encoder: the hash of the image encoder's weights whose features were used.
        recipe: the fields of the `Recipe`.
        split: the samples that were trained on.
        holdout: training patterns kept aside as a test part, see `splits`.
        labelled: number of samples with a label.
        steps: updates of the whole training.
        supervised_samples_seen: how often a labelled sample took a signal that needs its label.
        history: for each epoch, the mean of each of the model's losses.
        seconds: of computing.
        watched: what `on_epoch` returned, each with the seconds until then.
    """

    encoder: str
    recipe: dict
    split: str
    holdout: int | None
    labelled: int
    steps: int
    supervised_samples_seen: int = 0
    history: list[list[float]] = field(default_factory=list)
    seconds: float = 0.0
    watched: list[dict] = field(default_factory=list)

    def after_epoch(
        self, means: Float[np.ndarray, " L"], supervised: int, seconds: float
    ) -> TrainingRecord:
        """With one more epoch: the means of its losses, its supervised samples, its seconds."""
        means = [round(mean, 5) for mean in means.tolist()]
        return replace(
            self,
            history=[*self.history, means],
            supervised_samples_seen=self.supervised_samples_seen + supervised,
            seconds=round(self.seconds + seconds, 3),
        )

    def with_watched(self, found: dict | None) -> TrainingRecord:
        """With what was seen of the training from outside, unless it is None."""
        if found is None:
            return self
        return replace(self, watched=[*self.watched, {"seconds": round(self.seconds, 1)} | found])


@dataclass(frozen=True)
class Trained:
    """A model with everything that is needed to use it.

    Attributes:
        about: the fields of its `TrainingRecord` (weights of earlier versions may lack some). If it
            was read from a file, also `kind` and `config`.
    """

    model: nn.Module
    scaling: Scaling
    about: dict

    def dataset(self, samples: Samples) -> Dataset:
        """`samples`, scaled as in this model's training.

        Raises:
            ArtefactError: the samples have the features of another image encoder.
            ConfigError: other patterns are held out than in the training, so it may have seen them.
        """
        if samples.encoder != self.about["encoder"]:
            raise ArtefactError(
                f"this model was trained on features of the CAE {self.about['encoder'][:12]}, "
                f"the samples have those of {samples.encoder[:12]}; train it on these features, or "
                "make the features again with its CAE"
            )
        mine = self.about.get("holdout")
        if samples.holdout not in (None, mine):
            raise ConfigError(
                f"{samples.holdout} patterns are held out, but this model was trained with "
                f"{mine or 'none'} held out and may have seen them; evaluate it as it was trained"
            )
        return prepare(samples, self.scaling)


def save(path, trained: Trained) -> None:
    """Write a trained model.

    Raises:
        FileError: the file cannot be written.
    """
    scaling = {f"scaling.{k}": torch.from_numpy(v) for k, v in vars(trained.scaling).items()}
    tensors = {f"model.{k}": v for k, v in trained.model.state_dict().items()}
    kind = {"kind": trained.model.kind, "config": asdict(trained.model.config)}
    artefacts.save_weights(path, tensors | scaling, trained.about | kind)


def load(path) -> Trained:
    """Read a trained model.

    Raises:
        ArtefactError: the file is missing, is damaged, holds no model of ours, or is of an earlier
            version.
    """
    tensors, about = artefacts.load_weights(path)
    if about.get("kind") not in NETWORKS:
        raise ArtefactError(
            f"{path} holds no model of ours but {about.get('kind')!r}; "
            f"models are {', '.join(NETWORKS)}"
        )
    old = renamed.said_of([*about, *about.get("config", ())], renamed.SETTINGS | renamed.COLUMNS)
    if old:
        raise ArtefactError(f"{path} was written by an earlier version ({old}); train it again")
    if "encoder" not in about:
        raise ArtefactError(f"{path} does not say whose features it was trained on; train it again")
    network, config = NETWORKS[about["kind"]]
    parts = {"model": {}, "scaling": {}}
    with artefacts.fits_itself(path):
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            parts[part][rest] = tensor
        model = network(config(**about["config"]))
        model.load_state_dict(parts["model"])
        scaling = Scaling(**{name: tensor.numpy() for name, tensor in parts["scaling"].items()})
    return Trained(model.eval(), scaling, about)

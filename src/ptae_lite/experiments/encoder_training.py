"""The training of an encoder as an experiment: a PCA, or a CAE up to a checkpoint.

The learning rate of a CAE falls over the last fifth of its training. Until then, trainings of all
lengths are the same (`vision.AutoencoderTrainer`). So a checkpoint has a base, a `LongTraining`:
the state of a longer training at the step where the rate of the checkpoint begins to fall. The base
of that is the long training at the checkpoint before. Neither the base nor the device is part of
the hash.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from typing import NamedTuple

from torch import nn

from ptae_lite import artefacts, devices, vision
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.vision import AutoencoderTrainer, pca

PCA_EVERY = 8  # of the training images: 2,066 of them


class TrainedEncoder(NamedTuple):
    """An encoder that was trained.

    Args:
        encoder: its network, or PCA.
        about: what its file says of it: its `experiment`, its `device` and the `seconds` it took.
        training: the training, if it can go on.
    """

    encoder: nn.Module
    about: dict
    training: AutoencoderTrainer | None = None


@dataclass(frozen=True)
class PCARecipe:
    """How a PCA is fitted.

    Attributes:
        samples_seen: number of images.
        seed: of no use, since nothing is drawn.
    """

    samples_seen: int
    seed: int = 0


def folder_of(name: str, seed: int) -> str:
    """The folder of an encoder's files, inside that of the study."""
    return f"{name.replace(' ', '_')}_seed{seed}"


@dataclass(frozen=True)
class EncoderTraining(Experiment):
    """The training of an encoder. `model` is its kind, and `config` has its number `code`.

    Its methods are those of `Experiment`. Instead of samples, `fit` takes what has `images`, such
    as `encoders.Bench`.

    Attributes:
        base: the training that this one goes on from.
        device: where it is trained.
    """

    base: EncoderTraining | None = field(default=None, compare=False)
    device: str = field(default="cpu", compare=False)

    @property
    def file(self) -> str:
        """The file of its weights, inside the folder of the study."""
        return f"{folder_of(self.name, self.seed)}/encoder_{self.recipe.samples_seen}.safetensors"

    def load(self, path) -> TrainedEncoder:
        """Read what `save` wrote."""
        return TrainedEncoder(vision.load_autoencoder(path), artefacts.load_weights(path)[1])

    def save(self, path, trained: TrainedEncoder) -> None:
        """Write what `fit` returned."""
        vision.save_autoencoder(path, trained.encoder, self.recipe, **trained.about)

    def about(self, seconds: float) -> dict:
        """What its file says of a training that took so many seconds."""
        return {"experiment": self.hash, "seconds": seconds, "device": self.device}

    def fresh(self) -> nn.Module:
        """An untrained encoder of this kind."""
        return vision.make_autoencoder(self.model, self.config["code"])


class PCATraining(EncoderTraining):
    """A PCA of every `PCA_EVERY`-th image."""

    def fit(self, bench, base=None, watch=None, unfinished=None) -> TrainedEncoder:
        """Fit the PCA."""
        begun = time.process_time()
        encoder = pca.fit(self.fresh(), bench.images[::PCA_EVERY])
        return TrainedEncoder(encoder, self.about(time.process_time() - begun))


class CAETraining(EncoderTraining):
    """A CAE to the end of its recipe: its base, a `LongTraining`, and the falling rate."""

    def fit(self, bench, base: TrainedEncoder, watch=None, unfinished=None) -> TrainedEncoder:
        """Train it to its end, from the state of its base."""
        steps, begun = self.recipe.steps, devices.clock(self.device)
        base.training.go(bench.images, steps, steps, value=False)
        seconds = base.about["seconds"] + devices.clock(self.device) - begun
        return TrainedEncoder(base.training.encoder.to("cpu").eval(), self.about(seconds))


class LongTraining(EncoderTraining):
    """The first `steps` of a CAE's training that goes on, with the optimiser's memory."""

    @property
    def file(self) -> str:
        """The file of its state."""
        return super().file.replace("/encoder_", "/training_")

    def start(self) -> AutoencoderTrainer:
        """The training before its first step."""
        return AutoencoderTrainer(self.fresh(), self.recipe, self.device)

    def fit(
        self, bench, base: TrainedEncoder | None = None, watch=None, unfinished=None
    ) -> TrainedEncoder:
        """Train it, from the state of its base or from the start."""
        training = base.training if base else self.start()
        begun = devices.clock(self.device)
        training.go(bench.images, self.recipe.steps, value=False)
        seconds = devices.clock(self.device) - begun + (base.about["seconds"] if base else 0)
        return TrainedEncoder(training.encoder, self.about(seconds), training)

    def save(self, path, trained: TrainedEncoder) -> None:
        """Write the weights and the optimiser's state."""
        training = trained.training
        tensors = {f"encoder.{name}": x for name, x in training.encoder.state_dict().items()}
        for i, memory in training.state_dict()["state"].items():
            tensors |= {f"memory.{i}.{name}": value for name, value in memory.items()}
        about = trained.about | {"kind": "training of an encoder", "recipe": asdict(self.recipe)}
        artefacts.save_weights(path, tensors, about)

    def load(self, path) -> TrainedEncoder:
        """Read what `save` wrote, as a training that can go on."""
        tensors, about = artefacts.load_weights(path)
        weights, memory = {}, {}
        for name, value in tensors.items():
            part, rest = name.split(".", 1)
            if part == "encoder":
                weights[rest] = value
            else:
                i, what = rest.split(".")
                memory.setdefault(int(i), {})[what] = value
        training = self.start()
        with artefacts.fits_itself(path):
            training.encoder.load_state_dict(weights)
            training.load_state_dict(training.state_dict() | {"state": memory})
        training.step = about["recipe"]["steps"]
        return TrainedEncoder(training.encoder, about, training)

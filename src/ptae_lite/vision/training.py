"""The training of an autoencoder: pixel-wise cross-entropy, Adam, a rate that falls at the end."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from ptae_lite import devices
from ptae_lite.errors import ConfigError
from ptae_lite.unfinished import Unfinished
from ptae_lite.vision.features import as_input


class PixelCrossEntropy(torch.autograd.Function):
    """Mean over pixels of the cross-entropy of `sigmoid(z)` and the image `x`: the paper's loss.

    It equals `binary_cross_entropy(sigmoid(z), x)`. The gradient is `(sigmoid(z) - x) / n` for n
    pixels, so a training that does not need the value of the loss saves the two logarithms a pixel.
    """

    @staticmethod
    def forward(ctx, z, x, value: bool = True):
        """The loss of logits `z` for images `x`, both (B, C, 120, 160); 0 without `value`."""
        ctx.save_for_backward(torch.sigmoid(z).sub_(x).div_(z.numel()))
        if not value:
            return z.new_zeros(())
        return functional.binary_cross_entropy_with_logits(z, x)

    @staticmethod
    def backward(ctx, outer):
        """The gradient by `z`; there is none by `x` and `value`."""
        return ctx.saved_tensors[0] * outer, None, None


@dataclass(frozen=True)
class AutoencoderRecipe:
    """How a CAE is trained.

    Raises:
        ConfigError: `steps` or `batch` is less than 1.
    """

    steps: int = 8000  # ours; the published code takes 10,000
    batch: int = 16  # ours; published 200
    learning_rate: float = 1e-3  # published; there it stays constant, see `AutoencoderTrainer`
    seed: int = 0

    def __post_init__(self):
        if self.steps < 1 or self.batch < 1:
            raise ConfigError("a CAE needs at least one step, and an image a batch")

    @property
    def samples_seen(self) -> int:
        """How many images are presented in all."""
        return self.steps * self.batch


WARM_UP = 50  # steps until the learning rate is reached
DECAY = 0.2  # share of all steps, at the end, in which the learning rate falls to zero


def rate_share(step: int, steps: int | None) -> float:
    """The learning rate at a step, as a share (0 to 1) of the recipe's rate.

    ::

        min(1, (step + 1) / 50, (steps - step) / (0.2 steps))

    Args:
        step: counted from 0.
        steps: length of the training; None means that the rate does not fall.
    """
    share = min(1, (step + 1) / WARM_UP)
    return share if steps is None else min(share, (steps - step) / (DECAY * steps))


class AutoencoderTrainer:
    """The training of a fresh CAE, which can be stopped, copied and continued.

    The learning rate rises linearly over the first 50 steps, stays constant, and falls linearly to
    zero over the last fifth (ours; the published rate is constant). Before it falls, nothing
    depends on the length of the training. So one long training passes through the states from which
    shorter trainings start to fall. The batch of a step depends on the seed and the number of the
    step alone.

    Args:
        encoder: trained in place; it starts from fresh weights and stays on `device`.
        device: such as `cpu` or `cuda`.
    """

    def __init__(self, encoder: nn.Module, recipe: AutoencoderRecipe, device: str = "cpu"):
        devices.check(device)
        with devices.seeded(recipe.seed, "cpu"):
            for layer in encoder.modules():
                if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.Linear):
                    layer.reset_parameters()
        self.recipe, self.device, self.step = recipe, device, 0
        gpu, rate = torch.device(device).type == "cuda", recipe.learning_rate
        if gpu:  # a replayed step always reads the rate from the same place in memory
            rate = torch.tensor(rate, device=device)
        self.layout = torch.contiguous_format if gpu else torch.channels_last  # the faster there
        self.encoder = encoder.to(device, memory_format=self.layout).train()
        fused = None if gpu else True  # on a GPU PyTorch chooses
        self.optimiser = torch.optim.Adam(
            encoder.parameters(), lr=rate, capturable=gpu, fused=fused
        )

    def go(self, images, until: int, steps: int | None = None, *, value: bool = True,
           progress=lambda steps: steps, on_step=lambda loss: None) -> list[float]:  # fmt: skip
        """Train up to step `until`, and return the losses of these steps.

        Args:
            images: (M, 120, 160, 3) bytes, or `frames.Images`.
            steps: length of the whole training; None means that the rate does not fall yet.
            value: without it the losses are not computed, and zeros are returned.
            progress: wraps the iterator over steps, as `tqdm` does.
            on_step: is called with the loss after each step.
        """
        losses, update = [], devices.Replayed(partial(self._update, value=value))
        with devices.whole_float32():
            for step in progress(range(self.step, until)):
                rng = np.random.default_rng([self.recipe.seed, step])
                some = images[rng.integers(0, len(images), self.recipe.batch)]
                self._set_rate(self.recipe.learning_rate * rate_share(step, steps))
                x = as_input(some, self.device).contiguous(memory_format=self.layout)
                loss = update(x)
                losses.append(loss.item() if value else 0.0)
                self.step = step + 1
                on_step(losses[-1])
        return losses

    def state_dict(self) -> dict:
        """The optimiser's state."""
        return self.optimiser.state_dict()

    def load_state_dict(self, state: dict) -> None:
        """Take over an optimiser's state."""
        self.optimiser.load_state_dict(state)
        for weight, memory in self.optimiser.state.items():
            for what in ("exp_avg", "exp_avg_sq"):  # Adam's fused step takes them as they lie
                laid_out_as_weight = torch.empty_like(weight.detach())
                memory[what] = laid_out_as_weight.copy_(memory[what])

    def _update(self, x, value: bool):
        """One step on a batch; returns its loss."""
        self.optimiser.zero_grad()  # first: the last gradients take as much memory as the weights
        loss = PixelCrossEntropy.apply(self.encoder.logits(x), x, value)
        loss.backward()
        self.optimiser.step()
        return loss.detach()

    def _set_rate(self, rate: float) -> None:
        for group in self.optimiser.param_groups:
            if torch.is_tensor(group["lr"]):
                group["lr"].fill_(rate)
            else:
                group["lr"] = rate


def train_autoencoder(
    encoder: nn.Module,
    images,
    recipe: AutoencoderRecipe = AutoencoderRecipe(),
    progress=lambda steps: steps,
    device: str = "cpu",
    unfinished=None,
) -> list[float]:
    """Train on random batches of `images` by pixel-wise cross-entropy, and return the loss of each
    step.

    The loss is the paper's; the schedule of the rate is ours (`AutoencoderTrainer`).

    Args:
        encoder: trained in place; it comes back on the CPU.
        images: of training patterns only: (M, 120, 160, 3) bytes, or `frames.Images`, which decodes
            them batch by batch.
        progress: wraps the iterator over steps, as `tqdm` does.
        device: where the training runs, such as `cpu` or `cuda`.
        unfinished: a file that keeps the state of the training every ten minutes. If it is there,
            the training goes on from it, to the same weights. It stays when the training is done.

    Raises:
        ArtefactError: `unfinished` is the state of another training.
    """
    training = AutoencoderTrainer(encoder, recipe, device)
    some = np.linspace(0, len(images) - 1, 8).astype(int)
    state = Unfinished(unfinished, asdict(recipe) | {
        "model": type(encoder).__name__, "code": encoder.code,
        "images": [len(images), int(np.asarray(images[some], dtype=int).sum())],
    })  # fmt: skip
    training.step, record = state.load(encoder, training)
    losses = record.get("losses", [])

    def keep(loss: float) -> None:
        losses.append(loss)
        state.save(training.step, encoder, training, {"losses": losses})

    training.go(images, recipe.steps, recipe.steps, progress=progress, on_step=keep)
    encoder.to("cpu").zero_grad()  # the last gradients take as much memory as the weights
    return losses

"""The eye: convolutional autoencoders (CAE) that turn an image into a few numbers.

`ChannelSeparatedCAE` is the paper's: one network for each of red, green and blue, 10 features
each, so F = 30 (paper, section 3.1; the layer table follows the published code). `PlainCAE` sees
the three channels together. The five fully connected layers are linear, as published.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite import artefacts, devices, pca
from ptae_lite.errors import ArtefactError, ConfigError

CODE = 10  # features a channel


_relu = partial(nn.ReLU, inplace=True)  # saves a pass through memory


class CAE(nn.Module):
    """Encoder and decoder for images of `channels` channels, with `code` numbers between them.

    Differs from the paper in nothing; 664,891 parameters for one channel and ten numbers.
    """

    def __init__(self, channels: int, code: int = CODE):
        super().__init__()
        self.channels, self.code = channels, code
        self.encoder = nn.Sequential(  #                                   C x 120 x 160
            nn.Conv2d(channels, 8, 4, stride=2, padding=1), _relu(),  #     8 x 60 x 80
            nn.Conv2d(8, 16, 4, stride=2, padding=1), _relu(),  #          16 x 30 x 40
            nn.Conv2d(16, 32, 4, stride=2, padding=1), _relu(),  #      32 x 15 x 20
            nn.Conv2d(32, 64, 8, stride=5, padding=2), _relu(),  #      64 x 3 x 4
            nn.Flatten(), nn.Linear(768, 384), nn.Linear(384, 192), nn.Linear(192, code),
        )  # fmt: skip
        self.decoder = nn.Sequential(
            nn.Linear(code, 192), nn.Linear(192, 384), nn.Unflatten(1, (32, 3, 4)),
            nn.ConvTranspose2d(32, 32, 8, stride=5, padding=2, output_padding=1), _relu(),
            nn.ConvTranspose2d(32, 16, 4, stride=2, padding=1), _relu(),
            nn.ConvTranspose2d(16, 8, 4, stride=2, padding=1), _relu(),
            nn.ConvTranspose2d(8, channels, 4, stride=2, padding=1), nn.Sigmoid(),
        )  # fmt: skip

    def encode(self, images: Float[Tensor, "B C 120 160"]) -> Float[Tensor, "B F"]:
        return self.encoder(images)

    def decode(self, features: Float[Tensor, "B F"]) -> Float[Tensor, "B C 120 160"]:
        return self.decoder(features)

    def forward(self, images):
        """The reconstruction of `images`, values 0 to 1."""
        return self.decode(self.encode(images))

    def logits(self, images):
        """The reconstruction before its last layer, the sigmoid."""
        return self.decoder[:-1](self.encode(images))


class PlainCAE(CAE):
    """One network for the three channels together: 10 features as published, or more."""

    kind = "plain"

    def __init__(self, code: int = CODE):
        super().__init__(3, code)


class ChannelSeparatedCAE(nn.Module):
    """Three networks, one for each colour channel; their codes lie side by side (F = 3 x code)."""

    kind = "separated"

    def __init__(self, code: int = CODE):
        super().__init__()
        self.code = code
        self.red, self.green, self.blue = (CAE(1, code) for _ in range(3))

    def _channels(self):
        return (self.red, self.green, self.blue)

    def encode(self, images: Float[Tensor, "B 3 120 160"]) -> Float[Tensor, "B F"]:
        parts = zip(self._channels(), images.split(1, dim=1), strict=True)
        return torch.cat([cae.encode(channel) for cae, channel in parts], dim=1)

    def decode(self, features: Float[Tensor, "B F"]) -> Float[Tensor, "B 3 120 160"]:
        parts = zip(self._channels(), features.split(self.code, dim=1), strict=True)
        return torch.cat([cae.decode(code) for cae, code in parts], dim=1)

    def forward(self, images):
        """The reconstruction of `images`, values 0 to 1."""
        return self.decode(self.encode(images))

    def logits(self, images):
        """The reconstruction before its last layer, the sigmoid."""
        parts = zip(self._channels(), images.split(1, dim=1), strict=True)
        return torch.cat([cae.logits(channel) for cae, channel in parts], dim=1)


EYES = {"separated": ChannelSeparatedCAE, "plain": PlainCAE}
WITHOUT_NETWORK = {eye.kind: eye for eye in (pca.JointPCA, pca.ChannelPCA)}


def make_eye(kind: str, code: int = CODE) -> nn.Module:
    """A fresh eye of a kind in `EYES` or `WITHOUT_NETWORK`."""
    kinds = EYES | WITHOUT_NETWORK
    if kind not in kinds:
        raise ConfigError(f"no eye {kind!r}; there are {', '.join(kinds)}")
    return kinds[kind](code)


def as_input(
    images: UInt8[np.ndarray, "B 120 160 3"], device: str = "cpu"
) -> Float[Tensor, "B 3 120 160"]:
    """Camera images as a network takes them: 0 to 1, channels first (in name; not moved in memory).

    Convolutions are faster on images whose channels lie side by side, as the camera gives them.
    """
    if images.ndim != 4 or images.shape[1:] != (120, 160, 3) or images.dtype != np.uint8:
        raise ConfigError(
            f"images are B x 120 x 160 x 3 bytes, not {images.shape} of {images.dtype}"
        )
    own = np.require(images, requirements="W")  # shared with other processes they cannot be written
    return torch.from_numpy(own).to(device).permute(0, 3, 1, 2).float().div_(255)


class PixelCrossEntropy(torch.autograd.Function):
    """Mean over pixels of the cross-entropy of `sigmoid(z)` and `x`, the paper's loss.

    Equal to `binary_cross_entropy(sigmoid(z), x)`, but without its two logarithms a pixel where
    they are not asked for: the gradient is `(sigmoid(z) - x) / n`. Without `value` it returns 0.
    """

    @staticmethod
    def forward(ctx, z, x, value: bool = True):
        """The loss of logits `z` for images `x`, both (B, C, 120, 160)."""
        ctx.save_for_backward((torch.sigmoid(z) - x).div_(z.numel()))
        if not value:
            return z.new_zeros(())
        return functional.binary_cross_entropy_with_logits(z, x)

    @staticmethod
    def backward(ctx, outer):
        """Its gradient by `z`; there is none by the images."""
        return ctx.saved_tensors[0] * outer, None, None


@dataclass(frozen=True)
class EyeRecipe:
    """How a CAE is trained."""

    steps: int = 8000  # ours; the published code takes 10,000
    batch: int = 16  # ours; published 200
    learning_rate: float = 1e-3  # published; there it stays constant, see `EyeTraining`
    seed: int = 0

    def __post_init__(self):
        if self.steps < 1 or self.batch < 1:
            raise ConfigError("a CAE needs at least one step, and an image a batch")


WARM_UP = 50  # steps until the learning rate is reached
DECAY = 0.2  # of all steps: the share at the end in which it falls to zero


def rate_share(step: int, steps: int | None) -> float:
    """The learning rate at a step (from 0), as a share of the recipe's; `steps` as in `go`."""
    share = min(1, (step + 1) / WARM_UP)
    return share if steps is None else min(share, (steps - step) / (DECAY * steps))


class EyeTraining:
    """The training of a fresh CAE, which can be stopped, copied and gone on with.

    The rate rises in a straight line over the first steps, stays, and falls in a straight line to
    zero over the last fifth (ours). Until it falls, a training does not depend on how long it will
    be: a long one passes through the states that shorter ones end from. Each step draws its batch
    from the seed and its own number. The eye stays on the `device`.
    """

    def __init__(self, eye: nn.Module, recipe: EyeRecipe, device: str = "cpu"):
        devices.check(device)
        torch.manual_seed(recipe.seed)
        for layer in eye.modules():
            if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.Linear):
                layer.reset_parameters()
        self.recipe, self.device, self.step = recipe, device, 0
        gpu, rate = torch.device(device).type == "cuda", recipe.learning_rate
        if gpu:  # a replayed step reads the rate where it lies
            rate = torch.tensor(rate, device=device)
        self.layout = torch.contiguous_format if gpu else torch.channels_last  # the faster there
        self.eye = eye.to(device, memory_format=self.layout).train()
        fused = None if gpu else True  # on a GPU PyTorch chooses
        self.optimiser = torch.optim.Adam(eye.parameters(), lr=rate, capturable=gpu, fused=fused)

    def go(self, images, until: int, steps: int | None = None, *, value: bool = True,
           progress=lambda steps: steps) -> list[float]:  # fmt: skip
        """Train up to step `until` of `steps`; the losses of these steps, zeros without `value`.

        Without `steps` the training is a long one, whose rate does not fall yet.
        """
        losses, update = [], devices.Replayed(partial(self._update, value=value))
        for step in progress(range(self.step, until)):
            rng = np.random.default_rng([self.recipe.seed, step])
            some = images[rng.integers(0, len(images), self.recipe.batch)]
            self._set_rate(self.recipe.learning_rate * rate_share(step, steps))
            x = as_input(some, self.device).contiguous(memory_format=self.layout)
            loss = update(x)
            losses.append(loss.item() if value else 0.0)
            self.step = step + 1
        return losses

    def _update(self, x, value: bool):
        """One step on a batch; its loss."""
        loss = PixelCrossEntropy.apply(self.eye.logits(x), x, value)
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        return loss.detach()

    def _set_rate(self, rate: float) -> None:
        for group in self.optimiser.param_groups:
            if torch.is_tensor(group["lr"]):
                group["lr"].fill_(rate)
            else:
                group["lr"] = rate


def train_eye(
    eye: nn.Module,
    images: UInt8[np.ndarray, "M 120 160 3"],
    recipe: EyeRecipe = EyeRecipe(),
    progress=lambda steps: steps,
    device: str = "cpu",
) -> list[float]:
    """Train on random batches of `images` by pixel-wise cross-entropy; returns the loss curve.

    Only frames of training patterns belong in `images`. The loss is the paper's; the schedule is
    ours (`EyeTraining`). The arithmetic is done on the `device`; the eye comes back to the CPU.
    """
    training = EyeTraining(eye, recipe, device)
    losses = training.go(images, recipe.steps, recipe.steps, progress=progress)
    eye.to("cpu")
    return losses


@torch.no_grad()
def encode_images(
    eye: nn.Module, images: UInt8[np.ndarray, "M 120 160 3"], batch: int = 100
) -> Float[np.ndarray, "M F"]:
    """Features of images."""
    parts = [eye.encode(as_input(images[i : i + batch])) for i in range(0, len(images), batch)]
    return torch.cat(parts).numpy()


def encode_recording(
    eye: nn.Module, folder, progress=lambda samples: samples
) -> Float[np.ndarray, "M F"]:
    """Features of every frame of a recording, sample after sample.

    They go into one array: small ones of their own, made while images come and go, would keep the
    memory around them from being used again (20 GB by the end).
    """
    from ptae_lite.language import pattern
    from ptae_lite.robot.recorder import load_sequence, samples_in_order

    samples = samples_in_order()
    ends = np.cumsum([pattern(index).frames for index, _ in samples])
    size = encode_images(eye, np.zeros((1, 120, 160, 3), np.uint8)).shape[1]
    codes = np.empty((ends[-1], size), np.float32)
    for sample, part in zip(progress(samples), np.split(codes, ends[:-1]), strict=True):
        part[:] = encode_images(eye, load_sequence(folder, *sample).images)
    return codes


def save_eye(path, eye: nn.Module, recipe: EyeRecipe | None = None, device: str = "cpu") -> None:
    """Write an eye with its kind, where it was trained and, of a CAE, its recipe into one file."""
    about = {"kind": eye.kind, "code": eye.code, "recipe": asdict(recipe) if recipe else None}
    about["device"] = device
    artefacts.save_weights(path, eye.state_dict(), about)


def load_eye(path) -> nn.Module:
    """Read an eye that `save_eye` wrote."""
    tensors, about = artefacts.load_weights(path)
    if about.get("kind") not in EYES | WITHOUT_NETWORK:
        raise ArtefactError(f"{path} holds no CAE but {about.get('kind')!r}")
    with artefacts.fits_itself(path):
        eye = make_eye(about["kind"], about["code"])
        eye.load_state_dict(tensors)
    return eye.eval()

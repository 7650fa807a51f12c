"""Features of camera images, made by an image encoder."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from ptae_lite.errors import ConfigError


def as_input(
    images: UInt8[np.ndarray, "B 120 160 3"], device: str = "cpu"
) -> Float[Tensor, "B 3 120 160"]:
    """Camera images as a network takes them: values 0 to 1, channels first.

    Only the order of the axes changes, not the order in memory. The three numbers of a pixel stay
    side by side, as the camera gives them; convolutions are faster on such images.

    Raises:
        ConfigError: the images are not (B, 120, 160, 3) of uint8.
    """
    if images.ndim != 4 or images.shape[1:] != (120, 160, 3) or images.dtype != np.uint8:
        raise ConfigError(
            f"images are B x 120 x 160 x 3 bytes, not {images.shape} of {images.dtype}"
        )
    own = np.require(images, requirements="W")  # images that processes share are read-only: copy
    return torch.from_numpy(own).to(device).permute(0, 3, 1, 2).float().div_(255)


def as_images(values: Float[Tensor, "B 3 120 160"]) -> UInt8[np.ndarray, "B 120 160 3"]:
    """Values 0 to 1 of a decoder as images: the way back from `as_input`."""
    return (255 * values.permute(0, 2, 3, 1).numpy()).round().astype(np.uint8)


@torch.no_grad()
def encode_images(encoder: nn.Module, images, batch: int = 100) -> Float[np.ndarray, "M F"]:
    """Features of images: an array (M, 120, 160, 3) of bytes, or `frames.Images`."""
    codes = None
    for i in range(0, len(images), batch):
        part = encoder.encode(as_input(images[i : i + batch]))
        if codes is None:  # one array: many small ones between images would keep memory in use
            codes = np.empty((len(images), part.shape[1]), np.float32)
        codes[i : i + batch] = part.numpy()
    return codes


def encode_recording(
    encoder: nn.Module, folder, progress=lambda samples: samples
) -> Float[np.ndarray, "M F"]:
    """Features of every frame of a recording, sample after sample.

    They are written into one array. Many small arrays, made between images that come and go, would
    keep the memory around them in use (20 GB at the end).

    Raises:
        RecordingError: a sequence is missing or damaged.
    """
    from ptae_lite.language import pattern
    from ptae_lite.robot.recorder import load_sequence, samples_in_order

    samples = samples_in_order()
    ends = np.cumsum([pattern(index).frames for index, _ in samples])
    size = encode_images(encoder, np.zeros((1, 120, 160, 3), np.uint8)).shape[1]
    codes = np.empty((ends[-1], size), np.float32)
    for sample, part in zip(progress(samples), np.split(codes, ends[:-1]), strict=True):
        part[:] = encode_images(encoder, load_sequence(folder, *sample).images)
    return codes

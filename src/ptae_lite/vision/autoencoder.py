"""Convolutional autoencoders (CAE), which turn an image into a few numbers.

`ChannelSeparatedCAE` is the paper's encoder: one network each for red, green and blue, 10 features
each, so F = 30 (paper, section 3.1; the layers are those of the published code). `PlainCAE` sees
the three channels together. The five fully connected layers have no activation, as published.
"""

from __future__ import annotations

from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor, nn

CODE = 10  # features a channel


_relu = partial(nn.ReLU, inplace=True)  # saves a pass through memory


class CAE(nn.Module):
    """Encoder and decoder for images of `channels` channels (C), with `code` numbers between them.

    The layers are those of the published code. With one channel and ten numbers there are 664,891
    parameters.
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
        """Features of images with values 0 to 1."""
        return self.encoder(images)

    def decode(self, features: Float[Tensor, "B F"]) -> Float[Tensor, "B C 120 160"]:
        """Images with values 0 to 1, made from features."""
        return self.decoder(features)

    def forward(self, images):
        """The reconstruction of `images`, values 0 to 1."""
        return self.decode(self.encode(images))

    def logits(self, images):
        """The reconstruction before the last layer, the sigmoid."""
        return self.decoder[:-1](self.encode(images))


class PlainCAE(CAE):
    """One network for the three colour channels together: 10 features as published, or more."""

    kind = "plain"

    def __init__(self, code: int = CODE):
        super().__init__(3, code)


class ChannelSeparatedCAE(nn.Module):
    """One network for each colour channel. Their codes stand side by side, so F = 3 x `code`."""

    kind = "separated"

    def __init__(self, code: int = CODE):
        super().__init__()
        self.code = code
        self.red, self.green, self.blue = (CAE(1, code) for _ in range(3))

    def _channels(self):
        return (self.red, self.green, self.blue)

    def encode(self, images: Float[Tensor, "B 3 120 160"]) -> Float[Tensor, "B F"]:
        """Features of images with values 0 to 1: those of red, then green, then blue."""
        parts = zip(self._channels(), images.split(1, dim=1), strict=True)
        return torch.cat([cae.encode(channel) for cae, channel in parts], dim=1)

    def decode(self, features: Float[Tensor, "B F"]) -> Float[Tensor, "B 3 120 160"]:
        """Images with values 0 to 1, made from features."""
        parts = zip(self._channels(), features.split(self.code, dim=1), strict=True)
        return torch.cat([cae.decode(code) for cae, code in parts], dim=1)

    def forward(self, images):
        """The reconstruction of `images`, values 0 to 1."""
        return self.decode(self.encode(images))

    def logits(self, images):
        """The reconstruction before the last layer, the sigmoid."""
        parts = zip(self._channels(), images.split(1, dim=1), strict=True)
        return torch.cat([cae.logits(channel) for cae, channel in parts], dim=1)

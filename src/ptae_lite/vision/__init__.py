"""Image encoders: autoencoders and PCA, their training, and tests of what their features hold."""

from ptae_lite.vision.autoencoder import CAE, ChannelSeparatedCAE, PlainCAE
from ptae_lite.vision.checkpoint import (
    ENCODERS,
    load_autoencoder,
    make_autoencoder,
    save_autoencoder,
)
from ptae_lite.vision.features import as_images, as_input, encode_images, encode_recording
from ptae_lite.vision.training import (
    DECAY,
    AutoencoderRecipe,
    AutoencoderTrainer,
    PixelCrossEntropy,
    rate_share,
    train_autoencoder,
)

__all__ = [
    "CAE",
    "DECAY",
    "ENCODERS",
    "ChannelSeparatedCAE",
    "AutoencoderRecipe",
    "AutoencoderTrainer",
    "PixelCrossEntropy",
    "PlainCAE",
    "as_images",
    "as_input",
    "encode_images",
    "encode_recording",
    "load_autoencoder",
    "make_autoencoder",
    "rate_share",
    "save_autoencoder",
    "train_autoencoder",
]

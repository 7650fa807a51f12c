"""From an image to a few numbers: autoencoders, PCA, their training, and what they hold."""

from ptae_lite.vision.autoencoder import CAE, ChannelSeparatedCAE, PlainCAE
from ptae_lite.vision.checkpoint import EYES, load_eye, make_eye, save_eye
from ptae_lite.vision.features import as_input, encode_images, encode_recording
from ptae_lite.vision.training import (
    DECAY,
    EyeRecipe,
    EyeTraining,
    PixelCrossEntropy,
    rate_share,
    train_eye,
)

__all__ = [
    "CAE",
    "DECAY",
    "EYES",
    "ChannelSeparatedCAE",
    "EyeRecipe",
    "EyeTraining",
    "PixelCrossEntropy",
    "PlainCAE",
    "as_input",
    "encode_images",
    "encode_recording",
    "load_eye",
    "make_eye",
    "rate_share",
    "save_eye",
    "train_eye",
]

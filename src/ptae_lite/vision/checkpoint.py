"""The kinds of image encoders, and one file for each that was trained."""

from __future__ import annotations

from dataclasses import asdict

from torch import nn

from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.vision import pca
from ptae_lite.vision.autoencoder import CODE, ChannelSeparatedCAE, PlainCAE
from ptae_lite.vision.training import EyeRecipe

EYES = {"separated": ChannelSeparatedCAE, "plain": PlainCAE}
WITHOUT_NETWORK = {eye.kind: eye for eye in (pca.JointPCA, pca.ChannelPCA)}


def make_eye(kind: str, code: int = CODE) -> nn.Module:
    """A fresh eye of a kind in `EYES` or `WITHOUT_NETWORK`."""
    kinds = EYES | WITHOUT_NETWORK
    if kind not in kinds:
        raise ConfigError(f"no eye {kind!r}; there are {', '.join(kinds)}")
    return kinds[kind](code)


def save_eye(
    path, eye: nn.Module, recipe: EyeRecipe | None = None, device: str = "cpu", **more
) -> None:
    """Write an eye with its kind, where it was trained and, of a CAE, its recipe into one file.

    `more` is kept beside these, such as the `experiment` that it is of.
    """
    about = {"kind": eye.kind, "code": eye.code, "recipe": asdict(recipe) if recipe else None}
    about |= {"device": device} | more
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

"""The kinds of image encoders, and how a trained one is written to and read from a file."""

from __future__ import annotations

from dataclasses import asdict

from torch import nn

from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.vision import pca
from ptae_lite.vision.autoencoder import CODE, ChannelSeparatedCAE, PlainCAE

ENCODERS = {"separated": ChannelSeparatedCAE, "plain": PlainCAE}
WITHOUT_NETWORK = {encoder.kind: encoder for encoder in (pca.JointPCA, pca.ChannelPCA)}


def make_autoencoder(kind: str, code: int = CODE) -> nn.Module:
    """A new encoder of a kind in `ENCODERS` or `WITHOUT_NETWORK`, with `code` numbers a network.

    Raises:
        ConfigError: there is no such kind.
    """
    kinds = ENCODERS | WITHOUT_NETWORK
    if kind not in kinds:
        raise ConfigError(f"no encoder {kind!r}; there are {', '.join(kinds)}")
    return kinds[kind](code)


def save_autoencoder(path, encoder: nn.Module, recipe=None, device: str = "cpu", **more) -> None:
    """Write an encoder to one file, with its kind and how it was trained.

    Args:
        recipe: a dataclass that says how.
        device: where it was trained.
        more: further entries to store, such as `experiment`.
    """
    about = {
        "kind": encoder.kind,
        "code": encoder.code,
        "recipe": asdict(recipe) if recipe else None,
    }
    about |= {"device": device} | more
    artefacts.save_weights(path, encoder.state_dict(), about)


def load_autoencoder(path) -> nn.Module:
    """Read an encoder that `save_autoencoder` wrote.

    Raises:
        ArtefactError: the file is missing, is damaged, or holds no encoder.
    """
    tensors, about = artefacts.load_weights(path)
    if about.get("kind") not in ENCODERS | WITHOUT_NETWORK:
        raise ArtefactError(f"{path} holds no CAE but {about.get('kind')!r}")
    with artefacts.fits_itself(path):
        encoder = make_autoencoder(about["kind"], about["code"])
        encoder.load_state_dict(tensors)
    return encoder.eval()

"""Where arithmetic is done: the CPU, or a GPU if there is one and it is asked for."""

from __future__ import annotations

import torch

from ptae_lite.errors import ConfigError


def check(device: str) -> None:
    """Raise `ConfigError` where a device cannot be used here."""
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise ConfigError(
            f"device {device!r} cannot be used here, or PyTorch was built without it; "
            "train without --device to use the CPU"
        ) from None


def choose(wanted: str) -> str:
    """`auto` is a GPU where there is one. Scores may differ in their last digits, no more."""
    return ("cuda" if torch.cuda.is_available() else "cpu") if wanted == "auto" else wanted

"""An unfinished training in a file, so that one that was stopped goes on to the same weights."""

from __future__ import annotations

import json
import time
from pathlib import Path

import torch

from ptae_lite import artefacts
from ptae_lite.errors import ArtefactError

EVERY_S = 600  # between two savings


class Unfinished:
    """Keeps what a training needs to go on: weights, optimiser, schedule and random generators.

    Args:
        path: the file, which is written whole or not at all. Nothing is kept if None.
        training: what is trained and how, as JSON can hold it; a state of another is refused.
    """

    def __init__(self, path, training: dict):
        self.path = None if path is None else Path(path)
        self.training = json.loads(json.dumps(training))
        self.saved = time.monotonic()

    def save(self, done: int, network, optimiser, record: dict, rng=None) -> None:
        """Write the state, unless it was written within `EVERY_S`.

        Args:
            done: epochs, or steps, that are done.
            record: of them, as JSON can hold it.
            rng: NumPy's generator; None if the training draws from no lasting one.
        """
        if self.path is None or time.monotonic() < self.saved + EVERY_S:
            return
        tensors, plain = _taken_apart(optimiser.state_dict())
        tensors = {f"optimiser.{name}": tensor for name, tensor in tensors.items()}
        tensors |= {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
        tensors["torch"] = torch.get_rng_state()
        if torch.cuda.is_available():
            tensors["cuda"] = torch.cuda.get_rng_state()
        artefacts.save_weights(self.path, tensors, {
            "training": self.training, "done": done, "optimiser": plain, "record": record,
            "numpy": None if rng is None else rng.bit_generator.state,
        })  # fmt: skip
        self.saved = time.monotonic()

    def load(self, network, optimiser, rng=None) -> tuple[int, dict]:
        """Go back to the saved state; what is done, and the record of it.

        Raises:
            ArtefactError: the file is of another training, or of none.
        """
        if self.path is None or not self.path.exists():
            return 0, {}
        tensors, about = artefacts.load_weights(self.path)
        if about.get("training") != self.training or "done" not in about:
            raise ArtefactError(
                f"{self.path} is the state of another training; move it away to begin anew"
            )
        parts: dict = {"optimiser": {}, "model": {}}
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            if rest:
                parts[part][rest] = tensor
        network.load_state_dict(parts["model"])
        optimiser.load_state_dict(_put_together(parts["optimiser"], about["optimiser"]))
        if rng is not None:
            rng.bit_generator.state = about["numpy"]
        torch.set_rng_state(tensors["torch"])
        if "cuda" in tensors and torch.cuda.is_available():
            torch.cuda.set_rng_state(tensors["cuda"])
        return about["done"], about["record"]


def _taken_apart(state, name: str = "") -> tuple[dict, object]:
    """Nested dicts and lists without their tensors, which come by the place where they stood."""
    if isinstance(state, torch.Tensor):
        return {name: state}, {"tensor": name}
    if isinstance(state, dict):
        parts = {key: _taken_apart(one, f"{name}/{key}") for key, one in state.items()}
        tensors = {k: v for found, _ in parts.values() for k, v in found.items()}
        return tensors, {"dict": [[key, plain] for key, (_, plain) in parts.items()]}
    if isinstance(state, (list, tuple)):
        parts = [_taken_apart(one, f"{name}/{i}") for i, one in enumerate(state)]
        return {k: v for found, _ in parts for k, v in found.items()}, [plain for _, plain in parts]
    return {}, state


def _put_together(tensors: dict, plain):
    """What `_taken_apart` took apart. Keys that are numbers stay numbers; tuples become lists."""
    if isinstance(plain, list):
        return [_put_together(tensors, one) for one in plain]
    if isinstance(plain, dict):
        if "tensor" in plain:
            return tensors[plain["tensor"]]
        return {key: _put_together(tensors, one) for key, one in plain["dict"]}
    return plain

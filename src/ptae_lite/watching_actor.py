"""A watching policy that acts in the closed loop, and afterwards says what it did."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ptae_lite.acting import Actor
from ptae_lite.errors import ConfigError
from ptae_lite.language import ACTIONS, SIDES, SPEEDS, decode, encode, signal_index
from ptae_lite.models import kinematics
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import inverse
from ptae_lite.vision import encode_images


class WatchingActor:
    """A policy that executes a sentence and watches. Use a new one for each episode.

    Call it with the camera and the measured joints (5,) in radians; it returns the next target of
    the joints. A wish that is out of reach becomes the last place in reach on the way to it.

    Args:
        encoder: the image encoder that the model was trained with.
        sentence: a whole sentence.
        frozen: show it the first image at every frame, as a control.

    Attributes:
        looks: scaled features of the images seen so far, (1, F) each.
        poses: scaled joints measured so far, (1, 5) each.

    Raises:
        ConfigError: the model is not a watching policy, or takes other features.
        LanguageError: the sentence is wrong.
    """

    def __init__(self, trained: Trained, encoder: nn.Module, sentence: str, frozen: bool = False):
        if trained.model.kind != "watcher":
            raise ConfigError(
                f"this is a {trained.model.kind.upper()}, not a policy that watches; let it act "
                "with acting.Actor"
            )
        self.trained, self.encoder, self.frozen = trained, encoder, frozen
        self.tokens = torch.tensor([[signal_index("execute"), *encode(sentence)]])
        self.looks: list[Tensor] = []
        self.poses: list[Tensor] = []
        self.memory = None

    @torch.no_grad()
    def __call__(self, look, joints_rad) -> np.ndarray:
        model, scaling = self.trained.model, self.trained.scaling
        joints_rad = np.asarray(joints_rad, dtype=float)
        if not (self.looks and model.config.blind):
            features = encode_images(self.encoder, look()[None])[0]
            if len(features) != model.config.ptae.features:
                raise ConfigError(
                    f"this encoder makes {len(features)} features of an image, and the model was "
                    f"trained on {model.config.ptae.features}; load the encoder that it was "
                    "trained with"
                )
            self.looks.append(_row(scaling.features(features)))
        self.poses.append(_row(scaling.joints(joints_rad)))
        first = self.looks[0]
        if len(self.poses) == 1:
            self.numbers = model.understand(model.code_of_sentence(self.tokens), first)
        now = first if self.frozen else self.looks[-1]
        hand = kinematics.fingertip(_row(joints_rad))
        read = model.read(self.numbers, now[:, None])
        wish, _, self.memory = model.follow(self.numbers, read, hand[:, None], self.memory)
        return inverse.towards(wish[0, 0].numpy().astype(float), joints_rad)

    @property
    def task(self) -> tuple[str, str, str]:
        """The side, the action and the speed that it understood."""
        side, action, speed = self.numbers[0].tolist()
        return SIDES[side], ACTIONS[action], SPEEDS[speed]

    @torch.no_grad()
    def describe(self) -> str:
        """What it saw itself do, as a sentence: from the frames so far and their number."""
        model, keys = self.trained.model, [torch.cat(pair, 1) for pair in self._seen()]
        code = model.watch(torch.stack(keys, dim=1))
        words = model.tell(code, torch.tensor([float(len(keys))]), self.looks[0])
        return decode(words[0].argmax(1).tolist())

    def _seen(self):
        return zip(self.looks, self.poses, strict=True)


def actor_of(trained: Trained, encoder: nn.Module, sentence: str) -> WatchingActor | Actor:
    """A policy that executes a sentence, with a model that watches or with a PTAE."""
    kind = WatchingActor if trained.model.kind == "watcher" else Actor
    return kind(trained, encoder, sentence)


def _row(numbers) -> Tensor:
    return torch.from_numpy(np.asarray(numbers, dtype=np.float32))[None]

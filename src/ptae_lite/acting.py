"""A PTAE that acts in the closed loop: it gets a sentence, and images of what its actions did."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ptae_lite.data.samples import MAX_FRAMES
from ptae_lite.data.signals import STEPS, TOKENS_IN, WORDS_OUT, Batch
from ptae_lite.errors import ConfigError
from ptae_lite.language import EOS, encode, signal_index
from ptae_lite.models.checkpoint import Trained
from ptae_lite.vision import encode_images


class Actor:
    """A policy that executes a sentence with a PTAE. Use a new one for each episode.

    Call it with the camera and the measured joints (5,) in radians; it returns the next target of
    the joints. The code is made once, from the sentence and the first image. The actor does not
    know the clip's length, so the first frame fills all 100 places of the keys.

    Args:
        encoder: the image encoder that the model was trained with.
        sentence: a whole sentence; None for EOS in all places.
        watch: encode every image, also if the model uses only the first.

    Raises:
        ConfigError: the model is not a PTAE, or takes other features than this encoder makes.
        LanguageError: the sentence is wrong.
    """

    def __init__(self, trained: Trained, encoder: nn.Module, sentence: str | None, watch=False):
        if trained.model.kind != "ptae":
            raise ConfigError(
                f"only a PTAE can act in the loop, and this is a {trained.model.kind.upper()}; "
                "train one with: python -m ptae_lite train ptae"
            )
        self.trained, self.encoder = trained, encoder
        self.watch = watch or not trained.model.config.freeze_video
        tokens = [signal_index("execute"), *(encode(sentence) if sentence else [EOS] * 5)]
        self.tokens = torch.tensor([tokens])
        self.states: list | None = None
        self.looks: list[np.ndarray] = []  # raw features of the images seen so far

    @torch.no_grad()
    def __call__(self, look, joints_rad) -> np.ndarray:
        model, scaling = self.trained.model, self.trained.scaling
        if self.watch or not self.looks:
            self.looks.append(encode_images(self.encoder, look()[None])[0])
        if len(self.looks[-1]) != model.config.features:
            raise ConfigError(
                f"this encoder makes {len(self.looks[-1])} features of an image, and the model was "
                f"trained on {model.config.features}; load the encoder that it was trained with"
            )
        seen = _row(scaling.features(self.looks[-1]))
        pose = _row(scaling.joints(np.asarray(joints_rad, dtype=np.float32)))
        if self.states is None:
            self.first = seen
            self.code = self._listen(torch.cat([seen, pose], dim=1))
            self.states = model.action.first_state(self.code)
        shown = seen if not model.config.freeze_video else self.first
        pose, self.states = model.action.move(self.code, shown, pose, self.states)
        return scaling.joints_back(pose[0].numpy().astype(float))

    def _listen(self, first: Tensor) -> Tensor:
        """The code of the sentence and the first frame."""
        keys = first[:, None].expand(-1, MAX_FRAMES, -1)
        features = keys[..., : self.trained.model.config.features]
        none = torch.zeros(1, WORDS_OUT, dtype=torch.long)
        batch = Batch(
            tokens=self.tokens, token_mask=torch.ones(1, TOKENS_IN, dtype=torch.bool),
            frames=torch.tensor([MAX_FRAMES]), keys=keys, video=features[:, :STEPS],
            start=first[:, features.shape[2]:], words=none, word_mask=none > 0,
            joints=keys[:, :STEPS, features.shape[2]:],
            step_mask=torch.ones(1, STEPS, dtype=torch.bool),
        )  # fmt: skip
        return self.trained.model.encode(batch)[0]


def _row(numbers) -> Tensor:
    return torch.from_numpy(np.asarray(numbers, dtype=np.float32))[None]

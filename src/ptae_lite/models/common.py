"""What all models share: the protocol they keep to, their answers, losses, a check of sizes."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from ptae_lite.data.signals import Batch, Mix, MixupBatch
from ptae_lite.errors import ConfigError
from ptae_lite.language import VOCABULARY, WORD_INDEX, Meaning, words_of


class Answer(NamedTuple):
    """What a model says and does. A model without attention has no heads."""

    words: Float[Tensor, "B 4 V"]  # logarithms of probabilities
    joints: Float[Tensor, "B 99 5"]
    code: Float[Tensor, "B H"]
    attention: Float[Tensor, "B heads N T"]


class Config(Protocol):
    """What every model's configuration has: a frozen dataclass of sizes and choices."""

    features: int  # visual features a frame
    joints: int

    @property
    def mix(self) -> Mix:
        """The signals that the model is trained on."""


class Model(Protocol):
    """What training, evaluation and storing ask of a model, an `nn.Module` made from its `Config`.

    `models.registry` lists the models that keep to this.
    """

    kind: str  # its name in the registry
    config: Config
    action: nn.Module  # the action decoder; it has a learning rate of its own

    def __call__(self, batch: Batch) -> Answer:
        """The answer to each sample of a batch, at every step."""

    def loss(self, batch: Batch, paired: Bool[Tensor, " B"] | None = None) -> tuple[Tensor, ...]:
        """Losses to minimise: language, action, and any further ones, a number each.

        Args:
            paired: samples with a label, whose sentence and clip are known to belong together.
        """


def losses(
    answer: Answer, batch: Batch, word_weights: Float[Tensor, " V"] | None = None
) -> tuple[Tensor, Tensor]:
    """Language and action loss with the published code's masks and averages.

    Language: cross-entropy, averaged over each sample's own steps (4, or 1 where only EOS is asked
    for), then over the batch. Action: squared error averaged over all B x 99 x 5 entries, padded
    ones (where both are zero) included, so a fast clip counts half.

    Args:
        word_weights: what each word's cross-entropy is multiplied by where it is the one asked for.
    """

    def said(words: Tensor) -> Tensor:
        chosen = answer.words.gather(2, words[..., None])[..., 0]
        return chosen if word_weights is None else chosen * word_weights[words]

    chosen = said(batch.words)
    if isinstance(batch, MixupBatch):
        chosen = torch.lerp(said(batch.other_words), chosen, batch.share[:, None])
    steps = batch.word_mask.to(chosen.dtype)
    language = (-(chosen * steps).sum(1) / steps.sum(1)).mean()
    error = answer.joints * batch.step_mask[..., None] - batch.joints
    return language, error.square().mean()


def class_weights(weigh: bool) -> Float[Tensor, " V"]:
    """A weight for each word: the size of its class (EOS 1, speed 4, action 6, colour 12), or 1.

    The weights of all 23 words add up to 23. A word of a large class is harder to guess.
    """
    weights = torch.ones(len(VOCABULARY))
    if not weigh:
        return weights
    for kind in Meaning._fields:
        words = [WORD_INDEX[word] for word in words_of(kind)]
        weights[words] = float(len(words))
    return weights * len(weights) / weights.sum()


def check_sizes(config, *names: str) -> None:
    """Raise `ConfigError` naming the first of these fields that is below 1."""
    for name in names:
        if getattr(config, name) < 1:
            raise ConfigError(f"{name} is {getattr(config, name)}; it must be 1 or more")

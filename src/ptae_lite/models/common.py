"""What all models share: their interface, their answers and their losses."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from ptae_lite.data.signals import Batch, Mix, MixupBatch
from ptae_lite.errors import ConfigError
from ptae_lite.language import VOCABULARY, WORD_INDEX, Meaning, words_of


class Answer(NamedTuple):
    """What a model says and does.

    Args:
        words: logarithms of the word probabilities, 4 steps.
        joints: poses 2 to 100 in network units.
        code: what both decoders start from.
        attention: weights of each token for each frame. A model without attention has 0 heads.
    """

    words: Float[Tensor, "B 4 V"]
    joints: Float[Tensor, "B 99 5"]
    code: Float[Tensor, "B H"]
    attention: Float[Tensor, "B heads N T"]


class Config(Protocol):
    """What every model's configuration has: a frozen dataclass of sizes and choices.

    Attributes:
        features: visual features a frame, F.
        joints: joints, J.
    """

    features: int
    joints: int

    @property
    def mix(self) -> Mix:
        """The signals that the model is trained on."""


class Model(Protocol):
    """What training, evaluation and files need of a model: an `nn.Module` made from its `Config`.

    `models.registry` lists the models that have this interface.

    Attributes:
        kind: its name in the registry.
        config: its configuration.
        action: the action decoder, which has its own learning rate.
    """

    kind: str
    config: Config
    action: nn.Module

    def __call__(self, batch: Batch) -> Answer:
        """The answer to each sample of a batch, at every step."""

    def loss(self, batch: Batch, paired: Bool[Tensor, " B"] | None = None) -> tuple[Tensor, ...]:
        """The losses to minimise, one number each: language, action, and any others.

        Args:
            paired: samples with a label: the model may use that their sentence and clip belong
                together. None means all.
        """


def losses(
    answer: Answer, batch: Batch, word_weights: Float[Tensor, " V"] | None = None
) -> tuple[Tensor, Tensor]:
    """Language and action loss.

    Language: the cross-entropy of the words, averaged over the steps of a sample (4, or 1 if the
    target is EOS alone), then over the batch, as in the published code.

    Action: the squared error, averaged over all B x 99 x 5 entries. Both joints are zero in
    padding, and padding counts in the average, so a fast clip weighs half. This is the published
    code; the paper's text sums over joints and averages over the steps of the clip.

    A `MixupBatch` asks for both sentences: `share L(words) + (1 - share) L(other_words)`.

    Args:
        word_weights: a factor for the cross-entropy of each target word; None means 1.
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
    """A weight for each of the 23 words, as in the published PGAE; 1 each without `weigh`.

    The weight is proportional to the size of the word's class (EOS 1, speed 4, action 6, colour
    12), because a word of a large class is harder to guess. The weights add up to 23.
    """
    weights = torch.ones(len(VOCABULARY))
    if not weigh:
        return weights
    for kind in Meaning._fields:
        words = [WORD_INDEX[word] for word in words_of(kind)]
        weights[words] = float(len(words))
    return weights * len(weights) / weights.sum()


def check_sizes(config, *names: str) -> None:
    """Check that these fields of a configuration are 1 or more.

    Raises:
        ConfigError: one is not. The message names the first.
    """
    for name in names:
        if getattr(config, name) < 1:
            raise ConfigError(f"{name} is {getattr(config, name)}; it must be 1 or more")

"""PGAE, the paired gated autoencoders: PTAE's predecessor, and the model it is compared with.

    words + signal --LSTM--\\                      /--> language decoder --> words
                            gated unit --> code --
    video + joints --LSTM--/                      \\--> action decoder ----> joints
                                            video ------/

657,778 parameters at the published sizes. One code starts both decoders, in training and in the
test; in the published plain class the test uses a map that was never trained.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite.language import EOS, TOKENS, VOCABULARY, WORD_INDEX, Meaning, words_of
from ptae_lite.models.common import Answer, check_sizes, losses
from ptae_lite.models.decoders import ActionDecoder, LanguageDecoder
from ptae_lite.models.gated import GatedUnit
from ptae_lite.models.recurrent import RecurrentEncoder, spread
from ptae_lite.signals import SUPERVISED, UNSUPERVISED, WORDS_OUT, Batch, Mix


@dataclass(frozen=True)
class PGAEConfig:
    """Sizes of a PGAE. Each is the published code's unless its comment says otherwise."""

    features: int = 30  # 10 for each colour channel
    joints: int = 5
    code: int = 50
    units: int = 100
    layers: int = 2
    forget_bias: float = 0.8
    gain: float = 1.5  # ours, of the starting weights (`recurrent.spread`); 0: the published ones
    weigh_words: bool = True  # each word by the size of its class, see `class_weights`

    def __post_init__(self):
        check_sizes(self, "features", "joints", "code", "units", "layers")


def class_weights() -> Float[Tensor, " V"]:
    """A weight for each word: the size of its class (EOS 1, speed 4, action 6, colour 12).

    The weights of all 23 words add up to 23. A word of a large class is harder to guess.
    """
    weights = torch.zeros(len(VOCABULARY))
    weights[EOS] = 1
    for kind in Meaning._fields:
        words = [WORD_INDEX[word] for word in words_of(kind)]
        weights[words] = float(len(words))
    return weights * len(weights) / weights.sum()


class PGAE(nn.Module):
    """The model. It is told the task by the first query token alone, as PTAE is."""

    kind = "pgae"
    # Published: a third for the three repeat signals, a third each for describe and execute; where
    # few samples are labelled, repeat both is one of the three that need a label.
    mix = Mix(
        regular=(("repeat action", "repeat both", "repeat language"), SUPERVISED),
        limited=(UNSUPERVISED, (*SUPERVISED, "repeat both")),
    )

    def __init__(self, config: PGAEConfig = PGAEConfig()):
        super().__init__()
        self.config = c = config
        sizes = (c.units, c.layers, c.forget_bias)
        self.words_in = RecurrentEncoder(len(TOKENS), *sizes)
        self.clip_in = RecurrentEncoder(c.features + c.joints, *sizes)
        summary = c.layers * 2 * c.units
        self.fuse = GatedUnit(summary, summary, c.code)
        self.language = LanguageDecoder(c.code, *sizes, peepholes=True)
        self.action = ActionDecoder(c.features, c.joints, c.code, *sizes, peepholes=True)
        if c.gain:
            spread([self.words_in, self.clip_in, self.fuse, self.language], c.gain)
        weights = class_weights() if c.weigh_words else torch.ones(len(VOCABULARY))
        self.register_buffer("word_weights", weights, persistent=False)

    def forward(self, batch: Batch) -> Answer:
        words = functional.one_hot(batch.tokens, len(TOKENS)).to(batch.keys.dtype)
        said = self.words_in(words, batch.token_mask.sum(1))
        seen = self.clip_in(batch.keys, batch.step_mask.sum(1) + 1)
        code = self.fuse(seen, said)
        joints = self.action(code, batch.video, batch.start)
        no_heads = code.new_zeros(len(code), 0, words.shape[1], batch.keys.shape[1])
        return Answer(self.language(code, WORDS_OUT), joints, code, no_heads)

    def costs(self, batch: Batch) -> tuple[Tensor, ...]:
        """Language and action loss, as training minimises them; words weighed by class."""
        return losses(self(batch), batch, self.word_weights)

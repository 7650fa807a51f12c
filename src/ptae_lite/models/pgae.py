r"""PGAE, the paired gated autoencoders: the model before PTAE, with which the paper compares it.

::

    words + signal --LSTM--\                      /--> language decoder --> words
                            gated unit --> code --
    video + joints --LSTM--/                      \--> action decoder ----> joints
                                            video ------/

It has 657,778 parameters at the published sizes. One code starts both decoders, in training and in
the test. (In the published class `PGAE`, the test uses a map that was never trained.)
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite.data.signals import MIX_WITH_BOTH, PTAE_MIX, WORDS_OUT, Batch, Mix
from ptae_lite.language import TOKENS
from ptae_lite.models import fast
from ptae_lite.models.common import Answer, check_sizes, class_weights, losses
from ptae_lite.models.decoders import ActionDecoder, LanguageDecoder
from ptae_lite.models.recurrent import RecurrentEncoder, spread


@dataclass(frozen=True)
class PGAEConfig:
    """Sizes of a PGAE. Each value is the published code's unless its comment says otherwise.

    Raises:
        ConfigError: a size is less than 1.
    """

    features: int = 30  # 10 for each colour channel
    joints: int = 5
    code: int = 50
    units: int = 100
    layers: int = 2
    forget_bias: float = 0.8
    gain: float = 1.5  # ours, of the starting weights (`recurrent.spread`); 0: the published ones
    weigh_words: bool = True  # each word by the size of its class, see `class_weights`
    repeat_both: bool = True

    def __post_init__(self):
        check_sizes(self, "features", "joints", "code", "units", "layers")

    @property
    def mix(self) -> Mix:
        """The signals that it is trained on."""
        return MIX_WITH_BOTH if self.repeat_both else PTAE_MIX


class GatedUnit(nn.Module):
    """The gated multimodal unit: one code from the summaries of action and language.

    ::

        code = z * tanh(A a + b_a) + (1 - z) * tanh(L l + b_l),    z = sigmoid(G [a, l] + b_g)

    Args:
        action: length of the action's summary a.
        language: length of the language's summary l.
        size: length H of the code.
    """

    def __init__(self, action: int, language: int, size: int):
        super().__init__()
        self.action = nn.Linear(action, size)
        self.language = nn.Linear(language, size)
        self.gate = nn.Linear(action + language, size)

    def forward(
        self, action: Float[Tensor, "B A"], language: Float[Tensor, "B L"]
    ) -> Float[Tensor, "B H"]:
        """The code of two summaries."""
        gate = torch.sigmoid(self.gate(torch.cat([action, language], dim=1)))
        return gate * torch.tanh(self.action(action)) + (1 - gate) * torch.tanh(
            self.language(language)
        )


class PGAE(nn.Module):
    """The model. The first query token, the signal, says which task it is, as in PTAE."""

    kind = "pgae"

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
        self.register_buffer("word_weights", class_weights(c.weigh_words), persistent=False)

    def forward(self, batch: Batch) -> Answer:
        """The answer to a batch: log-probabilities of the words, and joints, at every step."""
        words, lengths = self._words(batch)
        said, seen = self.words_in(words, lengths), self.clip_in(batch.keys, batch.frames)
        code = self.fuse(seen, said)
        return self._answer(batch, code, self.action(code, batch.video, batch.start))

    def forward_fast(self, batch: Batch) -> Answer:
        """The answer of `forward`, computed faster for training (see `fast`)."""
        words, lengths = self._words(batch)
        said = fast.encode_fast(self.words_in, words, lengths)
        seen = fast.encode_fast(self.clip_in, batch.keys, batch.frames)
        code = self.fuse(seen, said)
        return self._answer(batch, code, fast.decode_fast(self.action, code, batch))

    def _words(self, batch: Batch) -> tuple[Float[Tensor, "B N W"], Int[Tensor, " B"]]:
        """The query tokens as one-hot rows, and their number."""
        words = functional.one_hot(batch.tokens, len(TOKENS)).to(batch.keys.dtype)
        return words, batch.token_mask.sum(1)

    def _answer(self, batch: Batch, code: Tensor, joints: Tensor) -> Answer:
        no_heads = code.new_zeros(len(code), 0, batch.tokens.shape[1], batch.keys.shape[1])
        return Answer(self.language(code, WORDS_OUT), joints, code, no_heads)

    def loss(self, batch: Batch, paired=None) -> tuple[Tensor, ...]:
        """Language loss (with word weights) and action loss. `paired` is not used."""
        return losses(self.forward_fast(batch), batch, self.word_weights)

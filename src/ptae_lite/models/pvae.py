"""PVAE, the paired variational autoencoders: two models whose codes are bound to each other.

::

    words <-- language decoder <-- code <-- LSTM <-- words, last one first
                                     |
                                  binding
                                     |
    joints <-- action decoder <--- code <-- LSTM <-- video + joints, last frame first
      video ------/

Each half learns to repeat its own input. The binding loss brings the two codes of a pair together,
so that each decoder can use the code of the other half. PVAE has no signal words; here the signal
only says which code each decoder gets. It has 464,228 parameters at the published sizes.

PRAE is the same without random codes: 434,128 parameters. The published count is 436,128, because
its encoder expects the five signals too; it fails on sentences without them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ptae_lite.data.signals import WORDS_OUT, Batch, Mix
from ptae_lite.errors import ConfigError
from ptae_lite.language import VOCABULARY, signal_index
from ptae_lite.models import fast
from ptae_lite.models.common import Answer, check_sizes, losses
from ptae_lite.models.decoders import ActionDecoder, LanguageDecoder
from ptae_lite.models.recurrent import RecurrentEncoder, reverse, spread

BY_ACTION = ("describe", "repeat action")  # the action's code starts both decoders
BY_LANGUAGE = ("execute", "repeat language")


@dataclass(frozen=True)
class PVAEConfig:
    """Sizes of a PVAE. Each value is the published code's unless its comment says otherwise.

    Raises:
        ConfigError: a size is less than 1, or a weight is negative.
    """

    features: int = 30  # 10 for each colour channel
    joints: int = 5
    code: int = 50  # of each half
    units: int = 100
    language_layers: int = 1
    action_layers: int = 2
    forget_bias: float = 0.8  # ours; PGAE's
    gain: float = 1.5  # ours, of the starting weights (`recurrent.spread`); 0: the published ones
    noise: float = 0.1  # of a code in training, times its own standard deviation
    binding: float = 2.0  # weight of the binding loss
    margin: float = 1.0  # unpaired codes should be further apart than paired ones by this
    divergence: float = 1.0  # weight of each half's divergence from a standard normal
    variational: bool = True  # without: PRAE

    def __post_init__(self):
        sizes = ("features", "joints", "code", "units", "language_layers", "action_layers")
        check_sizes(self, *sizes)
        for name in ("gain", "noise", "binding", "margin", "divergence"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} is {getattr(self, name)}; it must be 0 or more")

    @property
    def mix(self) -> Mix:
        """The signals that it is trained on. Both halves repeat their input."""
        both = (("repeat both",), ("repeat both",))
        return Mix(regular=both, limited=both)


@dataclass(frozen=True)
class PRAEConfig(PVAEConfig):
    """Sizes of a PRAE: a PVAE without random codes."""

    variational: bool = False


class Code(NamedTuple):
    """The code of one half: its mean and its log-variance (None in PRAE)."""

    mean: Float[Tensor, "B H"]
    log_variance: Float[Tensor, "B H"] | None


class Half(nn.Module):
    """The encoder of one modality, which reads backwards, and the linear maps to its code."""

    def __init__(self, inputs: int, layers: int, config: PVAEConfig):
        super().__init__()
        self.encoder = RecurrentEncoder(inputs, config.units, layers, config.forget_bias)
        summary = layers * 2 * config.units
        self.mean = nn.Linear(summary, config.code)
        self.log_variance = nn.Linear(summary, config.code) if config.variational else None

    def forward(self, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]) -> Code:
        """The code of sequences with `lengths` rows."""
        return self._code(self.encoder(reverse(rows, lengths), lengths))

    def forward_fast(self, rows: Float[Tensor, "B T I"], lengths: Int[Tensor, " B"]) -> Code:
        """The same as `forward`, computed faster for training (see `fast`)."""
        return self._code(fast.encode_fast(self.encoder, reverse(rows, lengths), lengths))

    def _code(self, summary: Float[Tensor, "B S"]) -> Code:
        log_variance = self.log_variance(summary) if self.log_variance else None
        return Code(self.mean(summary), log_variance)


def binding(first: Float[Tensor, "B H"], second: Float[Tensor, "B H"], margin: float) -> Tensor:
    """The binding loss: paired codes close, all others further apart by a margin.

    ::

        mean_i d_ii + mean_ij max(0, d_ii - d_ij + margin) + mean_ij max(0, d_ii - d_ji + margin)

    Here `d_ij` is the Euclidean distance between `first[i]` and `second[j]`; `first[i]` and
    `second[i]` are a pair. As published, i = j adds nothing but counts in the means, and codes of
    the same sentence are pushed apart like all others.
    """
    apart = torch.cdist(first, second, compute_mode="donot_use_mm_for_euclid_dist")
    paired = apart.diagonal()
    others = 1 - torch.eye(len(apart), dtype=apart.dtype, device=apart.device)
    hinges = (
        (functional.relu(paired[:, None] - gap + margin) * others).mean()
        for gap in (apart, apart.T)
    )
    return paired.mean() + sum(hinges)


def divergence(code: Code) -> Tensor:
    """Kullback-Leibler divergence of a code from a standard normal, averaged over B x H.

    With `v` the log-variance::

        mean of 0.5 (mean^2 + exp(v) - 1 - v)

    We do not know whether the published code averages or sums over H. The average is ours.
    """
    mean, log_variance = code
    return 0.5 * (mean.square() + log_variance.exp() - 1 - log_variance).mean()


class PVAE(nn.Module):
    """The model; a PRAE if the configuration is not `variational`."""

    def __init__(self, config: PVAEConfig = PVAEConfig()):
        super().__init__()
        self.config = c = config
        self.kind = "pvae" if c.variational else "prae"
        self.words_in = Half(len(VOCABULARY), c.language_layers, c)
        self.clip_in = Half(c.features + c.joints, c.action_layers, c)
        sizes = (c.units, c.language_layers, c.forget_bias)
        self.language = LanguageDecoder(c.code, *sizes, peepholes=True)
        sizes = (c.units, c.action_layers, c.forget_bias)
        self.action = ActionDecoder(c.features, c.joints, c.code, *sizes, peepholes=True)
        if c.gain:
            spread([self.words_in, self.clip_in, self.language], c.gain)

    def encode(self, batch: Batch) -> tuple[Code, Code]:
        """The codes of the sentence (without the signal) and of the clip."""
        return self.words_in(*self._words(batch)), self.clip_in(batch.keys, batch.frames)

    def _words(self, batch: Batch) -> tuple[Float[Tensor, "B N V"], Int[Tensor, " B"]]:
        """The sentences as one-hot rows, and their lengths."""
        words = functional.one_hot(batch.tokens[:, 1:], len(VOCABULARY)).to(batch.keys.dtype)
        return words, batch.token_mask.sum(1) - 1

    def decode(self, batch: Batch, to_say, to_do, joints: Tensor) -> Answer:
        """The answer from a code (B, H) for each decoder. Its `code` is both, side by side."""
        no_heads = to_do.new_zeros(len(to_do), 0, batch.tokens.shape[1], batch.keys.shape[1])
        both = torch.cat([to_say, to_do], dim=1)
        return Answer(self.language(to_say, WORDS_OUT), joints, both, no_heads)

    def forward(self, batch: Batch) -> Answer:
        """The answer, from the mean codes. With `repeat both` each half decodes its own code."""
        said, done = (code.mean for code in self.encode(batch))
        by_action, by_language = (
            sum(batch.tokens[:, :1] == signal_index(s) for s in signals).bool()
            for signals in (BY_ACTION, BY_LANGUAGE)
        )
        to_say, to_do = torch.where(by_action, done, said), torch.where(by_language, said, done)
        return self.decode(batch, to_say, to_do, self.action(to_do, batch.video, batch.start))

    def loss(self, batch: Batch, paired: Bool[Tensor, " B"] | None = None) -> tuple[Tensor, ...]:
        """Language and action loss of repeating both halves, and the binding loss.

        In a PVAE the third loss also has the divergence of all codes.

        Args:
            paired: the samples whose two codes are bound; None means all. Nothing else connects a
                clip with its sentence.
        """
        c = self.config
        said = self.words_in.forward_fast(*self._words(batch))
        codes = said, self.clip_in.forward_fast(batch.keys, batch.frames)
        to_say, to_do = (self.draw(code) for code in codes)
        answer = self.decode(batch, to_say, to_do, fast.decode_fast(self.action, to_do, batch))
        said, done = (code.mean for code in codes)
        if paired is not None and not paired.all():
            said, done = said[paired], done[paired]
        bound = c.binding * binding(said, done, c.margin) if len(said) else said.sum()
        if c.variational:
            bound = bound + c.divergence * sum(divergence(code) for code in codes)
        return *losses(answer, batch), bound

    def draw(self, code: Code) -> Float[Tensor, "B H"]:
        """The mean of a code; in a PVAE plus noise in proportion to its standard deviation."""
        if code.log_variance is None:
            return code.mean
        deviation = self.config.noise * (code.log_variance / 2).exp()
        noise = torch.randn(code.mean.shape, device="cpu")  # so a seed is the same on all devices
        return code.mean + deviation * noise.to(code.mean)

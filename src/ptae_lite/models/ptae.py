"""PTAE, the paired transformed autoencoders (paper, section 3).

::

    words + signal --queries--\\                            /--> language decoder --> words
                               crossmodal transformer --> h
    video + joints --keys-----/                            \\--> action decoder ----> joints
                                                    video ------/

1,500,700 parameters at the paper's sizes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import torch
from torch import Tensor, nn

from ptae_lite.data.signals import MIX_WITH_BOTH, PTAE_MIX, WIRING, WORDS_OUT, Batch, Mix
from ptae_lite.errors import ConfigError
from ptae_lite.language import signal_index
from ptae_lite.models import encoders, fast
from ptae_lite.models.common import Answer, class_weights, losses
from ptae_lite.models.crossmodal import CrossmodalTransformer, TwoWay
from ptae_lite.models.decoders import ActionDecoder, LanguageDecoder

CHOICES = {
    "language_encoder": encoders.LANGUAGE,
    "action_encoder": encoders.ACTION,
    "queries": ("language", "action", "both"),
}


@dataclass(frozen=True)
class PTAEConfig:
    """Sizes and choices of a PTAE. Each value is the paper's unless its comment says otherwise.

    Raises:
        ConfigError: a value makes no sense.
    """

    features: int = 30  # 10 for each colour channel
    joints: int = 5
    hidden: int = 256
    heads: int = 4
    feed_forward: int = 1024
    decoder_units: int = 128
    decoder_layers: int = 2
    dropout: float = 0.1  # ours; paper 0.25. Without any, new scenes get wrong colours more often
    forget_bias: float = 1.0  # ours; paper 0: the decoder then forgets the code
    # Choices that the paper's text tried, or left open. The defaults are its regular model.
    language_encoder: str = "none"  # or `lstm`, or `bert` from the folder `bert`
    action_encoder: str = "none"  # or `lstm`
    encoder_units: int = 128  # ours, of an LSTM encoder: as wide as the decoders
    bert: str = ""  # a local folder
    # or `action`: frames ask the words, which the paper says is worse; or `both`, its proposal
    queries: str = "language"
    repeat_both: bool = False  # a fifth signal, as PGAE has
    weigh_words: bool = False  # weigh each word by the size of its class, as in PGAE
    # Ours, to show what the paper's choice does.
    frame_positions: bool = False  # frames have a position, and the padding is hidden
    freeze_video: bool = False  # the action decoder gets the first frame only, at every step
    # Ours, to act in the closed loop.
    pad_still_frame: bool = (
        True  # a still first frame ends where the clip will; False: it has no end
    )
    condition_on_code: bool = False  # the action decoder is given the code at every step

    def __post_init__(self):
        for name, value in asdict(self).items():
            if name in CHOICES and value not in CHOICES[name]:
                raise ConfigError(f"{name} is {value!r}; it can be {', '.join(CHOICES[name])}")
            if type(value) is int and value < 1:
                raise ConfigError(f"{name} is {value}; it must be 1 or more")
        if self.hidden % self.heads:
            raise ConfigError(f"hidden ({self.hidden}) must be a multiple of heads ({self.heads})")
        if not 0 <= self.dropout < 1:
            raise ConfigError(f"dropout is {self.dropout}; it must be from 0 to below 1")

    @property
    def mix(self) -> Mix:
        """The signals that it is trained on."""
        return MIX_WITH_BOTH if self.repeat_both else PTAE_MIX

    @property
    def plain(self) -> bool:
        """Whether `fast.encode` can compute the code."""
        return self.language_encoder == self.action_encoder == "none" and not self.frame_positions


class PTAE(nn.Module):
    """The model. The first query token, the signal, says which task it is."""

    kind = "ptae"

    def __init__(self, config: PTAEConfig = PTAEConfig()):
        super().__init__()
        self.config = c = config
        inputs = c.features + c.joints
        self.words_in = encoders.language_encoder(c.language_encoder, c.encoder_units, c.bert)
        self.frames_in = encoders.action_encoder(c.action_encoder, inputs, c.encoder_units)
        seen = self.frames_in.size if self.frames_in else inputs
        sizes = (self.words_in.size, seen, c.hidden, c.heads, c.feed_forward, c.dropout)
        if c.queries == "both":
            self.encoder = TwoWay(*sizes, frame_positions=c.frame_positions)
        else:
            self.encoder = CrossmodalTransformer(*sizes, c.queries, c.frame_positions)
        sizes = (c.hidden, c.decoder_units, c.decoder_layers, c.forget_bias)
        self.language = LanguageDecoder(*sizes)
        self.action = ActionDecoder(
            c.features, c.joints, *sizes, condition_on_code=c.condition_on_code
        )
        tokens = [signal_index(s) for s, row in WIRING.items() if row.keys == "first"]
        self.register_buffer("to_imagine", torch.tensor(tokens), persistent=False)
        self.register_buffer("word_weights", class_weights(c.weigh_words), persistent=False)

    def forward(self, batch: Batch) -> Answer:
        """The answer to a batch: log-probabilities of the words, and joints, at every step."""
        batch = self._shown(batch)
        code, attention = self.encode(batch)
        joints = self.action(code, batch.video, batch.start)
        return Answer(self.language(code, WORDS_OUT), joints, code, attention)

    def encode(self, batch: Batch):
        """The code (B, H), and the attention weights (B, heads, N, T)."""
        words = self.words_in(batch.tokens, batch.token_mask).to(batch.keys.dtype)
        frames = self.frames_in(batch.keys, batch.frames) if self.frames_in else batch.keys
        frame = torch.arange(batch.keys.shape[1], device=batch.frames.device)
        inside = frame < batch.frames[:, None]
        return self.encoder(words, batch.token_mask, frames, inside)

    def forward_fast(self, batch: Batch) -> Answer:
        """The answer of `forward` without attention weights, computed faster for training."""
        batch = self._shown(batch)
        if self.config.plain:
            code = fast.encode(self.encoder, self.words_in, batch)
        else:
            code = self.encode(batch)[0]
        joints = fast.decode_fast(self.action, code, batch)
        unseen = code.new_zeros(len(code), 0, batch.tokens.shape[1], batch.keys.shape[1])
        return Answer(self.language(code, WORDS_OUT), joints, code, unseen)

    def loss(self, batch: Batch, paired=None) -> tuple[Tensor, ...]:
        """Language and action loss, see `common.losses`. `paired` is not used."""
        return losses(self.forward_fast(batch), batch, self.word_weights)

    def _shown(self, batch: Batch) -> Batch:
        """The batch as `freeze_video` and `pad_still_frame` change it."""
        if self.config.freeze_video:
            batch = replace(batch, video=batch.video[:, :1].expand_as(batch.video))
        if not self.config.pad_still_frame:
            still = (batch.tokens[:, :1] == self.to_imagine).any(1)
            keys = torch.where(still[:, None, None], batch.keys[:, :1], batch.keys)
            frames = torch.where(still, batch.keys.shape[1], batch.frames)
            batch = replace(batch, keys=keys, frames=frames)
        return batch

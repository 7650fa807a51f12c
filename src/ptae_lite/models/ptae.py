"""PTAE, the paired transformed autoencoders (paper, section 3).

    words + signal --queries--\\                            /--> language decoder --> words
                               crossmodal transformer --> h
    video + joints --keys-----/                            \\--> action decoder ----> joints
                                                    video ------/

1,500,700 parameters at the paper's sizes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

from torch import Tensor, nn

from ptae_lite.errors import ConfigError
from ptae_lite.language import TOKENS
from ptae_lite.models import fast
from ptae_lite.models.common import Answer, losses
from ptae_lite.models.crossmodal import CrossmodalTransformer
from ptae_lite.models.decoders import ActionDecoder, LanguageDecoder
from ptae_lite.signals import SUPERVISED, UNSUPERVISED, WORDS_OUT, Batch, Mix


@dataclass(frozen=True)
class PTAEConfig:
    """Sizes of a PTAE. Each is the paper's unless its comment says otherwise."""

    features: int = 30  # 10 for each colour channel
    joints: int = 5
    hidden: int = 256
    heads: int = 4
    feed_forward: int = 1024
    decoder_units: int = 128
    decoder_layers: int = 2
    dropout: float = 0.1  # ours; paper 0.25. Without any, new scenes get wrong colours more often
    forget_bias: float = 1.0  # ours; paper 0, with which the decoder forgets what it was told

    def __post_init__(self):
        for name, value in asdict(self).items():
            if name not in ("dropout", "forget_bias") and value < 1:
                raise ConfigError(f"{name} is {value}; it must be 1 or more")
        if self.hidden % self.heads:
            raise ConfigError(f"hidden ({self.hidden}) must be a multiple of heads ({self.heads})")
        if not 0 <= self.dropout < 1:
            raise ConfigError(f"dropout is {self.dropout}; it must be from 0 to below 1")


class PTAE(nn.Module):
    """The model. It is told the task by the first query token alone."""

    kind = "ptae"
    mix = Mix(regular=(UNSUPERVISED, SUPERVISED), limited=(UNSUPERVISED, SUPERVISED))

    def __init__(self, config: PTAEConfig = PTAEConfig()):
        super().__init__()
        self.config = c = config
        self.encoder = CrossmodalTransformer(
            len(TOKENS), c.features + c.joints, c.hidden, c.heads, c.feed_forward, c.dropout
        )
        sizes = (c.hidden, c.decoder_units, c.decoder_layers, c.forget_bias)
        self.language = LanguageDecoder(*sizes)
        self.action = ActionDecoder(c.features, c.joints, *sizes)

    def forward(self, batch: Batch) -> Answer:
        code, attention = self.encoder(batch.tokens, batch.token_mask, batch.keys)
        words = self.language(code, WORDS_OUT)
        joints = self.action(code, batch.video, batch.start)
        return Answer(words, joints, code, attention)

    def costs(self, batch: Batch) -> tuple[Tensor, ...]:
        """Language and action loss, as training minimises them."""
        return losses(fast.answer(self, batch), batch)

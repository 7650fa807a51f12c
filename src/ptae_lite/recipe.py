"""How a model is trained: each setting, and the paper's value beside it."""

from __future__ import annotations

from dataclasses import dataclass

from ptae_lite.data.scaling import HALF_WHITE
from ptae_lite.errors import ConfigError


@dataclass(frozen=True)
class Recipe:
    """The settings of a training, chosen on held-out training patterns.

    Raises:
        ConfigError: a value makes no sense.
    """

    epochs: int = 80  # ours, 1,920 steps; paper 2,500 epochs of 108 batches
    batch: int = 27  # ours; paper 6
    learning_rate: float = 1e-3  # ours, Adam's peak; paper 1e-5, constant
    # ours; the learning rate of the action decoder, as a multiple of the others'. With one rate for
    # all, either the words for new scenes get worse, or the joints have not yet converged.
    action_lr_scale: float = 3.0
    muon_lr: float = 4e-3  # ours, the peak for hidden matrices, see `optimisers`; 0: Adam for all
    # ours; weight decay of Muon's matrices outside the action decoder, as AdamW has it. It keeps a
    # model from learning by heart which sentence belongs to which clip.
    muon_decay: float = 1.0
    warmup: float = 0.1  # ours; share of the updates in which rates rise; 0: one cycle of Adam
    clip: float = 1.0  # ours, of the gradient's norm; paper none
    language_weight: float = 1.0  # paper
    # ours; 5 would be the paper's text, which sums over joints where its code averages
    action_weight: float = 10.0
    hold_steps: int = 8  # ours; steps in which a pose to be held still counts, paper all 99
    mixup: bool = True  # ours; clips of describe are mixed in pairs, see `signals.mixup`
    supervised: float = 2 / 3  # paper: share of describe and execute in the regular training
    p_congruent_input: float = (
        0.0  # ours; share of samples with a true extra input, see `signals.build`
    )
    balanced: bool = (
        False  # ours, with few labels: they make half of each batch, see `epoch_batches`
    )
    shuffle_scenes: bool = (
        False  # ours: a sentence to repeat comes with the scene of another sample
    )
    exponent: float = HALF_WHITE  # ours, of the features' whitening, see `scaling.fit_scaling`
    seed: int = 0

    def __post_init__(self):
        if self.epochs < 1 or self.batch < 2:
            raise ConfigError("a recipe needs at least one epoch and batches of at least two")
        if not 0 < self.supervised < 1:
            raise ConfigError(f"supervised is {self.supervised}; it is a share between 0 and 1")
        if not 0 <= self.warmup < 1 or min(self.muon_lr, self.muon_decay) < 0:
            raise ConfigError(
                f"warmup is {self.warmup}, muon_lr {self.muon_lr} and muon_decay "
                f"{self.muon_decay}; warmup is a share from 0 to below 1, and a learning rate and "
                "a decay are not below 0"
            )
        if not 0 <= self.p_congruent_input <= 1:
            raise ConfigError(
                f"p_congruent_input is {self.p_congruent_input}; it is a share from 0 to 1"
            )

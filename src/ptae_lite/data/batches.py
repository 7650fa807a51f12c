"""The batches of a training: the samples, their signals, and every other random draw.

Each sample of a batch draws its own signal, so one step learns all tasks (ours; the published code
has one signal a batch, batches of 6, and 270,000 steps). Only labelled samples take part in a
supervised signal.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import lcm
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Int
from torch import Tensor

from ptae_lite.data.samples import Samples
from ptae_lite.data.scaling import Scaling, prepare
from ptae_lite.data.signals import PTAE_MIX, Batch, Source, build, mixup, signal_number, with_video
from ptae_lite.recipe import Recipe


def draw_signals(
    rng: np.random.Generator, count: int, supervised, groups=PTAE_MIX.regular
) -> Int[Tensor, " B"]:
    """A signal number for each of `count` samples.

    Args:
        supervised: the probability that a sample takes a signal of the second group instead of the
            first. One number for all samples, or one for each (0 and 1 then choose its group).
        groups: two groups of signal names. All signals of a group are equally likely.
    """
    width = lcm(*map(len, groups))  # groups are repeated to rows of equal width
    rows = [[signal_number(s) for s in group] * (width // len(group)) for group in groups]
    row = (rng.random(count) < supervised).astype(int)
    return torch.from_numpy(np.array(rows)[row, rng.integers(0, width, count)])


def draw_partners(rng: np.random.Generator, signals: Int[Tensor, " B"]):
    """Draw the weights and the partners of `signals.mixup`.

    Returns:
        Shares (B,), uniform from 0.5 to 1, and for each sample a partner (B,) with the same signal.
    """
    share, partner = rng.uniform(0.5, 1.0, len(signals)), np.arange(len(signals))
    for signal in signals.unique().numpy():
        same = np.flatnonzero(signals.numpy() == signal)
        partner[same] = rng.permutation(same)
    return torch.from_numpy(share.astype(np.float32)), torch.from_numpy(partner)


def draw_videos(
    rng: np.random.Generator, part, videos: dict, scaling: Scaling
) -> dict[int, Tensor]:
    """Draw another video for some samples of a batch.

    A sample's recorded video and each of its other videos are equally likely.

    Args:
        part: sample numbers of the batch.
        videos: sample number to its other videos: raw features (99, F).

    Returns:
        Place in the batch to scaled features (99, F), for the places where another video was drawn.
    """
    drawn = {}
    for place, sample in enumerate(part):
        others = videos.get(int(sample), ())
        which = rng.integers(0, len(others) + 1)
        if which:
            video = scaling.features(others[which - 1]).astype(np.float32)
            drawn[place] = torch.from_numpy(video)
    return drawn


def epoch_batches(
    rng, train: np.ndarray, labelled: np.ndarray | None, recipe: Recipe, groups=PTAE_MIX.regular
):
    """Yield the batches of one epoch: sample numbers (B,) and signal numbers (B,).

    If all samples have a label (`labelled` is None), each sample draws any signal. Otherwise
    labelled samples take the signals that need a label, and the others take the rest.

    With few labels and `recipe.balanced`, half of every batch is drawn from the labelled samples
    and half from the others in turn. In all other cases the samples are shuffled and each appears
    at most once; the last ones, too few for a batch, are left out. The share of supervised updates
    is then about the share of labelled samples.
    """
    if labelled is None or not recipe.balanced:
        order = rng.permutation(train)
        for i in range(0, len(order) - recipe.batch + 1, recipe.batch):
            part = order[i : i + recipe.batch]
            share = recipe.supervised if labelled is None else np.isin(part, labelled)
            yield part, draw_signals(rng, len(part), share, groups)
        return
    unlabelled, taken = rng.permutation(np.setdiff1d(train, labelled)), 0
    for i in range(max(len(train) // recipe.batch, 1)):
        half = (recipe.batch + i % 2) // 2  # odd batches: one more, by turns
        mine = rng.choice(labelled, half, replace=len(labelled) < half)
        rest = recipe.batch - half
        others = np.take(unlabelled, np.arange(taken, taken + rest), mode="wrap")
        taken += rest
        signals = [draw_signals(rng, n, share, groups) for n, share in ((half, 1.0), (rest, 0.0))]
        yield np.concatenate([mine, others]), torch.cat(signals)


class TrainingBatch(NamedTuple):
    """The batch of one training step.

    Args:
        inputs: inputs and targets.
        paired: samples with a label: the model may use that sentence and clip belong together.
        supervised: number of labelled samples that drew a signal which needs the label.
    """

    inputs: Batch
    paired: Bool[Tensor, " B"]
    supervised: int


class Batches:
    """The batches of a training, epoch by epoch. It makes all random draws except those of the
    network.

    The draws come from one generator on the CPU, so a seed gives the same batches on every device.
    Their order must not change: another order would change every training.

    Args:
        indices: the samples to train on.
        labelled: the samples whose labels may be used; all of `indices` if None.
        groups: two groups of signals, one of the pairs of a `Mix`.
        need_label: names of the signals that need a label.
        videos: sample number to other videos, raw features (99, F); see `draw_videos`.
    """

    def __init__(
        self, samples: Samples, scaling: Scaling, indices, labelled, recipe: Recipe, groups,
        need_label, videos: dict[int, list[np.ndarray]] | None = None,
    ):  # fmt: skip
        self.source, self.scaling = Source(prepare(samples, scaling)), scaling
        self.indices, self.labelled, self.recipe = indices, labelled, recipe
        self.groups, self.videos = groups, videos
        self.need_label = [signal_number(signal) for signal in need_label]
        self.with_label = indices if labelled is None else labelled
        self.without_label = indices if labelled is None else np.setdiff1d(indices, labelled)
        self.rng = np.random.default_rng(recipe.seed)
        self.count = len(self._parts())  # this epoch is only drawn to count its batches

    def _parts(self) -> list:
        return list(epoch_batches(self.rng, self.indices, self.labelled, self.recipe, self.groups))

    def epoch(self) -> Iterator[TrainingBatch]:
        """Yield the batches of the next epoch."""
        for part, signals in self._parts():
            yield self._batch(part, signals)

    def _batch(self, part: np.ndarray, signals: Tensor) -> TrainingBatch:
        rng, recipe = self.rng, self.recipe
        alternative = torch.from_numpy(rng.integers(0, 8, len(part)))
        congruent_input = (
            torch.from_numpy(rng.random(len(part)) < recipe.p_congruent_input)
            if recipe.p_congruent_input
            else None
        )
        sentences_of = torch.from_numpy(self._sentences_of(part, signals))
        batch = build(
            self.source, torch.from_numpy(part), signals, alternative, recipe.hold_steps,
            congruent_input, sentences_of,
        )  # fmt: skip
        if self.videos:
            batch = with_video(batch, draw_videos(rng, part, self.videos, self.scaling))
        if recipe.mixup:
            batch = mixup(batch, *draw_partners(rng, signals))
        paired = np.isin(part, self.with_label)
        supervised = int((np.isin(signals, self.need_label) & paired).sum())
        return TrainingBatch(batch, torch.from_numpy(paired), supervised)

    def _sentences_of(self, part: np.ndarray, signals: Tensor) -> np.ndarray:
        """The sample whose sentence each sample is given: itself.

        With `recipe.shuffle_scenes`, *repeat language* takes the sentence of a random sample
        without a label (of any sample if all have labels).
        """
        if not self.recipe.shuffle_scenes:
            return part
        repeats = signals.numpy() == signal_number("repeat language")
        return np.where(repeats, self.rng.choice(self.without_label, len(part)), part)

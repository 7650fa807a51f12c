"""Controls: which inputs does a model use? Each removes an input or replaces it by a false one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import torch
from jaxtyping import Int
from torch import Tensor

from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.signals import TOKENS_IN, Batch, Source
from ptae_lite.evaluation import nrmse, poses, respond
from ptae_lite.language import EOS, TOKENS, WORD_INDEX, words_of
from ptae_lite.models.checkpoint import Trained


def blank_sentence(batch: Batch) -> Batch:
    """Control: every token after the signal is EOS."""
    return replace(batch, tokens=torch.where(torch.arange(TOKENS_IN) == 0, batch.tokens, EOS))


def shuffled_sentences(batch: Batch) -> Batch:
    """Control: each sample gets the sentence of the next sample with the same clip length.

    So the speed word stays true.
    """
    tokens = batch.tokens.clone()
    for frames in batch.frames.unique():
        same = (batch.frames == frames).nonzero()[:, 0]
        tokens[same] = batch.tokens[same.roll(-1)]
    return replace(batch, tokens=tokens)


def other_speed() -> Int[Tensor, " V"]:
    """The index of each token; of a speed's word that of the other speed's, synonym for synonym."""
    swap = torch.arange(len(TOKENS))
    for one, other in zip(words_of("speed")[::2], words_of("speed")[1::2], strict=True):
        swap[WORD_INDEX[one]], swap[WORD_INDEX[other]] = WORD_INDEX[other], WORD_INDEX[one]
    return swap


def swapped_speed(batch: Batch) -> Batch:
    """Control: the speed word is replaced by the other one (first word or synonym as before)."""
    return replace(batch, tokens=other_speed()[batch.tokens])


def frozen_video(batch: Batch) -> Batch:
    """Control: the action decoder sees the first frame at every step."""
    return replace(batch, video=batch.video[:, :1].expand_as(batch.video))


def false_padding(batch: Batch) -> Batch:
    """Control of tasks with a still image as keys: a slow clip seems to end early, a fast one late.

    The keys of a slow clip are padded like a fast clip's, and those of a fast clip are full.
    """
    shown = MAX_FRAMES + MAX_FRAMES // 2 - batch.frames  # 50 for 100, and 100 for 50
    present = torch.arange(MAX_FRAMES) < shown[:, None]
    return replace(batch, keys=batch.keys[:, :1] * present[:, :, None])


CONTROLS = {
    "as trained": lambda batch: batch,
    "sentence blanked": blank_sentence,
    "sentences shuffled": shuffled_sentences,
    "speed word swapped": swapped_speed,
    "video frozen": frozen_video,
}


def execute_errors(
    trained: Trained, samples: Samples, changes: Mapping[str, Callable[[Batch], Batch]] = CONTROLS,
    split: str = "test",
) -> dict[str, tuple]:  # fmt: skip
    """NRMSE (paper's, valid) of *execute* under each control, or other change of a batch.

    A model never met a blank sentence or a frozen video in training, so this alone may cause a part
    of the error. Shuffled sentences and swapped words are ordinary sentences.
    """
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    results = {}
    for name, change in changes.items():
        answer = respond(trained, source, indices, "execute", change=change)
        results[name] = nrmse(poses(answer, trained.scaling), samples, indices, trained.scaling)
    return results

"""The task signals: one table that says what each task sees, and what it must answer.

This table is the heart of the system (paper, section 3.3; details from the published code). Every
task runs the same network. What differs is what is asked (the query tokens), what is looked at
(keys and values: video and joints together), what the action decoder is shown while it moves, and
the two targets. `build` turns samples and signals into arrays by this table and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ptae_lite.data.samples import MAX_FRAMES
from ptae_lite.data.scaling import Dataset
from ptae_lite.errors import ConfigError
from ptae_lite.language import EOS, MEANINGS, SIGNALS, alternatives, encode, patterns, signal_index

STEPS = MAX_FRAMES - 1  # the action decoder is given pose 1 and answers poses 2 to 100
WORDS_OUT = 4  # action, colour, speed, EOS
TOKENS_IN = 6  # signal, BOS, action, colour, speed, EOS


@dataclass(frozen=True)
class Wiring:
    """One row of the table. `clip`, `first` and `last` speak of frames of the sample."""

    query: str  # what follows the signal token: `sentence` or `eos`
    keys: str  # keys and values: the `clip`, or its `first` frame in every place of the clip
    words: str  # language target: `sentence` (4 steps) or `eos` (1 step)
    video: str  # what the action decoder sees at each step: `clip`, `first` or `last`
    start: str  # the pose it starts from: `first` or `last`
    joints: str  # its target: the `clip`, or the `first` or `last` pose held still


WIRING = {
    "describe": Wiring("eos", "clip", "sentence", "last", "last", "last"),
    "execute": Wiring("sentence", "first", "eos", "clip", "first", "clip"),
    "repeat action": Wiring("eos", "clip", "eos", "clip", "first", "clip"),
    "repeat both": Wiring("sentence", "clip", "sentence", "clip", "first", "clip"),
    "repeat language": Wiring("sentence", "first", "sentence", "first", "first", "first"),
}
PTAE_SIGNALS = ("describe", "execute", "repeat action", "repeat language")
SUPERVISED = ("describe", "execute")  # they need a sentence paired with an action
UNSUPERVISED = ("repeat action", "repeat language")


@dataclass(frozen=True)
class Mix:
    """The signals that a model is trained on; each group shares its part equally.

    `regular`: drawn with probability 1 - supervised, and with probability supervised.
    `limited`: where few updates or few samples are supervised; the second group needs a label.
    """

    regular: tuple[tuple[str, ...], tuple[str, ...]]
    limited: tuple[tuple[str, ...], tuple[str, ...]]


PTAE_MIX = Mix((UNSUPERVISED, SUPERVISED), (UNSUPERVISED, SUPERVISED))
# Published: a third for the three repeat signals, a third each for describe and execute; where
# few samples are labelled, repeat both is one of the three that need a label.
MIX_WITH_BOTH = Mix(
    regular=(("repeat action", "repeat both", "repeat language"), SUPERVISED),
    limited=(UNSUPERVISED, (*SUPERVISED, "repeat both")),
)


@dataclass(frozen=True)
class Batch:
    """Everything a model is given and must answer, for B samples with a signal each."""

    tokens: Int[Tensor, "B 6"]  # query tokens, padded with EOS
    token_mask: Bool[Tensor, "B 6"]  # which of them are there
    frames: Int[Tensor, " B"]  # clip lengths
    keys: Float[Tensor, "B 100 K"]  # F + 5 numbers a frame: features, then joints
    video: Float[Tensor, "B 99 F"]  # for the action decoder
    start: Float[Tensor, "B 5"]  # its first pose
    words: Int[Tensor, "B 4"]  # language target
    word_mask: Bool[Tensor, "B 4"]
    joints: Float[Tensor, "B 99 5"]  # action target, zero beyond the clip
    step_mask: Bool[Tensor, "B 99"]  # which steps of it count

    def to(self, device) -> Batch:
        """The same on another device."""
        return type(self)(**{name: value.to(device) for name, value in vars(self).items()})


@dataclass(frozen=True)
class MixupBatch(Batch):
    """A batch in which clips were blended in pairs (`mixup`)."""

    other_words: Int[Tensor, "B 4"]  # the second clip's sentence
    share: Float[Tensor, " B"]  # of the first


class Source:
    """A data set as tensors, ready to be cut into batches."""

    def __init__(self, dataset: Dataset):
        self.dataset = dataset
        self.features = torch.from_numpy(dataset.features)
        self.joints = torch.from_numpy(dataset.joints)
        self.frames = torch.from_numpy(dataset.samples.frames)
        number = {meaning: i for i, meaning in enumerate(MEANINGS)}
        of_pattern = torch.tensor([number[p.meaning] for p in patterns()])
        self.meaning = of_pattern[torch.from_numpy(dataset.samples.pattern)]
        # all 36 x 8 sentences as tokens: BOS, action, colour, speed, EOS
        self.sentences = torch.tensor([[encode(s) for s in alternatives(m)] for m in MEANINGS])


_SIGNAL_NUMBER = {signal: i for i, signal in enumerate(SIGNALS)}


def _rows(column: str, value: str) -> Tensor:
    """Which signals have `value` in a column of the table, as a mask over signal numbers."""
    return torch.tensor([getattr(WIRING[s], column) == value for s in SIGNALS])


_WHERE = {
    (field.name, value): _rows(field.name, value)
    for field in fields(Wiring)
    for value in {getattr(row, field.name) for row in WIRING.values()}
}
_SIGNAL_TOKEN = torch.tensor([signal_index(s) for s in SIGNALS])


def signal_number(signal: str) -> int:
    """Number of a signal, 0 to 4. Raises `LanguageError` naming the signals there are."""
    signal_index(signal)
    return _SIGNAL_NUMBER[signal]


def build(
    source: Source,
    samples: Int[Tensor, " B"],
    signals: Int[Tensor, " B"],
    alternative: Int[Tensor, " B"],
    hold_steps: int = STEPS,
    congruent_input: Bool[Tensor, " B"] | None = None,
    sentence_from: Int[Tensor, " B"] | None = None,
) -> Batch:
    """Wire samples to signals by the table.

    Args:
        samples: sample numbers.
        signals: a signal number for each.
        alternative: which of its eight sentences each sample is given or asked for.
        hold_steps: how many steps count where the target is a pose held still (describe, repeat
            language). Training may ask for few: there is nothing more to learn in the rest.
        congruent_input: which samples are also given the input that their task could do without,
            and true: the whole sentence in the query, the moving clip as keys and values; none if
            None.
        sentence_from: sample numbers whose sentences are used, where they are not the clips' own.
    """
    if not len(samples) == len(signals) == len(alternative):
        raise ConfigError("a batch needs as many signals and alternatives as samples")

    def where(column, value):
        return _WHERE[column, value][signals]

    features, joints, frames = (x[samples] for x in (source.features, source.joints, source.frames))
    inside = torch.arange(MAX_FRAMES) < frames[:, None]
    item = torch.arange(len(samples))
    first = {"features": features[:, 0], "joints": joints[:, 0]}
    last = {"features": features[item, frames - 1], "joints": joints[item, frames - 1]}

    # query: the signal, then the whole sentence or EOS alone
    sentence_from = samples if sentence_from is None else sentence_from
    sentence = source.sentences[source.meaning[sentence_from], alternative]
    tokens = torch.cat([_SIGNAL_TOKEN[signals, None], sentence], dim=1)
    token_mask = torch.ones_like(tokens, dtype=torch.bool)
    congruent_input = (
        torch.zeros_like(signals, dtype=torch.bool) if congruent_input is None else congruent_input
    )
    short = where("query", "eos") & ~congruent_input
    tokens[short, 1:] = EOS
    token_mask[short, 2:] = False

    # keys and values: the moving clip, or its first frame stood still for the clip's length
    keys = torch.cat([features, joints], dim=2)
    still = keys[:, :1] * inside[..., None]
    keys = torch.where((where("keys", "first") & ~congruent_input)[:, None, None], still, keys)

    # the action decoder: what it sees, where it starts, what it must do
    video = features[:, :STEPS].clone()
    target = joints[:, 1:].clone()
    start = first["joints"].clone()
    for name, frame in (("first", first), ("last", last)):
        shown = _WHERE.get(("video", name), _WHERE["video", "clip"] & False)[signals]
        video = torch.where(shown[:, None, None], frame["features"][:, None], video)
        held = _WHERE["joints", name][signals]
        target = torch.where(held[:, None, None], frame["joints"][:, None], target)
    start = torch.where(where("start", "last")[:, None], last["joints"], start)
    step_mask = inside[:, 1:] & (
        where("joints", "clip")[:, None] | (torch.arange(STEPS) < hold_steps)
    )

    # language target: the sentence without BOS, or EOS at once
    words = sentence[:, 1:].clone()
    word_mask = torch.ones_like(words, dtype=torch.bool)
    brief = where("words", "eos")
    words[brief] = EOS
    word_mask[brief, 1:] = False

    return Batch(
        tokens, token_mask, frames, keys, video, start, words, word_mask,
        target * step_mask[..., None], step_mask,
    )  # fmt: skip


def mixup(batch: Batch, share: Float[Tensor, " B"], partner: Int[Tensor, " B"]) -> MixupBatch:
    """Blend the clips that are to be described, each with that of another such sample.

    Keys and values become share x own + (1 - share) x partner's, and both sentences are asked for,
    in these shares (mixup, Zhang et al. 2018). Samples of other signals stay as they are, and so do
    those that are given the sentence: it would say one clip of the two.

    Args:
        partner: a place in the batch for each sample; where either is not to describe, nothing
            is blended.
    """
    describe = batch.tokens[:, 0] == signal_index("describe")
    describe &= ~batch.token_mask[:, 2]
    both = describe & describe[partner]
    share = torch.where(both, share, 1.0)
    weight = share[:, None, None]
    parts = vars(batch) | {
        "keys": weight * batch.keys + (1 - weight) * batch.keys[partner],
        "frames": torch.where(both, batch.frames.maximum(batch.frames[partner]), batch.frames),
    }
    return MixupBatch(**parts, other_words=batch.words[partner], share=share)


def with_video(batch: Batch, videos: dict[int, Float[Tensor, "99 F"]]) -> Batch:
    """The batch with another video for the action decoder in some places that execute."""
    video, execute = batch.video.clone(), signal_index("execute")
    for place, other in videos.items():
        if batch.tokens[place, 0] == execute:
            video[place] = other
    return replace(batch, video=video)


def table() -> list[dict[str, str]]:
    """The table as rows, for showing."""
    return [{"signal": s, **vars(WIRING[s])} for s in SIGNALS]

"""The task signals: one table says what each task sees and what it must answer.

All tasks use the same network (paper, section 3.3; details from the published code). They differ in
the query tokens, in the keys and values (video and joints together), in the video that the action
decoder sees, and in the two targets. `build` makes arrays of samples and signals from this table
alone.
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
    """One row of the table. `clip`, `first` and `last` are frames of the sample.

    Attributes:
        query: what follows the signal token: `sentence` or `eos`.
        keys: keys and values: the `clip`, or its `first` frame, repeated for the length of the
            clip.
        words: language target: `sentence` (4 steps) or `eos` (1 step).
        video: what the action decoder sees at each step: `clip`, `first` or `last`.
        start: the pose from which the action decoder starts: `first` or `last`.
        joints: action target: the `clip`, or the `first` or `last` pose in all frames.
    """

    query: str
    keys: str
    words: str
    video: str
    start: str
    joints: str


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
    """The signals that a model is trained on, in two groups. All signals of a group are equally
    likely.

    Attributes:
        regular: the signals of a regular training. The second group has the probability
            `supervised` of the recipe, the first has the rest.
        limited: the signals where few iterations or few samples are supervised. The second group
            needs a label.
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
    """What a model is given and what it must answer, for B samples with one signal each.

    Attributes:
        tokens: query tokens, padded with EOS.
        token_mask: which of the tokens are not padding.
        frames: clip lengths.
        keys: keys and values: K = F + 5 numbers a frame, features first, then joints. `build` makes
            T = 100 of them.
        video: features that the action decoder sees at each step.
        start: first pose of the action decoder.
        words: language target.
        word_mask: which words of the target count.
        joints: action target in network units, zero after the end of the clip.
        step_mask: which steps of the target count.
    """

    tokens: Int[Tensor, "B 6"]
    token_mask: Bool[Tensor, "B 6"]
    frames: Int[Tensor, " B"]
    keys: Float[Tensor, "B T K"]
    video: Float[Tensor, "B 99 F"]
    start: Float[Tensor, "B 5"]
    words: Int[Tensor, "B 4"]
    word_mask: Bool[Tensor, "B 4"]
    joints: Float[Tensor, "B 99 5"]
    step_mask: Bool[Tensor, "B 99"]

    def to(self, device) -> Batch:
        """The same batch on another device."""
        return type(self)(**{name: value.to(device) for name, value in vars(self).items()})


@dataclass(frozen=True)
class MixupBatch(Batch):
    """A batch whose clips were mixed in pairs, see `mixup`.

    Attributes:
        other_words: the sentence of the second clip.
        share: weight of the first clip, 0 to 1.
    """

    other_words: Int[Tensor, "B 4"]
    share: Float[Tensor, " B"]


class Source:
    """A data set as tensors, from which `build` takes batches."""

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
    """Which signals have `value` in a column of the table: a mask over signal numbers."""
    return torch.tensor([getattr(WIRING[s], column) == value for s in SIGNALS])


_WHERE = {
    (field.name, value): _rows(field.name, value)
    for field in fields(Wiring)
    for value in {getattr(row, field.name) for row in WIRING.values()}
}
_SIGNAL_TOKEN = torch.tensor([signal_index(s) for s in SIGNALS])


def signal_number(signal: str) -> int:
    """Number of a signal, 0 to 4, its place in `SIGNALS`.

    Raises:
        LanguageError: there is no such signal.
    """
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
    """Make a batch: the inputs and targets of samples under their signals, by the table.

    Args:
        samples: sample numbers.
        signals: a signal number for each sample.
        alternative: which of its eight sentences each sample is given or must say.
        hold_steps: how many steps count where the target is one pose held still (describe, repeat
            language). A training may use few: the other steps teach nothing new. The paper uses 99.
        congruent_input: which samples also get the input that their task could do without: the
            whole sentence in the query, and the moving clip as keys and values. It is true, so
            nothing in it conflicts. None means no sample.
        sentence_from: sample numbers whose sentences are used; None means each sample's own.

    Raises:
        ConfigError: the numbers of samples, signals and alternatives differ.
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

    # query
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

    # keys and values: the moving clip, or its first frame repeated for the clip's length
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
    """Mix the clips of *describe* in pairs (mixup, Zhang et al. 2018; ours, not in the paper).

    ::

        keys = share keys + (1 - share) keys[partner]

    The loss then asks for both sentences, with the same weights. Samples of other signals do not
    change, nor do samples that are given the sentence: it is true of only one of the two clips.

    Args:
        share: weight of each sample's own clip, 0 to 1.
        partner: a place in the batch for each sample. Nothing is mixed if one of the two has
            another signal.
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
    """The batch with other videos for the action decoder.

    Args:
        videos: place in the batch to scaled features. A place with another signal than *execute*
            does not change.
    """
    video, execute = batch.video.clone(), signal_index("execute")
    for place, other in videos.items():
        if batch.tokens[place, 0] == execute:
            video[place] = other
    return replace(batch, video=video)


def table() -> list[dict[str, str]]:
    """The table as rows, to show it."""
    return [{"signal": s, **vars(WIRING[s])} for s in SIGNALS]

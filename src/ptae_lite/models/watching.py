"""A policy that watches: a PTAE whose actions are wishes for the hand, corrected at every frame.

::

    sentence --PTAE--> h --MeaningReader--> colour, action, speed --\\
    first look --ColourReader--> where this colour stands --------- task --\\
    image now --PlaceReader--> places of the cubes --------------------HandPlanner --> wish
    measured joints --forward kinematics--> place of the hand -------------/

The PTAE stays as it was trained, and does its four tasks as before. Its code of the sentence tells
once what is to be done, and the first look on which side. From then on the policy asks at every
frame where the named cube is and where the hand is, and answers with the place where the hand is to
be in the next frame. Inverse kinematics turns it into joints.

It also describes a clip of any length, such as its own act: from the frames that there are, without
padding, and with a clock.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from ptae_lite.data.samples import MAX_FRAMES
from ptae_lite.data.signals import WORDS_OUT, Batch
from ptae_lite.language import (
    ACTIONS,
    COLOURS,
    EOS,
    SIDES,
    SPEEDS,
    WORD_INDEX,
    signal_index,
    words_of,
)
from ptae_lite.models.common import Answer, check_sizes
from ptae_lite.models.hand_planner import HandPlanner, Memory
from ptae_lite.models.ptae import PTAE, PTAEConfig
from ptae_lite.robot.scene import NOMINAL_PLACES_M

KINDS = (len(SIDES), len(ACTIONS), len(SPEEDS))  # choices of a task
SAID = (len(ACTIONS), len(COLOURS), len(SPEEDS))  # choices of a meaning
COLOUR_WORD = 1  # the place of the colour in a sentence
UNSEEN = -100.0  # log-probability of a word that is no colour, in this place
COLOUR_WORDS = [WORD_INDEX[word] for word in words_of("colour")]  # first words, then synonyms
PLACE_UNIT_M = 0.03  # a cube is mostly within this of the middle of its places


@dataclass(frozen=True)
class WatcherConfig:
    """Sizes and choices of a watching policy.

    Raises:
        ConfigError: a value makes no sense.
    """

    ptae: PTAEConfig | dict = field(default_factory=PTAEConfig)  # a dict if read from a file
    meaning_units: int = 64
    colour_units: int = 64
    place_units: int = 128
    gate_units: int = 32
    units: int = 128
    layers: int = 2
    teller_units: int = 64
    blind: bool = False  # a control: it sees the first image only, and does not feel its hand

    def __post_init__(self):
        if isinstance(self.ptae, dict):
            object.__setattr__(self, "ptae", PTAEConfig(**self.ptae))
        check_sizes(self, *(name for name, value in asdict(self).items() if type(value) is int))


class MeaningReader(nn.Module):
    """Code of a sentence to what it says: which action, which colour, which speed."""

    def __init__(self, hidden: int, units: int):
        super().__init__()
        self.inner = nn.Sequential(nn.Linear(hidden, units), nn.ReLU())
        self.outputs = nn.ModuleList(nn.Linear(units, kinds) for kinds in SAID)

    def forward(self, code: Float[Tensor, "B H"]) -> list[Float[Tensor, "B _"]]:
        """Scores of the actions, of the colours and of the speeds."""
        inner = self.inner(code)
        return [output(inner) for output in self.outputs]


class ColourReader(nn.Module):
    """Features of an image to the colours of both cubes."""

    def __init__(self, features: int, units: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(features, units), nn.ReLU(), nn.Linear(units, len(SIDES) * len(COLOURS))
        )

    def forward(self, features: Float[Tensor, "... F"]) -> Float[Tensor, "... 2 6"]:
        """Log-probabilities of the colours of the left and of the right cube."""
        return self.layers(features).unflatten(-1, (len(SIDES), len(COLOURS))).log_softmax(-1)


class Teller(nn.Module):
    """Code and duration of a clip to a change of the code, and to the side of the moved cube.

    The change makes the code of a clip of any length, such as its own act, into one whose words the
    PTAE has learned.
    """

    def __init__(self, hidden: int, units: int):
        super().__init__()
        self.inner = nn.Sequential(nn.Linear(hidden + 1, units), nn.ReLU())
        self.change, self.side = nn.Linear(units, hidden), nn.Linear(units, len(SIDES))

    def forward(self, code: Float[Tensor, "B H"], frames: Float[Tensor, " B"]):
        """The changed code (B, H), and log-probabilities of the sides (B, 2)."""
        time = (frames[:, None] / MAX_FRAMES - 0.75) / 0.25  # +-1 for a slow and a fast clip
        inner = self.inner(torch.cat([code, time], dim=1))
        return code + self.change(inner), self.side(inner).log_softmax(1)


def one_of_each(task: Int[Tensor, "B 3"]) -> Float[Tensor, "B K"]:
    """Side, action and speed as numbers to a vector with a 1 for each."""
    parts = [nn.functional.one_hot(task[:, i], kinds) for i, kinds in enumerate(KINDS)]
    return torch.cat(parts, dim=1).float()


class PlaceReader(nn.Module):
    """Features of an image to the places of both cubes."""

    def __init__(self, features: int, units: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(features, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(),
            nn.Linear(units, 4),
        )  # fmt: skip
        middle = torch.tensor(NOMINAL_PLACES_M, dtype=torch.float32)
        self.register_buffer("middle", middle, persistent=False)

    def forward(self, features: Float[Tensor, "... F"]) -> Float[Tensor, "... 2 2"]:
        """x and y of the left and the right cube, in metres."""
        return self.middle + PLACE_UNIT_M * self.layers(features).unflatten(-1, (2, 2))


class Watcher(nn.Module):
    """A PTAE, and what it needs to watch, to correct its hand, and to tell of it."""

    kind = "watcher"

    def __init__(self, config: WatcherConfig = WatcherConfig()):
        super().__init__()
        self.config, p, c = config, config.ptae, config
        self.ptae = PTAE(p)
        self.meaning = MeaningReader(p.hidden, c.meaning_units)
        self.colours = ColourReader(p.features, c.colour_units)
        self.places = PlaceReader(p.features, c.place_units)
        self.plan = HandPlanner(sum(KINDS), c.units, c.layers, c.gate_units)
        self.teller = Teller(p.hidden, c.teller_units)

    def forward(self, batch: Batch) -> Answer:
        """The answer of the PTAE to a batch."""
        return self.ptae(batch)

    def code(
        self, tokens: Int[Tensor, "B 6"], there: Tensor, keys: Float[Tensor, "B T K"]
    ) -> Float[Tensor, "B H"]:
        """The PTAE's code, from frames without padding.

        Args:
            there: which tokens are not padding.
            keys: features and joints of each frame. A still image is one frame: the code of the
                same frame many times is the same.
        """
        words = self.ptae.words_in(tokens, there).to(keys.dtype)
        return self.ptae.encoder(words, there, keys, torch.ones_like(keys[..., 0]) > 0)[0]

    def code_of_sentence(self, tokens: Int[Tensor, "B 6"]) -> Float[Tensor, "B H"]:
        """The code of sentences alone, with an empty frame in place of a look."""
        p = self.config.ptae
        nothing = self.meaning.inner[0].weight.new_zeros(len(tokens), 1, p.features + p.joints)
        return self.code(tokens, torch.ones_like(tokens) > 0, nothing)

    def understand(
        self, code: Float[Tensor, "B H"], first: Float[Tensor, "B F"]
    ) -> Int[Tensor, "B 3"]:
        """What is to be done: side, action and speed, as numbers.

        Args:
            code: from `code_of_sentence`.
            first: features of the first image. The named cube is the one that more probably has
                the colour that the sentence says.
        """
        action, colour, speed = (scores.argmax(1) for scores in self.meaning(code))
        side = self.colours(first)[torch.arange(len(code)), :, colour].argmax(1)
        return torch.stack([side, action, speed], dim=1)

    def watch(self, keys: Float[Tensor, "B T K"]) -> Float[Tensor, "B H"]:
        """The code of *describe* for clips of one length."""
        tokens = torch.full((len(keys), 6), EOS)
        tokens[:, 0] = signal_index("describe")
        return self.code(tokens, torch.arange(6).expand_as(tokens) < 2, keys)

    def tell(
        self, code: Float[Tensor, "B H"], frames: Float[Tensor, " B"], first: Float[Tensor, "B F"]
    ) -> Float[Tensor, "B 4 V"]:
        """Log-probabilities of the words that describe clips, from the changed code.

        A colour must also be that of the moved cube in the first image: both probabilities of its
        words are multiplied.

        Args:
            code: from `watch`.
            frames: durations of the clips.
            first: features of their first images.
        """
        changed, side = self.teller(code, frames)
        words = self.ptae.language(changed, WORDS_OUT)
        seen = (side[:, :, None] + self.colours(first)).logsumexp(1)
        more = torch.zeros_like(words)
        more[:, COLOUR_WORD] = UNSEEN
        more[:, COLOUR_WORD, COLOUR_WORDS] = torch.cat([seen, seen], dim=1)
        return (words + more).log_softmax(2)

    def read(
        self, task: Int[Tensor, "B 3"], video: Float[Tensor, "B T F"]
    ) -> Float[Tensor, "B T 2"]:
        """Where the named cube is in each image, as far as it is seen, in metres.

        Args:
            task: side, action and speed as numbers.
            video: features of the images.
        """
        return self.places(video)[torch.arange(len(task)), :, task[:, 0]]

    def follow(
        self, task: Int[Tensor, "B 3"], read: Float[Tensor, "B T 2"], hand: Float[Tensor, "B T 3"],
        memory: Memory | None = None,
    ):  # fmt: skip
        """Where the hand is to be in the next frame, for T frames, in metres.

        Args:
            read: from `read`.
            hand: where the hand is, in metres.
            memory: from the frame before; None at the first.

        Returns:
            Wishes (B, T, 3), remembered places of the named cube (B, T, 2), and the memory.
        """
        if self.config.blind:
            first = read[:, :1] if memory is None else memory.place_m[:, None]
            read, hand = first.expand_as(read), self.plan.home.expand_as(hand)
        return self.plan(one_of_each(task), read, hand, memory)

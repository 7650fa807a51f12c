"""Words, sentences, and the 144 patterns of the data set with their split.

A sentence has three words, `action colour speed`. Each word has one synonym, so a meaning has
2 x 2 x 2 = 8 sentences, and the 36 meanings have 288 (paper, section 4.1).

A pattern is an action in an arrangement. There are 12 actions (action word x side x speed) and 12
arrangements of two cubes, so there are 144 patterns. A pattern has the same index here and in the
authors' published data, so the two data sets can be compared pattern by pattern.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import NamedTuple

from ptae_lite.errors import LanguageError

ACTIONS = ("push", "pull", "slide")
COLOURS = ("red", "green", "blue", "yellow", "cyan", "violet")
SPEEDS = ("slowly", "fast")
SIDES = ("left", "right")
SYNONYMS = {
    "push": "move-up", "pull": "move-down", "slide": "move-sideways",
    "red": "scarlet", "green": "harlequin", "blue": "azure",
    "yellow": "blonde", "cyan": "greenish-blue", "violet": "purple",
    "slowly": "unhurriedly", "fast": "quickly",
}  # fmt: skip
TAG = "<eos>"  # one token opens and closes a sentence: BOS and EOS are the same word
VOCABULARY = (TAG, *sorted([*SYNONYMS, *SYNONYMS.values()]))  # V = 23
SIGNALS = ("describe", "execute", "repeat action", "repeat both", "repeat language")
TOKENS = VOCABULARY + SIGNALS  # 28: what a query token can be
EOS = 0
WORD_INDEX = {token: i for i, token in enumerate(TOKENS)}

_FIRST_WORD = {synonym: word for word, synonym in SYNONYMS.items()}
_CLASSES = {"action": ACTIONS, "colour": COLOURS, "speed": SPEEDS}


class Meaning(NamedTuple):
    """What a sentence says: one of 36. Each word is the first of its pair of synonyms."""

    action: str
    colour: str
    speed: str


def words_of(kind: str) -> tuple[str, ...]:
    """All words of a class: first words, then their synonyms.

    Args:
        kind: `action`, `colour` or `speed`.

    Raises:
        LanguageError: there is no such class.
    """
    if kind not in _CLASSES:
        raise LanguageError(f"no word class {kind!r}; the classes are {', '.join(_CLASSES)}")
    return _CLASSES[kind] + tuple(SYNONYMS[word] for word in _CLASSES[kind])


MEANINGS = tuple(Meaning(*words) for words in product(ACTIONS, COLOURS, SPEEDS))


def sentence(meaning: Meaning, alternative: int = 0) -> str:
    """One of the eight sentences of a meaning.

    Args:
        alternative: 0 to 7. Its bits choose the synonyms: 1 for the action, 2 for the colour, 4 for
            the speed. The published files use the same order.

    Raises:
        LanguageError: `alternative` is not 0 to 7.
    """
    if not 0 <= alternative < 8:
        raise LanguageError(f"alternative {alternative} does not exist; a meaning has 8, 0 to 7")
    return " ".join(
        SYNONYMS[word] if alternative >> bit & 1 else word for bit, word in enumerate(meaning)
    )


def alternatives(meaning: Meaning) -> tuple[str, ...]:
    """The eight sentences of a meaning, in the order of `sentence`."""
    return tuple(sentence(meaning, k) for k in range(8))


def parse(text: str) -> Meaning:
    """The meaning of a sentence.

    Raises:
        LanguageError: the text is no sentence. The message lists the allowed words.
    """
    words = text.split()
    if len(words) != 3:
        raise LanguageError(
            f"a sentence has three words, action colour speed; {text!r} has {len(words)}"
        )
    for word, kind in zip(words, _CLASSES, strict=True):
        if word not in words_of(kind):
            raise LanguageError(
                f"{word!r} is no {kind} word; allowed here: {', '.join(words_of(kind))}"
            )
    return Meaning(*(_FIRST_WORD.get(word, word) for word in words))


def encode(text: str) -> list[int]:
    """Token indices of a sentence with its end tokens: `[BOS, action, colour, speed, EOS]`, N = 5.

    Raises:
        LanguageError: the text is no sentence.
    """
    parse(text)
    return [EOS, *(WORD_INDEX[word] for word in text.split()), EOS]


def decode(indices) -> str:
    """The words of token indices, up to the first EOS.

    BOS and EOS are the same token. An EOS in the first place counts as BOS and is skipped.

    Raises:
        LanguageError: an index is not 0 to 22.
    """
    indices = [int(i) for i in indices]
    for i in indices:
        if not 0 <= i < len(VOCABULARY):
            raise LanguageError(f"token {i} is no word; words are 0 to {len(VOCABULARY) - 1}")
    if indices and indices[0] == EOS:
        indices = indices[1:]
    words = indices[: indices.index(EOS)] if EOS in indices else indices
    return " ".join(VOCABULARY[i] for i in words)


def says(indices, meaning: Meaning) -> bool:
    """Whether the output (three words, then EOS) is one of the eight sentences of `meaning`.

    This is the published rule for a correct answer.
    """
    return tuple(int(i) for i in indices) in _outputs(meaning)


@cache
def _outputs(meaning: Meaning) -> frozenset[tuple[int, ...]]:
    return frozenset(tuple(encode(text)[1:]) for text in alternatives(meaning))


@dataclass(frozen=True)
class Pattern:
    """One of the 144 patterns: an action word, on one side of an arrangement, slowly or fast.

    Attributes:
        index: 0 to 143, as in the published data.
        left: colour of the left cube.
        right: colour of the right cube.
        split: `train` or `test`, the split of the published data.
    """

    index: int
    action: str
    side: str
    speed: str
    left: str
    right: str
    split: str

    @property
    def arrangement(self) -> tuple[str, str]:
        """The colours of the left and the right cube."""
        return self.left, self.right

    @property
    def target_colour(self) -> str:
        """The colour of the cube that the arm moves, which the sentence names."""
        return self.left if self.side == "left" else self.right

    @property
    def meaning(self) -> Meaning:
        """What the sentences of this pattern say."""
        return Meaning(self.action, self.target_colour, self.speed)

    @property
    def frames(self) -> int:
        """Clip length T, 100 frames for `slowly` and 50 for `fast`."""
        return 100 if self.speed == "slowly" else 50

    @property
    def action_index(self) -> int:
        """Which of the 12 actions (action word, side, speed) this is, 0 to 11."""
        in_speed = SPEEDS.index(self.speed) * len(SIDES) + SIDES.index(self.side)
        return in_speed * len(ACTIONS) + ACTIONS.index(self.action)


# The six ordered pairs of one colour family; the second family takes the same six by renaming.
_PAIRS = ("red blue", "green red", "blue green", "blue red", "red green", "green blue")
_SECOND_FAMILY = {"red": "yellow", "green": "cyan", "blue": "violet"}
ARRANGEMENTS = tuple(tuple(pair.split()) for pair in _PAIRS) + tuple(
    tuple(_SECOND_FAMILY[colour] for colour in pair.split()) for pair in _PAIRS
)

# Each meaning has four patterns (its colour has two partners and two sides). Three are for training
# and one is for the test. So training shows every word; only the scene of a test pattern is new.
# This table says which of the four is the test pattern, counted 0 to 3 in index order. The second
# colour family has the same table as the first.
_TEST_PATTERN = {
    ("slowly", "red"): (1, 3, 0), ("slowly", "blue"): (3, 3, 1), ("slowly", "green"): (0, 3, 1),
    ("fast", "red"): (1, 2, 0), ("fast", "blue"): (1, 0, 0), ("fast", "green"): (0, 0, 0),
}  # fmt: skip
_FIRST_FAMILY = {second: first for first, second in _SECOND_FAMILY.items()}


@cache
def patterns() -> tuple[Pattern, ...]:
    """All 144 patterns in index order: `index = 72 speed + 6 arrangement + 3 side + action`."""
    seen: dict[Meaning, int] = {}
    made = []
    for speed, (left, right), side, action in product(SPEEDS, ARRANGEMENTS, SIDES, ACTIONS):
        colour = left if side == "left" else right
        meaning = Meaning(action, colour, speed)
        nth = seen[meaning] = seen.get(meaning, -1) + 1
        family = _FIRST_FAMILY.get(colour, colour)
        is_test = _TEST_PATTERN[speed, family][ACTIONS.index(action)] == nth
        split = "test" if is_test else "train"
        made.append(Pattern(len(made), action, side, speed, left, right, split))
    return tuple(made)


def pattern(index: int) -> Pattern:
    """The pattern with this index.

    Raises:
        LanguageError: `index` is not 0 to 143.
    """
    if not 0 <= index < len(patterns()):
        raise LanguageError(
            f"pattern {index} does not exist; patterns are 0 to {len(patterns()) - 1}"
        )
    return patterns()[index]


def pattern_at(arrangement: tuple[str, str], side: str, action: str, speed: str) -> Pattern:
    """The pattern of an action in an arrangement.

    Use this function instead of index arithmetic: only this module knows the order of the patterns.

    Args:
        arrangement: colours of the left and the right cube, one of `ARRANGEMENTS`.

    Raises:
        LanguageError: one of the values does not exist. The message lists the values that do.
    """
    asked = ((speed, SPEEDS), (arrangement, ARRANGEMENTS), (side, SIDES), (action, ACTIONS))
    index = 0
    for value, values in asked:
        if value not in values:
            raise LanguageError(f"no pattern with {value!r}; there are {values}")
        index = index * len(values) + values.index(value)
    return patterns()[index]


def signal_index(signal: str) -> int:
    """Token index of a task signal, 23 to 27.

    Raises:
        LanguageError: there is no such signal. The message lists the signals.
    """
    if signal not in SIGNALS:
        raise LanguageError(f"no signal {signal!r}; the signals are {', '.join(SIGNALS)}")
    return WORD_INDEX[signal]

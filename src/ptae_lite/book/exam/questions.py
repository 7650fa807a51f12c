"""What a question is, how a variant is drawn, and how it is written for a class and its teacher."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from ptae_lite.errors import PTAEError

TRIES = 100  # draws until the options of a question differ


@dataclass(frozen=True)
class Question:
    """One question with its numbers drawn.

    Attributes:
        text: the question.
        right: the right option.
        why: how one finds it.
        wrong: each wrong option, and the misconception that it shows.
        given: the numbers that were drawn, by name.
    """

    text: str
    right: str
    why: str
    wrong: dict[str, str]
    given: dict[str, float]

    @property
    def options(self) -> list[str]:
        """All options, the right one first."""
        return [self.right, *self.wrong]


BANK: dict[str, Callable[[random.Random], Question]] = {}  # by name, such as "01 spare joints"


def question(function: Callable) -> Callable:
    """Add a function that draws a question to the bank."""
    chapter = function.__module__[-2:]
    BANK[f"{chapter} {function.__name__.replace('_', ' ')}"] = function
    return function


def ask(text: str, right: str, why: str, *wrong: tuple[str, str], **given: float) -> Question:
    """A question from its wrong options as pairs. Two equal ones leave one: see `draw`."""
    return Question(text, right, why, dict(wrong), given)


def draw(name: str, seed: int = 0) -> tuple[Question, list[str]]:
    """A variant of a question, and its options in the order of the exam.

    Raises:
        PTAEError: there is no such question, or its options do not differ.
    """
    if name not in BANK:
        raise PTAEError(f"no question {name!r}; there are {', '.join(BANK)}")
    chance = random.Random(f"{name} {seed}")
    for _ in range(TRIES):
        made = BANK[name](chance)
        if len(made.wrong) == 3 and len(set(made.options)) == 4:
            return made, chance.sample(made.options, 4)
    raise PTAEError(f"the question {name!r} needs three wrong options that differ from the right")


def paper(seed: int = 0) -> str:
    """The exam as Markdown, without answers."""
    parts = [f"# Thirty questions, variant {seed}\n\nOne option is right in each.\n"]
    for number, name in enumerate(BANK, start=1):
        made, order = draw(name, seed)
        rows = "".join(f"- ({letter}) {text}\n" for letter, text in zip("abcd", order, strict=True))
        parts.append(f"**{number}.** {made.text}\n\n{rows}")
    return "\n".join(parts)


def answers(seed: int = 0) -> str:
    """The answers as Markdown, with what each wrong option shows."""
    parts = [f"# Answers to the thirty questions, variant {seed}\n"]
    for number, name in enumerate(BANK, start=1):
        made, order = draw(name, seed)
        rows = "".join(
            f"- ({letter}) {text}: {'**right.** ' + made.why if text == made.right else shows}\n"
            for letter, text in zip("abcd", order, strict=True)
            for shows in [made.wrong.get(text, "")]
        )
        parts.append(f"## {number}. {name[3:].capitalize()} (chapter {name[:2]})\n\n{rows}")
    return "\n".join(parts)

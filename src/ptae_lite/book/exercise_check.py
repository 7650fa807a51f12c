"""The check of an exercise: one sentence on what was written, and no traceback around it.

An exercise comes with a function that is given the reader's answer and returns what is wrong with
it, as one sentence that leads on, or None where nothing is. `check` says it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

UNWRITTEN = "Nothing is written here yet; replace the line that raises NotImplementedError."


class NotYet(Exception):
    """An answer that is not right yet; the message is the one sentence that helps."""

    def _render_traceback_(self) -> list[str]:
        """What IPython shows: where a check stopped is of no interest."""
        return [f"Not yet. {self}"]


def check(hint: Callable[..., str | None], *answers: Any) -> None:
    """Print "Right.", or stop with what `hint(*answers)` has to say.

    An error inside the answer comes up as it is, since its traceback names the line.

    Raises:
        NotYet: the answer is missing or not right. nbgrader counts a cell that raises as failed.
    """
    try:
        sentence = hint(*answers)
    except NotImplementedError:
        sentence = UNWRITTEN
    if sentence:
        raise NotYet(sentence)
    print("Right.")

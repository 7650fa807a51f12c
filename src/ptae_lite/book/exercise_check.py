"""The check of an exercise: it prints one sentence about the reader's code, without a traceback.

An exercise has a function `hint`. It calls the reader's function and returns one sentence about
what is wrong, or None if nothing is. `check` puts a guard between the two. The guard passes copies
of the arguments, stops a call after `LIMIT_S` seconds, and accepts only results of the kind that
the exercise asks for.
"""

from __future__ import annotations

import copy
import ctypes
import inspect
import linecache
import threading
import traceback
from collections.abc import Callable
from typing import Any

import numpy as np

LIMIT_S = 5.0  # for one call; the answers of the book need a tenth of a second
UNWRITTEN = "Nothing is written here yet; replace the line that raises NotImplementedError."
CURES = {
    "NoneType": "None (is the `return` missing?)",
    "Tensor": "a Tensor (`.numpy()` makes an array of it)",
    "generator": "a generator (`return` gives all at once, `yield` does not)",
}


class NotYet(Exception):
    """An answer that is not right yet. The message is one sentence that helps."""

    def _render_traceback_(self) -> list[str]:
        """What IPython shows instead of a traceback."""
        return [f"Not yet. {self}"]


def check(hint: Callable[..., str | None], name: str, like: Any) -> None:
    """Print "Right.", or stop with the sentence of `hint(answer)`.

    Args:
        hint: finds what is wrong with the answer.
        name: name of the answer, in the notebook that defines `hint`.
        like: an example of what the answer returns (of an array, its shape and kind of number
            count), or a function that makes the example from the arguments of a call.

    Raises:
        NotYet: the answer is missing or not right. nbgrader counts a cell that raises as failed.
    """
    answer = hint.__globals__.get(name)
    if not callable(answer):
        raise NotYet(f"There is no function `{name}`; run the cell that defines it, then this one.")
    try:
        sentence = hint(_guarded(answer, name, like))
    except NotYet:
        raise
    except Exception as error:  # of the check; the guard catches those of the answer
        sentence = (
            f"The check itself stopped with {_message(error)}, perhaps because a name that it uses "
            "was changed: restart the kernel and run all cells."
        )
    if sentence:
        raise NotYet(sentence)
    print("Right.")


def _guarded(answer: Callable, name: str, like: Any) -> Callable:
    """The answer with the guard around it. It returns what is like the example, or raises."""

    def ask(*given):
        mine = copy.deepcopy(given)
        result = _call(answer, name, mine)
        for place, (before, after) in enumerate(zip(given, mine, strict=True)):
            if not _same(before, after):
                raise NotYet(
                    f"`{name}` changes its {_parameter(answer, place)}; copy what is given before "
                    "you change it."
                )
        example = like(*copy.deepcopy(given)) if callable(like) else like
        return _fitted(result, example, f"What `{name}` returns")

    return ask


def _call(answer: Callable, name: str, given: tuple) -> Any:
    """Call the answer in a thread of its own, because a thread can be stopped on every system."""
    outcome: dict[str, Any] = {}

    def work():
        try:
            outcome["result"] = answer(*given)
        except BaseException as error:  # also SystemExit: sys.exit() must not end the check
            outcome["error"] = error

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    try:
        worker.join(LIMIT_S)
        late = worker.is_alive()
    finally:  # the reader may have pressed Stop
        _end(worker)
    if late:
        raise NotYet(
            f"`{name}` was stopped after {LIMIT_S:g} seconds; see that each of its loops ends."
        )
    error = outcome.pop("error", None)  # it refers to `outcome`: all it was given would stay
    if isinstance(error, NotImplementedError):
        raise NotYet(UNWRITTEN)
    if error is not None:
        raise NotYet(f"`{name}` stopped with {_message(error)}{_line(error, answer)}.")
    return outcome["result"]


def _end(worker: threading.Thread) -> None:
    """Stop a thread by raising SystemExit in it, up to 20 times: its code may catch everything."""
    for _ in range(20):
        if not worker.is_alive():
            return
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(worker.ident), ctypes.py_object(SystemExit)
        )
        worker.join(0.05)


def _message(error: BaseException) -> str:
    """Kind and first line of an error."""
    first = (str(error).strip().splitlines() or [""])[0].rstrip(".")
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def _line(error: BaseException, answer: Callable) -> str:
    """The innermost line of the answer's cell where the error came up."""
    code, line = getattr(answer, "__code__", None), ""
    for frame, number in traceback.walk_tb(error.__traceback__):
        if code is not None and frame.f_code.co_filename == code.co_filename:
            line = linecache.getline(code.co_filename, number).strip()
    return f", in the line `{line}`" if line else ""


def _parameter(answer: Callable, place: int) -> str:
    names = list(inspect.signature(answer).parameters)
    return f"`{names[place]}`" if place < len(names) else "arguments"


def _same(before: Any, after: Any) -> bool:
    """Whether numbers and texts did not change. A random generator may change its state."""
    if type(before) is not type(after):
        return False
    if isinstance(before, np.ndarray):
        return np.array_equal(before, after, equal_nan=before.dtype.kind == "f")
    if isinstance(before, list | tuple):
        return len(before) == len(after) and all(map(_same, before, after))
    return isinstance(before, np.random.Generator) or before is after or before == after


def _fitted(value: Any, example: Any, what: str) -> Any:
    """The value in plain types, if it is of the example's kind.

    Raises:
        NotYet: it is not.
    """
    fitted, wanted = _FITS[type(example)](value, example)
    if fitted is None:
        raise NotYet(f"{what} must be {wanted}, and it is {_described(value)}.")
    if not isinstance(example, list | tuple):
        return fitted
    item = what[0].lower() + what[1:]
    return [
        _fitted(mine, theirs, f"Item {place} of {item}")
        for place, (mine, theirs) in enumerate(zip(fitted, example, strict=True))
    ]


def _as_array(value: Any, example: np.ndarray) -> tuple[np.ndarray | None, str]:
    whole = example.dtype.kind in "iu"
    made = _numbers(value)
    fits = made is not None and made.shape == example.shape
    fits = fits and made.dtype.kind in ("iu" if whole else "iuf") and np.isfinite(made).all()
    wanted = f"an array of shape {example.shape} of {'whole' if whole else 'finite'} numbers"
    return (made if fits else None), wanted


def _as_number(value: Any, example: float) -> tuple[float | None, str]:
    made = _numbers(value)
    fits = made is not None and made.ndim == 0 and made.dtype.kind in "iuf" and np.isfinite(made)
    return (float(made) if fits else None), "one finite number"


def _as_whole_number(value: Any, example: int) -> tuple[int | None, str]:
    made = _numbers(value)
    fits = made is not None and made.ndim == 0 and made.dtype.kind in "iu"
    return (int(made) if fits else None), "one whole number"


def _as_bool(value: Any, example: bool) -> tuple[bool | None, str]:
    return (bool(value) if isinstance(value, bool | np.bool_) else None), "True or False"


def _as_text(value: Any, example: str) -> tuple[str | None, str]:
    return (str(value) if isinstance(value, str) else None), "a string"


def _as_list(value: Any, example: list | tuple) -> tuple[list | None, str]:
    fits = isinstance(value, list | tuple) or (
        isinstance(value, np.ndarray) and value.ndim == 1 and isinstance(example, list)
    )
    fits = fits and len(value) == len(example)
    return (list(value) if fits else None), f"a {type(example).__name__} of {len(example)} items"


_FITS = {
    np.ndarray: _as_array,
    int: _as_whole_number,
    float: _as_number,
    bool: _as_bool,
    str: _as_text,
    list: _as_list,
    tuple: _as_list,
}


def _numbers(value: Any) -> np.ndarray | None:
    """An array of a value: of an array, a number, or lists of numbers. None for anything else."""
    if not isinstance(value, np.ndarray | np.generic | list | tuple | int | float):
        return None
    try:
        return np.array(value)
    except Exception:  # rows of different lengths, or things in them that are no numbers
        return None


def _described(value: Any) -> str:
    """A value of the wrong kind, in words."""
    kind = type(value).__name__
    if kind in CURES:
        return CURES[kind]
    if isinstance(value, np.ndarray):
        numeric = value.dtype.kind in "iuf"
        also = "" if numeric and np.isfinite(value).all() else ", with NaN or infinity in it"
        return f"an array of shape {value.shape} of {value.dtype}{also if numeric else ''}"
    if isinstance(value, list | tuple | dict | set | str):
        return f"a {kind} of length {len(value)}"
    return repr(value) if isinstance(value, int | float | np.generic) else f"of the type {kind}"

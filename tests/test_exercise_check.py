"""The guard between a check and an answer: copies, time, errors, and kinds of values."""

import contextlib
import threading
import time

import numpy as np
import pytest
import torch

from ptae_lite.book import exercise_check
from ptae_lite.book.exercise_check import NotYet, check


def said(answer, *given, like=0.0, hint=None):
    """What a check says that asks the answer once and then, if at all, what `hint` makes of it."""
    names = {"answer": answer, "given": given, "hint": hint or (lambda made: None)}
    exec("def ask(answer): return hint(answer(*given))", names)
    try:
        check(names["ask"], "answer", like)
    except NotYet as error:
        return str(error)
    return "Right."


def test_a_check_is_one_sentence_without_a_traceback(capsys):
    assert said(lambda: 1) == "Right."
    assert capsys.readouterr().out == "Right.\n"
    assert said(lambda: 1, hint=lambda made: "Add one.") == "Add one."
    assert NotYet("Add one.")._render_traceback_() == ["Not yet. Add one."]


@pytest.mark.parametrize("answer", [None, 5, "answer"])
def test_what_is_no_function_is_said(answer):
    assert "no function `answer`" in said(answer)


def test_an_answer_that_was_never_defined_is_said():
    names = {}
    exec("def ask(answer): return answer()", names)
    with pytest.raises(NotYet, match="no function `answer`"):
        check(names["ask"], "answer", 0.0)


def test_an_error_is_said_with_its_kind_its_message_and_the_line(tmp_path):
    file, names = tmp_path / "cell.py", {"np": np}
    file.write_text(
        "def answer(x):\n    y = x\n    return helper(y)\n\n\ndef helper(y):\n    1 / y\n"
    )
    exec(compile(file.read_text(), str(file), "exec"), names)
    text = said(names["answer"], 0)
    assert "ZeroDivisionError: division by zero" in text and "`1 / y`" in text
    assert said(_raises(ValueError("one\ntwo"))).count("\n") == 0
    assert said(_raises(NotImplementedError())) == exercise_check.UNWRITTEN
    assert "SystemExit" in said(_raises(SystemExit()))
    assert "RecursionError" in said(_deeper)


def _raises(error):
    def answer():
        raise error

    return answer


def _deeper():
    return _deeper()


def _loop():
    while True:
        pass


def _catches():
    end = time.monotonic() + 2
    while time.monotonic() < end:
        with contextlib.suppress(BaseException):
            time.sleep(0.01)


def _sleeps():
    time.sleep(2)


@pytest.mark.parametrize("answer", [_loop, _catches, _sleeps])
def test_an_answer_that_does_not_end_is_stopped(answer, monkeypatch):
    monkeypatch.setattr(exercise_check, "LIMIT_S", 0.1)
    before, end = threading.active_count(), time.monotonic() + 20
    assert "stopped after 0.1 seconds" in said(answer)
    while threading.active_count() > before and time.monotonic() < end:
        time.sleep(0.02)
    assert threading.active_count() == before  # nothing goes on behind the check


def test_an_answer_has_its_own_copies_and_may_not_change_them():
    array, numbers, rng = np.zeros(3), [[1], 2], np.random.default_rng(0)

    def adds(x, numbers, rng):
        x += 1

    def appends(x, numbers, rng):
        numbers[0].append(1)

    assert "changes its `x`" in said(adds, array, numbers, rng)
    assert "changes its `numbers`" in said(appends, array, numbers, rng)
    assert not array.any() and numbers == [[1], 2]
    assert said(lambda x, numbers, rng: rng.random(), array, numbers, rng) == "Right."
    assert said(lambda x: 0, np.array([np.nan])) == "Right."


ARRAY, PAIRS = np.zeros((2, 3)), [(np.zeros(2, int), ["", ""])] * 2


@pytest.mark.parametrize(
    ("value", "like", "made"),
    [
        (np.ones((2, 3), np.float32), ARRAY, np.ones((2, 3))),
        ([[1, 2, 3], (4, 5, 6.5)], ARRAY, np.array([[1, 2, 3], [4, 5, 6.5]])),
        (np.float32(2), 0.0, 2.0),
        (np.array(2), 0.0, 2.0),
        (np.int64(2), 1, 2),
        (np.bool_(True), True, True),
        (np.str_("held"), "", "held"),
        ([[np.arange(2), np.array(["a", "b"])]] * 2, PAIRS, [[np.arange(2), ["a", "b"]]] * 2),
    ],
)
def test_what_is_of_the_right_kind_comes_as_plain_python(value, like, made):
    found = []
    assert said(lambda: value, like=like, hint=lambda value: found.append(value)) == "Right."
    assert str(found[0]) == str(made) or np.array_equal(found[0], made)
    assert found[0] is not value or isinstance(value, str | bool)


@pytest.mark.parametrize(
    ("value", "like", "words"),
    [
        (None, ARRAY, ("(2, 3)", "None", "return")),
        (np.ones((3, 2)), ARRAY, ("(2, 3)", "(3, 2)")),
        (np.full((2, 3), np.nan), ARRAY, ("(2, 3)", "NaN")),
        (np.full((2, 3), "a"), ARRAY, ("numbers", "<U1")),
        (np.full((2, 3), None), ARRAY, ("numbers", "object")),
        (np.ones((2, 3), bool), ARRAY, ("numbers", "bool")),
        (torch.zeros(2, 3), ARRAY, ("(2, 3)", "Tensor", "numpy()")),
        (torch.zeros(2, 3, device="meta"), ARRAY, ("(2, 3)", "Tensor")),
        ([[1, 2], [3]], ARRAY, ("(2, 3)", "list")),
        (np.zeros(2), np.zeros(2, int), ("whole", "float64")),
        ("0", 0.0, ("number", "str")),
        (True, 0.0, ("number", "True")),
        (2.5, 1, ("whole number", "2.5")),
        (True, 1, ("whole number", "True")),
        (float("inf"), 0.0, ("number", "inf")),
        ([1.0], 0.0, ("number", "list")),
        (torch.tensor(1.0), 0.0, ("number", "Tensor")),
        (1, True, ("True or False", "1")),
        (b"held", "held", ("string", "bytes")),
        ((x for x in PAIRS), PAIRS, ("list of 2", "generator")),
        (PAIRS[:1], PAIRS, ("list of 2", "length 1")),
        ([PAIRS[0], (np.zeros(2, int), [1, 2])], PAIRS, ("Item 0 of item 1 of item 1", "string")),
        (np.zeros((2, 2)), (ARRAY, ARRAY), ("tuple of 2", "array")),
    ],
)
def test_what_is_of_another_kind_is_said_beside_what_was_asked(value, like, words):
    text = said(lambda: value, like=like)
    assert all(word in text for word in words), text
    assert text.endswith(".") and "\n" not in text


def test_the_example_may_depend_on_the_arguments():
    def like(x):
        return np.zeros(len(x))

    assert said(lambda x: x + 1, np.zeros(4), like=like) == "Right."
    assert "(4,)" in said(lambda x: x[:3], np.zeros(4), like=like)


def test_a_check_that_fails_itself_is_said_without_a_traceback():
    assert "restart the kernel" in said(lambda: 1, hint=lambda made: made.missing)

"""Thirty exam questions, each with its answer and what each wrong option shows.

`run.py course OUT --seed 7` writes a variant: the functions of the modules `chapter_NN` draw the
numbers and compute the answers, so a published answer is of no use. To change a question, edit its
function. To add one, write another under `@question`.
"""

from ptae_lite.book.exam import (  # noqa: F401 - each adds its questions to the bank
    chapter_01,
    chapter_02,
    chapter_03,
    chapter_04,
    chapter_05,
    chapter_06,
    chapter_07,
)
from ptae_lite.book.exam.questions import BANK, Question, answers, draw, paper

__all__ = ["BANK", "Question", "answers", "draw", "paper"]

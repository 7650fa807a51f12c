"""What a teacher reads of the chapters: outcomes, minutes, and answers to all exercises."""

from pathlib import Path

import pytest

from ptae_lite.book import outcomes
from ptae_lite.errors import ArtefactError

BOOK = Path(__file__).resolve().parents[1] / "book"


# ---------------------------------------------------------------- a small book

CHAPTER = """\
# X

**After this chapter you can**

- do one
  thing;
- do another.

**Time:** an hour.

## First part

*7 minutes*

Text.

## Summary

## Exercises

1. *Think.* Why
   so?
2. Do it.
"""


@pytest.fixture
def book(tmp_path):
    (tmp_path / "exercises").mkdir()
    (tmp_path / "index.md").write_text("```{toctree}\n:caption: Chapters\n\n01_simulation\n```\n")
    (tmp_path / "01_simulation.md").write_text(CHAPTER)
    sheet = (BOOK / "exercises" / "01_simulation.md").read_text("utf-8")
    (tmp_path / "exercises" / "01_simulation.md").write_text(sheet, encoding="utf-8")
    return tmp_path


def mapped(book, text):
    (book / "exercises" / outcomes.MAP).write_text(f"[01_simulation]\n{text}\n")
    return book


GOOD = '"do one thing" = ["First part", "1.1", "end 2"]\n"do another" = ["First part"]'


def test_a_chapter_says_what_it_teaches(book):
    (lesson,) = outcomes.lessons(book)
    assert lesson.outcomes == ["do one thing", "do another"]
    assert lesson.minutes == {"First part": 7, "Summary": None, "Exercises": None}
    assert lesson.at_end == ["*Think.* Why so?", "Do it."]


def test_tables_show_where_an_outcome_is_taught(book):
    html = outcomes.Outcomes(mapped(book, GOOD))._repr_html_()
    assert "<td>do one thing</td><td>First part</td><td>1.1, 2 at its end</td>" in html
    assert "<td>First part 7</td><td>7</td>" in outcomes.Minutes(book)._repr_html_()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (GOOD.replace("do another", "do less"), "differ in the outcomes: do another"),
        ("\n".join(reversed(GOOD.split("\n"))), "differ in the outcomes: their order"),
        (GOOD.replace("end 2", "end 3"), "there is no 'end 3'"),
        (GOOD.replace("1.1", "1.9"), "there is no '1.9'"),
        (GOOD.replace('"First part", "1.1"', '"1.1"'), "no section serves 'do one thing'"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(book, text, complaint):
    with pytest.raises(ArtefactError, match=complaint):
        outcomes.served(mapped(book, text))


def test_a_chapter_without_outcomes_or_map_is_named(book):
    with pytest.raises(ArtefactError, match=r"no part \[01_simulation\]"):
        (book / "exercises" / outcomes.MAP).write_text("")
        outcomes.served(book)
    (book / "01_simulation.md").write_text("# X\n\nText.\n")
    with pytest.raises(ArtefactError, match="needs a list below"):
        outcomes.lessons(book)

"""What a teacher reads of the chapters: outcomes, minutes, and answers to all exercises."""

import re
from pathlib import Path

import pytest

from ptae_lite.book import outcomes
from ptae_lite.errors import ArtefactError

BOOK = Path(__file__).resolve().parents[1] / "book"
ANSWER = re.compile(r'^## (\d\d), (\d+): "([^"\n]+)"\n\n(.+?)(?=^## |\Z)', re.M | re.S)


def test_each_outcome_is_taught_and_each_section_and_exercise_serves_one():
    served = outcomes.served(BOOK)
    used = {place for of in served.values() for places in of.values() for place in places}
    for lesson in outcomes.lessons(BOOK):
        taught = {place for places in served[lesson.name].values() for place in places}
        timed = {title for title, minutes in lesson.minutes.items() if minutes}
        assert timed <= taught, (lesson.name, timed - taught)
        assert {f"end {i + 1}" for i in range(len(lesson.at_end))} <= taught, lesson.name
    numbers = {one.number for sheet in outcomes.Exercises(BOOK / "exercises").sheets
               for one in sheet.exercises}  # fmt: skip
    assert numbers <= used, numbers - used


def test_each_section_of_a_chapter_has_its_minutes():
    for lesson in outcomes.lessons(BOOK):
        without = {title for title, minutes in lesson.minutes.items() if minutes is None}
        assert without <= {"Summary", "How this differs from the paper", "Exercises"}, lesson.name
        limit = 95 if lesson.name.startswith("03") else 65
        assert 25 < sum(filter(None, lesson.minutes.values())) <= limit, lesson.name


def test_each_exercise_at_a_chapters_end_has_an_answer():
    text = (BOOK / "exercises" / "chapter_answers.md").read_text("utf-8")
    answers = {(chapter, int(number)): (words, answer)
               for chapter, number, words, answer in ANSWER.findall(text)}  # fmt: skip
    asked = {(lesson.name[:2], i): one for lesson in outcomes.lessons(BOOK)
             for i, one in enumerate(lesson.at_end, start=1)}  # fmt: skip
    assert set(answers) == set(asked)
    for key, (words, answer) in answers.items():
        assert words in asked[key].replace("*", ""), key
        assert len(answer.split()) > 25, key


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

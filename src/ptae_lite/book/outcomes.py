"""What each chapter teaches: its outcomes, its sections with their minutes, its exercises.

A chapter lists its outcomes at its top, and each section has its minutes in a line below the
heading. `exercises/outcomes.toml` says which sections and which exercises serve an outcome.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from html import escape
from pathlib import Path

from ptae_lite.book import exercises
from ptae_lite.book.chapters import EXERCISES, chapter_files
from ptae_lite.errors import ArtefactError

MAP = "outcomes.toml"
END = re.compile(r"end (\d+)$")  # an exercise at the end of the chapter, such as "end 2"
_LIST = re.compile(r"^\*\*(?:After this|You will)[^*\n]+\*\*\n\n(.+?)\n\n", re.M | re.S)
_SECTION = re.compile(r"^## (.+)\n(?:\n\*(\d+) minutes?\*$)?", re.M)
_AT_END = re.compile(r"^## Exercises\n(.*)", re.M | re.S)


@dataclass(frozen=True)
class Lesson:
    """A chapter as its teacher sees it.

    Attributes:
        name: such as "01_simulation".
        outcomes: what one can do after it.
        minutes: of each section by its heading; None where the chapter names none.
        at_end: the exercises at its end, as Markdown.
    """

    name: str
    outcomes: list[str]
    minutes: dict[str, int | None]
    at_end: list[str]


def lesson(md: Path) -> Lesson:
    """What a chapter's source says of itself.

    Raises:
        ArtefactError: it lists no outcomes.
    """
    text = md.read_text(encoding="utf-8")
    found = _LIST.search(text)
    if not found:
        raise ArtefactError(f"{md.name} needs a list below **After this chapter you can**.")
    outcomes = [" ".join(one.split()).rstrip(";.") for one in found[1].split("- ")[1:]]
    minutes = {title: int(m) if m else None for title, m in _SECTION.findall(text)}
    end = _AT_END.search(text)
    asked = re.split(r"^\d+\. ", end[1], flags=re.M)[1:] if end else []
    at_end = [" ".join(one.split()) for one in asked]
    return Lesson(md.stem, outcomes, minutes, at_end)


def lessons(book: Path) -> list[Lesson]:
    """All chapters in order."""
    return [lesson(md) for md in chapter_files(book)]


def served(book: Path) -> dict[str, dict[str, list[str]]]:
    """Sections and exercises of each outcome of each chapter, as the file says.

    Raises:
        ArtefactError: the file names another outcome than the chapter, a section or an exercise
            that does not exist, or none of them.
    """
    path = Path(book, EXERCISES, MAP)
    said = tomllib.loads(path.read_text(encoding="utf-8"))
    numbers = {one.number for sheet in exercises.sheets(path.parent) for one in sheet.exercises}
    for one in lessons(book):
        map_of = said.get(one.name)
        if map_of is None:
            raise ArtefactError(f"{MAP} has no part [{one.name}].")
        if list(map_of) != one.outcomes:
            differ = sorted({*map_of} ^ {*one.outcomes}) or ["their order"]
            raise ArtefactError(f"{MAP} and {one.name} differ in the outcomes: {differ[0]}.")
        known = {*one.minutes, *numbers, *(f"end {i + 1}" for i in range(len(one.at_end)))}
        for outcome, places in map_of.items():
            if missing := sorted({*places} - known):
                raise ArtefactError(f"{MAP}, {one.name}: there is no {missing[0]!r}.")
            if not {*places} & {*one.minutes}:
                raise ArtefactError(f"{MAP}, {one.name}: no section serves {outcome!r}.")
    return said


class Outcomes:
    """A table of all outcomes: where each is taught, and where it is practised."""

    def __init__(self, book: Path | str = "."):
        self.lessons, self.served = lessons(Path(book)), served(Path(book))

    def _repr_html_(self) -> str:
        rows = []
        for one in self.lessons:
            for outcome, places in self.served[one.name].items():
                taught = [place for place in places if place in one.minutes]
                asked = [END.sub(r"\1 at its end", p) for p in places if p not in one.minutes]
                rows.append((one.name[:2], outcome, "; ".join(taught), ", ".join(asked)))
        return table(("", "after the chapter, one can", "sections", "exercises"), rows)


class Minutes:
    """A table of the minutes of each section, and of each chapter's sum."""

    def __init__(self, book: Path | str = "."):
        self.lessons = [one for one in lessons(Path(book)) if any(one.minutes.values())]

    def _repr_html_(self) -> str:
        rows = []
        for one in self.lessons:
            timed = {title: m for title, m in one.minutes.items() if m}
            each = "; ".join(f"{title} {m}" for title, m in timed.items())
            rows.append((one.name[:2], each, f"{sum(timed.values())}"))
        return table(("", "minutes of each section", "sum"), rows)


def table(heads: tuple, rows: list[tuple]) -> str:
    """Rows of text as an HTML table."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(_plain(text))}</td>' for text in row)}</tr>" for row in rows
    )
    return f'<table class="contents"><thead><tr>{head}</tr></thead>{body}</table>'


def _plain(text: str) -> str:
    """Markdown without its marks for emphasis and code."""
    return re.sub(r"[*`]", "", text)


class Exercises:
    """The exercises of all chapters, for the course's page."""

    def __init__(self, folder: Path | str = EXERCISES):
        self.sheets = exercises.sheets(Path(folder))

    def _repr_html_(self) -> str:
        rows = [
            (one.number, one.title, one.kind.lower(), f"{one.minutes}")
            for sheet in self.sheets
            for one in sheet.exercises
        ]
        return table(("", "exercise", "kind", "minutes"), rows)

"""The front page's table of chapters: what each chapter says of itself.

Each chapter says at its top what it takes: `**Time:** ...` and `**Prerequisites:** ...`.
"""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import NamedTuple

from ptae_lite.book.chapters import chapter_files
from ptae_lite.errors import PTAEError

# Of Markdown in these lines: a link keeps its text, and what is emphasised its words.
_MARKS = re.compile(r"\[([^]]+)\]\([^)]+\)|\*")
_FACTS = re.compile(r"\*\*Time:\*\* (.+?)\s\*\*Prerequisites:\*\* (.+?)\n\n", re.DOTALL)


class Chapter(NamedTuple):
    """One chapter: its file without ending, its title, its time, and what it needs."""

    file: str
    title: str
    time: str
    needs: str


def chapter(md: Path) -> Chapter:
    """What a chapter's source says of itself.

    Raises:
        PTAEError: it has no title, no time or no prerequisites.
    """
    text = md.read_text(encoding="utf-8")
    title, facts = re.search(r"^# (.+)$", text, re.MULTILINE), _FACTS.search(text)
    if not title or not facts:
        raise PTAEError(f"{md.name} needs a title, and lines **Time:** and **Prerequisites:**")
    time, needs = (" ".join(_MARKS.sub(r"\1", fact).split()) for fact in facts.groups())
    time, needs = (fact.split(". ")[0].rstrip(".") for fact in (time, needs))
    return Chapter(md.stem, title[1], re.split(" of | with |, ", time)[0], needs)


class Contents:
    """The table of all chapters in a folder, with links to their pages."""

    def __init__(self, book: Path | str = "."):
        self.chapters = [chapter(md) for md in chapter_files(Path(book))]

    def _repr_html_(self) -> str:
        rows = "".join(
            f'<tr><td>{number}</td><td><a href="{one.file}.html">{escape(one.title)}</a></td>'
            f"<td>{escape(one.time)}</td><td>{escape(one.needs)}</td></tr>"
            for number, one in enumerate(self.chapters, start=1)
        )
        heads = "".join(f"<th>{head}</th>" for head in ("", "chapter", "time", "prerequisites"))
        return f'<table class="contents"><thead><tr>{heads}</tr></thead>{rows}</table>'

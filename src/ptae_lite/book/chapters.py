"""Which files are chapters: those in the table of contents "Chapters" of `index.md`.

Beside them stand the pages of "In depth", which are notebooks in pairs, like the chapters.
Other files beside them, such as a copy that a reader made in JupyterLab, belong to the reader. They
are no chapter, no page and no test, and a command that leaves them out says so.
"""

from __future__ import annotations

import re
from pathlib import Path

from ptae_lite.errors import ArtefactError

EXERCISES = "exercises"  # a folder of the book that holds no pages
IN_DEPTH, DEPTH_CAPTION = "in_depth", "In depth"  # a folder, and its heading in the site's menu
_TOCTREE = re.compile(r"^```\{toctree\}\n(.*?)^```", re.MULTILINE | re.DOTALL)


def chapter_names(book: Path) -> list[str]:
    """The chapters' names, such as "01_simulation".

    Raises:
        ArtefactError: `index.md` lists no chapters.
    """
    for options, named in _tables(Path(book) / "index.md"):
        if ":caption: Chapters" in options and named:
            return named
    raise ArtefactError(f"{Path(book, 'index.md')} lists no chapters; the book's own does.")


def in_depth_names(book: Path) -> list[str]:
    """The pages of the table "In depth" ("in_depth/02_encoders"), of which there may be none."""
    for options, named in _tables(Path(book) / "index.md"):
        if f":caption: {DEPTH_CAPTION}" in options:
            return named
    return []


def chapter_files(book: Path) -> list[Path]:
    """The chapters' sources in order."""
    return [Path(book, f"{name}.md") for name in chapter_names(book)]


def notebook_files(book: Path, names: list[str] | None = None) -> list[Path]:
    """The sources of the chapters, then of the pages in depth; with `names`, only those.

    Raises:
        ArtefactError: there is no such chapter or page.
    """
    there = {Path(name).stem: name for name in [*chapter_names(book), *in_depth_names(book)]}
    wanted = [Path(name).stem for name in names] if names else list(there)
    for name in wanted:
        if name not in there:
            raise ArtefactError(f"No chapter {name} in {book}; there are: {', '.join(there)}.")
    return [Path(book, f"{there[name]}.md") for name in wanted]


def page_names(book: Path) -> set[str]:
    """Every page of the site, such as "api/data": `index`, and all that it leads to."""
    found, todo = set(), ["index"]
    while todo:
        page = todo.pop()
        if page not in found:
            found.add(page)
            folder = Path(page).parent
            for _, named in _tables(Path(book, f"{page}.md")):
                todo += [(folder / name).as_posix() for name in named]
    return found


def left_out(book: Path) -> list[str]:
    """Sources and notebooks in the book's folder that are neither a page nor a chapter's twin."""
    pages, found = page_names(book), []
    for path in sorted(Path(book).rglob("*")):
        inside = path.relative_to(book)
        if any(part.startswith((".", "_")) or part == EXERCISES for part in inside.parts):
            continue
        page = inside.with_suffix("").as_posix()
        if inside.suffix in (".md", ".ipynb") and page not in pages:
            found.append(inside.as_posix())
    return found


def notice(book: Path) -> str:
    """A line that names the files that are left out; empty if there are none."""
    names = left_out(book)
    return f"Left out, since index.md does not list them: {', '.join(names)}" if names else ""


def _tables(page: Path) -> list[tuple[list[str], list[str]]]:
    """The tables of contents of a page: the options and the documents of each."""
    text = page.read_text(encoding="utf-8") if page.is_file() else ""
    tables = []
    for body in _TOCTREE.findall(text):
        lines = [line.strip() for line in body.splitlines() if line.strip()]
        options = [line for line in lines if line.startswith(":")]
        tables.append((options, [line for line in lines if line not in options]))
    return tables

"""The slides of all chapters, and the pages about the course and its data, as files.

They need no network: reveal.js and MathJax come from packages of the environment, and the script of
the 3-D scenes is our own.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from html import escape
from pathlib import Path

from nbformat import NotebookNode

from ptae_lite.book import notebooks, numbers, slides
from ptae_lite.book.chapters import chapter_files
from ptae_lite.widgets import viewer

PAGES = ("course", "data_sheet", "model_cards")  # of the site, which a teacher wants as files
REVEAL = {"dist/reveal.css": "reveal.css", "dist/reveal.js": "reveal.js",
          "plugin/notes/notes.js": "notes.js", "LICENSE": "LICENSE"}  # fmt: skip
_DIRECTIVE = re.compile(r"^```\{.*?^```$", re.MULTILINE | re.DOTALL)
_STYLE = """body { font: 17px/1.5 system-ui, sans-serif; max-width: 60em; margin: 2em auto; }
table { border-collapse: collapse; } td, th { padding: 3px 10px; border-bottom: 1px solid #ccc;
text-align: left; vertical-align: top; }"""


def files(book: Path, show: Callable[[Path], None] = lambda md: None) -> dict[str, bytes]:
    """The contents of the files by name, such as "slides/01_simulation.html".

    Each chapter runs once, which takes minutes for all of them.

    Args:
        book: the folder of the chapters.
        show: called with the source of each page before it runs.
    """
    made, titles = {}, {}
    for md in (Path(book, f"{name}.md") for name in PAGES):  # first, for they are quick to fail
        if md.is_file():
            show(md)
            made[f"{md.stem}.html"] = document(ran(md)).encode()
    for md in filter(Path.is_file, chapter_files(book)):
        show(md)
        sections = slides.cut(ran(md))
        titles[md.stem] = sections[0].title
        made[f"slides/{md.stem}.html"] = slides.page(sections).replace(viewer.ROOT, "").encode()
    if titles:
        made["slides/index.html"] = contents(titles).encode()
        made |= {f"slides/_static/{name}": data for name, data in scripts().items()}
    return made


def ran(md: Path) -> NotebookNode:
    """A page of the book after a run without a reader, with the numbers in its text."""
    notebook = notebooks.read(md)
    numbers.ask(notebook)
    notebooks.execute(notebook, md.parent.resolve(), static=True)
    values = iter(numbers.take(notebook))
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = numbers.fill(cell.source, values)
    return notebook


def scripts() -> dict[str, bytes]:
    """What slides load, by its place in `_static/`."""
    reveal = _package("sphinx_revealjs") / "_static" / "revealjs"
    made = {f"reveal/{name}": (reveal / path).read_bytes() for path, name in REVEAL.items()}
    mathjax = _package("sphinx-mathjax-offline") / "static" / "mathjax" / "tex-svg.js"
    made["vendor/tex-svg.js"] = mathjax.read_bytes()
    made[Path(viewer.SHARED_SCRIPT).name] = viewer.shared_script()
    return made


def _package(name: str) -> Path:
    """The folder of an installed package, which is not imported."""
    return Path(importlib.util.find_spec(name).origin).parent


def contents(titles: dict[str, str]) -> str:
    """A page that leads to the slides of each chapter."""
    links = "".join(
        f'<li><a href="{name}.html">{escape(title)}</a></li>' for name, title in titles.items()
    )
    about = "Arrows turn the pages, S opens the speaker's notes, F fills the screen."
    return _html("Slides", f"<h1>Slides</h1><ol>{links}</ol><p>{about}</p>")


def document(notebook: NotebookNode) -> str:
    """A page of text and tables as plain HTML."""
    parts, title = [], ""
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            source = _DIRECTIVE.sub("", cell.source)
            title = title or source.split("\n")[0].removeprefix("# ")
            parts.append(slides.as_html(source))
        elif cell.cell_type == "code":
            parts += [output.data["text/html"] for output in cell.outputs
                      if "text/html" in output.get("data", {})]  # fmt: skip
    return _html(title, "\n".join(parts))


def _html(title: str, body: str) -> str:
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>{body}</body></html>\n"
    )

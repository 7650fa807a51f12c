"""Slides of a chapter, from the chapter itself: what it shows becomes slides, its prose the notes.

The chapter runs once. Each section is a stack of slides, and a slide is one of:

- a figure, a panel, a scene or a table, with its caption;
- a cell of shown code with what it printed; folded code is left out;
- a formula that stands alone, with the paragraph before it;
- a question to guess;
- a box, such as a key result; a list.

The other paragraphs are speaker's notes (key S) of the slide that follows them. Exercises, details
to unfold, and boxes that only lead elsewhere are left out.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files

from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin
from nbformat import NotebookNode
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

from ptae_lite.book import marks, notebooks, numbers

LEFT_OUT = ("Exercises",)  # sections: they are notebooks of their own
LEADS_AWAY = "In depth"  # title of the boxes that are only links
GUESS = 'data-ptae-embed="guess"'
SEEN = re.compile(r"<(?:img|svg|table|iframe|input|select|button)\b")  # more than a line of text
IMAGES = {"image/svg+xml": "svg+xml", "image/png": "png", "image/jpeg": "jpeg"}
KINDS = {"heading_open", "paragraph_open", "blockquote_open", "math_block", "table_open"}
LISTS = {"bullet_list_open", "ordered_list_open"}
_ROLE = re.compile(r"\{\w+\}`([^`<]+?)(?: <[^>]*>)?`")
_DETAILS = re.compile(r"^<details>.*?^</details>", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"</?a\b[^>]*>")
_BOLD = re.compile(r"\*\*(.+?)\*\*\s*(.*)", re.DOTALL)


def _math(content: str, options: dict) -> str:
    """A formula as MathJax reads it."""
    text = escape(content.strip())
    return f"\\[{text}\\]" if options["display_mode"] else f"\\({text}\\)"


_MARKDOWN = MarkdownIt("commonmark", {"html": True}).enable("table")
_MARKDOWN.use(dollarmath_plugin, renderer=_math, allow_space=False)


@dataclass
class Slide:
    """One slide: its kind, its content as HTML, and what is said with it."""

    kind: str
    html: str
    caption: str = ""
    notes: list[str] = field(default_factory=list)


@dataclass
class Section:
    """The slides of a section, of which the first has its title."""

    title: str
    slides: list[Slide]


def as_html(text: str) -> str:
    """Markdown as HTML without links, which would lead out of the slides."""
    text = _ROLE.sub(_named, numbers.COMMENT.sub("", text))
    return _LINK.sub("", _MARKDOWN.render(text))


def _named(role: re.Match) -> str:
    """A role such as {doc}`01_simulation` in words."""
    chapter = re.fullmatch(r"(\d\d)_\w+", role[1])
    return f"chapter {chapter[1]}" if chapter else role[1].replace("_", " ")


def blocks(text: str) -> Iterator[tuple[str, str]]:
    """The kind and the source of each paragraph, heading, list, ... of a text."""
    lines = text.split("\n")
    for token in _MARKDOWN.parse(text):
        if token.level == 0 and token.map:
            yield token.type, "\n".join(lines[token.map[0] : token.map[1]]).strip()


class _Cutter:
    """Goes through a notebook that has run, and collects its sections."""

    def __init__(self):
        self.sections: list[Section] = []
        self.notes: list[str] = []

    def add(self, kind: str, html: str) -> None:
        self.sections[-1].slides.append(Slide(kind, html, notes=self.notes))
        self.notes = []

    def close(self) -> None:
        """What is said after the last slide of a section belongs to that slide."""
        if self.sections:
            self.sections[-1].slides[-1].notes += self.notes
            self.notes = []

    def text(self, source: str) -> None:
        for kind, block in blocks(_DETAILS.sub("", source)):
            start = _BOLD.match(block.replace("\n> ", "\n").removeprefix("> "))
            if kind == "heading_open":
                self.heading(block)
            elif kind == "blockquote_open" and start and not start[1].startswith(LEADS_AWAY):
                title = start[1].rstrip(".:")
                self.add("box", f"<h3>{escape(title)}</h3>{as_html(start[2])}")
            elif kind == "math_block":
                before = as_html(self.notes.pop()) if self.notes else ""
                self.add("formula", before + as_html(block))
            elif kind in LISTS or kind == "table_open":
                leads = self.notes and self.notes[-1].rstrip("*").endswith(("can", "learn", ":"))
                before = as_html(self.notes.pop()) if leads else ""
                self.add("list", before + as_html(block))
            elif kind == "paragraph_open" and start and marks.CAPTION.match(start[1]):
                self.caption(block)
            elif kind == "paragraph_open" and marks.MINUTES.match(block.strip("*")):
                self.sections[-1].slides[-1].caption = as_html(block)
            elif kind == "paragraph_open":
                self.notes.append(block)

    def heading(self, block: str) -> None:
        level, title = block.split(" ", 1)
        if level in ("#", "##"):
            self.close()
            kind = "title" if level == "#" else "section"
            self.sections.append(Section(title, []))
            self.add(kind, f"<h{len(level)}>{as_html(title)}</h{len(level)}>")
        else:
            self.notes.append(f"**{title}**")

    def caption(self, block: str) -> None:
        """A caption stands below its figure; without one before it, it is only said."""
        shown = [one for one in self.sections[-1].slides if one.kind == "figure"]
        if shown and not shown[-1].caption:
            shown[-1].caption = as_html(block)
        else:
            self.notes.append(block)

    def code(self, cell: NotebookNode) -> None:
        folded = {*notebooks.FOLDED, "remove-cell"} & set(cell.metadata.get("tags", []))
        outputs = [one for one in cell.outputs if not (folded and _is_value(one))]
        made = [one for one in map(_output, outputs) if one]
        text = "\n".join(text.strip("\n") for kind, text in made if kind == "printed")
        printed = f"<pre>{escape(text)}</pre>" if text else ""
        if not folded:
            code = highlight(cell.source, PythonLexer(), HtmlFormatter())
            self.add("code", code + printed)
        elif printed:
            self.add("code", printed)
        alt = cell.metadata.get("mystnb", {}).get("image", {}).get("alt", "")
        for kind, html in made:
            if kind != "printed":
                self.add(kind, html.replace('alt=""', f'alt="{escape(alt)}"', 1))


def _is_value(output: NotebookNode) -> bool:
    """Whether an output is only the value of a cell's last line, in text."""
    return output.output_type == "execute_result" and set(output.data) == {"text/plain"}


def _output(output: NotebookNode) -> tuple[str, str] | None:
    """The kind of slide that an output of a cell makes, and its HTML, or what was printed."""
    if output.output_type == "stream":
        return ("printed", output.text) if output.name == "stdout" else None
    data = output.get("data", {})
    if html := data.get("text/html"):
        if GUESS in html:
            return "guess", html
        return ("figure", html) if SEEN.search(html) else None
    for mime, kind in IMAGES.items():
        if mime in data:
            return (
                "figure",
                f'<div class="image"><img alt="" src="{_address(data[mime], kind)}"></div>',
            )
    text = data.get("text/plain")
    return ("printed", text) if text else None


def _address(image: str, kind: str) -> str:
    """An image as an address that holds it. As an image, a drawing keeps its names to itself."""
    text = base64.b64encode(image.encode()).decode() if kind == "svg+xml" else image.strip()
    return f"data:image/{kind};base64,{text}"


def cut(notebook: NotebookNode) -> list[Section]:
    """The sections of a chapter that has run, with their slides."""
    cutter = _Cutter()
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cutter.text(cell.source)
        elif cell.cell_type == "code":
            cutter.code(cell)
    cutter.close()
    return [one for one in cutter.sections if one.title not in LEFT_OUT]


def page(sections: list[Section]) -> str:
    """The slides as a page of HTML. Scripts and styles are in `_static/` beside it."""
    title = sections[0].title
    stacks = []
    for section in sections:
        made = "".join(_slide(one, section.title, title) for one in section.slides)
        stacks.append(f"<section>{made}</section>")
    parts = {
        "CODE_STYLE": HtmlFormatter(style="default").get_style_defs(".highlight"),
        "TITLE": escape(title),
        "SLIDES": "\n".join(stacks),
    }
    text = files(__package__).joinpath("slides.html").read_text(encoding="utf-8")
    return re.sub("@(CODE_STYLE|TITLE|SLIDES)@", lambda found: parts[found[1]], text)


def _slide(one: Slide, section: str, chapter: str) -> str:
    head = "" if one.kind in ("title", "section") else f"<header>{escape(section)}</header>"
    above = f"<p class='of'>{escape(chapter)}</p>" if one.kind == "section" else ""
    caption = f'<div class="caption">{one.caption}</div>' if one.caption else ""
    notes = "".join(map(as_html, one.notes))
    return (
        f'<section class="{one.kind}">{head}'
        f'<div class="body"><div class="content">{above}{one.html}{caption}</div></div>'
        f'<aside class="notes">{notes}</aside></section>\n'
    )

"""What the site makes of plain Markdown: boxes, captions, minutes, links, numbers.

A chapter is read as a page of the site and in JupyterLab, which understands plain Markdown only. So
its source has no directives. A box is a quotation that begins with bold words, a caption is a
paragraph that begins with **Figure 1.2.**, and so on. These functions change them into boxes,
captions and links of the page.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from docutils import nodes
from sphinx import addnodes

from ptae_lite.book import chapters, numbers

FACTS = re.compile(r"^(Time|Prerequisites|You will learn|After this chapter you can):?")
CAPTION = re.compile(r"^(?:Figure|Table) (\d+(?:\.\d+)?)\.?$")
MINUTES = re.compile(r"^\d+ minutes?$")
CHAPTER = re.compile(r"\b[Cc]hapter (\d\d)\b")
FIGURE = re.compile(r"\b([Ff]igure|[Tt]able) (\d+\.\d+)\b")
TERM = re.compile(r"^(?! )(.+)\n  ", re.MULTILINE)


def first(paragraph: nodes.Node):
    """The first part of a paragraph that has text; None if there is none."""
    return next((part for part in paragraph.children if part.astext()), None)


def facts(app, doctree) -> None:
    """Mark the paragraphs and lists about a chapter's time and prerequisites."""
    for paragraph in list(doctree.findall(nodes.paragraph)):
        bold = first(paragraph)
        if isinstance(bold, nodes.strong) and FACTS.match(bold.astext()):
            paragraph["classes"].append("facts")
            after = paragraph.next_node(descend=False, siblings=True)
            if isinstance(after, nodes.bullet_list):
                after["classes"].append("facts")


def boxes(app, doctree) -> None:
    """Change each quotation that begins with bold words into a box with this title."""
    for quote in list(doctree.findall(nodes.block_quote)):
        paragraph = quote[0]
        if not isinstance(paragraph, nodes.paragraph) or not isinstance(
            bold := first(paragraph), nodes.strong
        ):
            continue
        title = bold.astext().rstrip(".:")
        paragraph.remove(bold)
        if paragraph.children and isinstance(paragraph[0], nodes.Text):
            paragraph[0] = nodes.Text(paragraph[0].lstrip())
        if not paragraph.astext():
            quote.remove(paragraph)
        kind = re.sub(r"\W+", "-", title.lower()).strip("-")
        box = nodes.admonition("", nodes.title("", title), classes=["box", kind])
        box += quote.children
        quote.replace_self(box)


def captions(app, doctree) -> None:
    """Mark captions and minutes, and link "figure 1.2" in the text to its figure."""
    places = {}
    for paragraph in doctree.findall(nodes.paragraph):
        start, text = first(paragraph), paragraph.astext()
        if isinstance(start, nodes.strong) and (found := CAPTION.match(start.astext())):
            place = nodes.make_id(start.astext())
            paragraph["classes"].append("caption-below")
            paragraph["ids"].append(place)
            places[start.astext().split()[0].lower(), found[1]] = place
        elif isinstance(start, nodes.emphasis) and MINUTES.match(text):
            paragraph["classes"].append("minutes")

    def link(found):
        place = places.get((found[1].lower(), found[2]))
        return place and nodes.reference("", found[0], refid=place, internal=True)

    linked(doctree, FIGURE, link, (nodes.paragraph, nodes.emphasis))


def chapter_links(app, doctree) -> None:
    """Link "chapter 03" in the text to that chapter. In a notebook it stays plain text."""
    files = {name[:2]: name for name in chapters.chapter_names(app.srcdir)}

    def link(found):
        stem = files.get(found[1])
        return stem not in (None, app.env.docname) and leads(found[0], "doc", f"/{stem}")

    linked(doctree, CHAPTER, link, (nodes.paragraph, nodes.emphasis, nodes.strong))


def terms(app, doctree) -> None:
    """Link words in italics to the glossary, each word once on a page."""
    page = Path(app.srcdir, "glossary.md")
    if app.env.docname == "glossary" or not page.exists():
        return
    glossary = page.read_text(encoding="utf-8").partition("```{glossary}")[2]
    known = {term.lower(): term for term in TERM.findall(glossary)}
    for word in list(doctree.findall(nodes.emphasis)):
        text = " ".join(word.astext().lower().split())
        term = known.pop(text, None) or known.pop(text.removesuffix("s"), None)
        if term and not isinstance(word.parent, nodes.reference | addnodes.pending_xref):
            word.replace_self(nodes.emphasis("", "", leads(word.astext(), "term", term)))


def leads(text: str, kind: str, target: str) -> addnodes.pending_xref:
    """A link to a document (`kind` is "doc") or to a term of the glossary ("term")."""
    where = {"refdomain": "std", "reftype": kind, "refexplicit": True, "reftarget": target}
    return addnodes.pending_xref("", nodes.inline("", text), **where)


def linked(doctree, pattern: re.Pattern, link, places: tuple) -> None:
    """Replace each match of `pattern` in the text by the result of `link(match)`, if it is a link.

    Args:
        places: kinds of nodes whose text is searched.
    """
    for text in list(doctree.findall(nodes.Text)):
        inside = text.parent
        if not isinstance(inside, places):
            continue
        parts, end = [], 0
        for found in pattern.finditer(text):
            if made := link(found):
                parts += [nodes.Text(text[end : found.start()]), made]
                end = found.end()
        if parts:
            inside.replace(text, [*parts, nodes.Text(text[end:])])


def filled(app, doctree) -> list[str]:
    """Put the numbers of the chapter's run into its text.

    Returns:
        A sentence for each number that changed.
    """
    asked = [
        one for one in doctree.findall(nodes.container) if f"tag_{numbers.TAG}" in one["classes"]
    ]
    values = []
    for cell in asked:
        printed = next(iter(cell.findall(nodes.literal_block)), None)
        values += json.loads(printed.astext()) if printed is not None else []
        cell.parent.remove(cell)
    comments = [
        raw for raw in doctree.findall(nodes.raw) if numbers.COMMENT.fullmatch(raw.astext())
    ]
    changed = []
    for comment, value in zip(comments, values, strict=False):
        before = comment.parent[comment.parent.index(comment) - 1]
        shown = numbers.AT_END.search(before)[0]
        value = numbers.unbroken(value)
        if shown != value:
            changed.append(f"{shown} in the text is {value} by {comment.astext()}")
        comment.parent.replace(before, nodes.Text(before[: -len(shown)] + value))
    for comment in comments:
        comment.parent.remove(comment)
    return changed

"""Numbers in a chapter's text that come from its cells.

A source has, for example, `59 mm<!--{along.min():.0f} mm-->`. A reader sees "59 mm", on the site,
in JupyterLab and wherever Markdown is shown. The comment says how the number is made: it is text
with Python in braces, as in an f-string. The chapter's kernel evaluates it after the code cell
before it. `run.py notebooks` writes the value in front of the comment. Authors first write
`?<!--{...}-->`. The build of the site evaluates all of them again.

A value starts after the last space or markup before the comment. So the spaces in a value are
written as spaces at which a line does not break.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from nbformat import NotebookNode
from nbformat.v4 import new_code_cell

from ptae_lite.errors import ArtefactError

TAG = "numbers"  # of the cells that are put in while a chapter runs, and taken out again
SHOWN = r"[^ \t\n<>*_()\[\]\"\u201c\u201d]+"  # nor quotes, also as Sphinx sets them
HOW = r"<!--(?P<how>(?:(?!-->)[^{}])*\{(?:(?!-->).)*\}(?:(?!-->)[^{}])*)-->"
NUMBER = re.compile(f"(?P<shown>{SHOWN}){HOW}", re.DOTALL)
COMMENT = re.compile(HOW, re.DOTALL)
AT_END = re.compile(f"{SHOWN}$")


def ways(text: str) -> list[str]:
    """The comments that make the numbers of a text, in order.

    Raises:
        ArtefactError: a comment has no value before it, or breaks where the page would not have it.
    """
    found = [found["how"] for found in NUMBER.finditer(text)]
    if len(found) != len(COMMENT.findall(text)):
        raise ArtefactError("A comment with {...} has no value before it; write a ? to begin with.")
    for how in found:
        if broken := re.search(r"\n[> ]*(?P<sign>[-+*] |%).*", how):  # a list, or MyST's comment
            raise ArtefactError(
                f"A line inside a comment begins with {broken['sign'].strip()}, and the page would "
                f"end the paragraph there; break it elsewhere: {broken[0].strip()}"
            )
    return [re.sub(r"\s*\n[> ]*\s*", " ", how) for how in found]


def ask(notebook: NotebookNode) -> None:
    """After each text with numbers, insert a cell that prints their values."""
    cells = []
    for cell in notebook.cells:
        cells.append(cell)
        if cell.cell_type == "markdown" and (found := ways(cell.source)):
            values = ", ".join(f"f'''{how}'''" for how in found)
            source = f"print(__import__('json').dumps([{values}]))"
            cells.append(new_code_cell(source, metadata={"tags": [TAG, "remove-input"]}))
    notebook.cells = cells


def take(notebook: NotebookNode) -> list[str]:
    """Remove these cells from a notebook that has run; returns the values in order."""
    asked = [cell for cell in notebook.cells if TAG in cell.metadata.get("tags", [])]
    notebook.cells = [cell for cell in notebook.cells if cell not in asked]
    ran = (cell for cell in notebook.cells if cell.get("execution_count"))
    for number, cell in enumerate(ran, start=1):
        cell.execution_count = number
        for output in cell.outputs:
            if "execution_count" in output:
                output.execution_count = number
    return [value for cell in asked for value in json.loads(cell.outputs[0].text)]


def fill(text: str, values: Iterator[str]) -> str:
    """The text with the next values instead of the old ones."""
    return NUMBER.sub(lambda found: unbroken(next(values)) + found[0][len(found["shown"]) :], text)


def unbroken(value: str) -> str:
    """The value with spaces at which a line does not break."""
    return value.replace(" ", "\N{NO-BREAK SPACE}")

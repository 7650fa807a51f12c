"""The report card as a table: a row for each claim, with a link to where it is shown."""

from __future__ import annotations

import re
from html import escape

import pandas as pd
from IPython.display import HTML

from ptae_lite.paper.report_card import CAVEAT, HELD, NOT_HELD, NOT_TESTABLE, NOT_TRAINED
from ptae_lite.run_mode import for_site

MARKS = {HELD: "●", CAVEAT: "◐", NOT_HELD: "○", NOT_TESTABLE: "✖", NOT_TRAINED: "·"}
COLUMNS = {"claim": "claim", "paper": "paper", "theirs": "authors' data", "ours": "our recording",
           "this run": "this run", "verdict": "verdict"}  # fmt: skip


def link(chapter: str, heading: str, book: str = "") -> str:
    """The address of a chapter's heading: on the site, or among the notebooks in JupyterLab.

    Args:
        book: the way to the chapters' folder: "" or "../".
    """
    if not for_site():
        return f"{book}{chapter}.ipynb#{heading.replace(' ', '-')}"
    return f"{book}{chapter}.html#{re.sub(r'[^a-z0-9_ -]', '', heading.lower()).replace(' ', '-')}"


def table(card: pd.DataFrame, book: str = "") -> HTML:
    """The rows of `paper.report_card.card`, with a heading for each group.

    Args:
        book: the way to the chapters' folder: "" or "../".
    """
    lines = ['<table class="dataframe report-card"><thead><tr>']
    lines += [f"<th>{name}</th>" for name in COLUMNS.values()] + ["</tr></thead><tbody>"]
    for group, rows in card.groupby("group", sort=False):
        lines.append(f'<tr><th colspan="{len(COLUMNS)}">{escape(group)}</th></tr>')
        lines += [_row(row, book) for row in rows.to_dict("records")]
    return HTML("\n".join([*lines, "</tbody></table>"]))


def _row(row: dict, book: str) -> str:
    where = escape(link(row["chapter"], row["heading"], book), quote=True)
    cells = [f'<a href="{where}">{escape(row["claim"])}</a>']
    cells += [escape(row[name]) for name in ("paper", "theirs", "ours", "this run")]
    cells.append(_verdicts(row))
    named = zip(COLUMNS.values(), cells, strict=True)  # on a phone the cells stand in a column
    return "<tr>" + "".join(f'<td data-name="{name}">{cell}</td>' for name, cell in named) + "</tr>"


def _verdicts(row: dict) -> str:
    """The verdict on each data set with its reason; only one if both are the same."""
    said = {}
    for name, suffix in (("theirs", "_theirs"), ("ours", "")):
        judged, why = row[f"verdict{suffix}"], row[f"why{suffix}"]
        said[COLUMNS[name]] = f"{MARKS[judged]}&nbsp;{judged}" + (
            f"<br><small>{escape(why)}</small>" if why else "")  # fmt: skip
    if len(set(said.values())) == 1:
        return said.popitem()[1]
    return "<br>".join(f"{name}: {text}" for name, text in said.items())

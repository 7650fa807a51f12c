#!/usr/bin/env python3
"""How the chapters read: words, code, pictures, tables, numbers, beside their limits.

    python benchmarks/chapter_style.py [NAME ...]

It measures the .ipynb twins, outputs and all. A word is what stands between spaces in the text
cells, formulas and folded details included; code that is folded or left out (`hide-input`,
`remove-input`, `hide-cell`) does not count. Pictures are figures, panels and scenes. What each
column means is said in `Style`; the limits in `LIMITS` hold for the chapters in `RETOLD`.
"""

from __future__ import annotations

import re
import sys
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path

import nbformat
import pandas as pd

from ptae_lite.book import numbers
from ptae_lite.book.chapters import notebook_files

ROOT = Path(__file__).resolve().parents[1]
BOOK = ROOT / "book"
RETOLD = [  # grows with each chapter that is rewritten
    "01_simulation", "02_vision", "03_crossmodal_transformer", "04_limited_supervision",
    "05_incongruence", "06_closed_loop", "07_report_card", "in_depth/01_motion",
    "in_depth/02_comparing_encoders", "in_depth/03_family", "in_depth/03_training",
    "in_depth/03_muon", "in_depth/03_execute", "in_depth/04_few_labels", "in_depth/04_how_often",
    "in_depth/04_pseudo_labels", "in_depth/05_conflict", "in_depth/06_acting",
    "in_depth/06_open_eyes", "in_depth/07_card",
]  # fmt: skip
FOLDED = {"hide-input", "remove-input", "hide-cell", "remove-cell"}
PANELS = ("Panel(", "TrainButton(")
COLUMNS = 79  # of a line of code that is shown
TABLE_LINES = 4  # printed lines from which an output is a table
# Which stored tables a chapter's text is about.
TABLES = {
    "02": ("encoders.csv", "encoders_in_use.csv"),
    "03": ("family.csv", "recipes.csv", "encoders_in_use.csv"),
    "04": ("supervision.csv",),
    "05": ("incongruence.csv",),
    "06": (
        "closed_loop.csv",
        "closed_loop_models.csv",
        "watching.csv",
        "watching_models.csv",
        "places.csv",
    ),
    "07": ("family.csv", "supervision.csv", "incongruence.csv", "closed_loop.csv"),
}
# Columns that say what a row is about, and no results.
ABOUT = {
    "seed", "code", "steps", "batch", "epoch", "updates", "pattern", "variation", "duration",
    "share", "labelled", "parameters", "samples_seen", "supervised_samples_seen", "conflicts",
    "gflop", "sample",
}  # fmt: skip
SHARES = {1, 2, 5, 10, 20, 50, 66.6, 100}
CAPTION = re.compile(r"\*\*(?:Figure|Table) (\d+(?:\.\d+)?)\.\*\*")
# Formulas, code, names, shapes, minutes, and the numbers of a list's items.
NO_NUMBERS = re.compile(
    r"\$\$.*?\$\$|\$[^$]*\$|`[^`]*`|\b[Cc]hapter \d+|\b(?:Figure|figure|Table|table) \d+(?:\.\d+)?"
    r"|\d+ × \d+|^\s*\d+ minutes?\*|^\s*\d+\. ",
    re.DOTALL | re.MULTILINE,
)
IN_WORDS = re.compile(  # not "one", which mostly is no number
    r"\b(?:two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|thirty|fifty|hundred"
    r"|thousand|half|third|quarter|twice)\b",
    re.IGNORECASE,
)
UNIT = r"(?:\N{NO-BREAK SPACE}| ?)(%|percent\b|mm\b|millimetres?\b|s\b|seconds?\b|m/s\b|degrees?\b)"
VERDICT = re.compile(r"\b(?:verdict|claim)\b[^.]{0,60}?\b(not held|held|open)\b", re.IGNORECASE)


@dataclass
class Style:
    """The measures of one chapter; a limit is a field of the same name in `LIMITS`."""

    name: str
    words: int = 0
    code_lines: int = 0  # unfolded, without empty lines
    words_a_line: float = 0.0
    pictures: int = 0
    longest: int = 0  # words without a picture
    first_shown: int = 0  # words before the first picture
    text_tables: int = 0
    guesses: int = 0
    crowded: int = 0  # paragraphs with more than two of them in digits
    uncaptioned: int = 0  # pictures that no numbered caption follows
    digits: float = 0.0  # number expressions in digits, in 1,000 words
    with_words: float = 0.0  # and those in words
    typed_results: int = 0
    wide_lines: int = 0  # of shown code
    minutes: int = 0  # of all sections


LIMITS = {  # the highest allowed; of those in LEAST, the lowest
    "words": 2200, "words_a_line": 13, "longest": 450, "first_shown": 150, "text_tables": 4,
    "digits": 20, "with_words": 30, "crowded": 0, "uncaptioned": 0, "typed_results": 0,
    "wide_lines": 0, "minutes": 60, "guesses": 4,
}  # fmt: skip
LEAST = {"guesses"}
OWN = {  # limits of one chapter or kind
    "01": {"words_a_line": inf},
    "03": {"words": 3000, "minutes": 90},
    "06": {"words_a_line": inf},
    "07": {"words_a_line": inf},
    "in_depth": {"words": 1500, "words_a_line": inf, "first_shown": 450, "guesses": 0},
}


def tags(cell) -> set[str]:
    return set(cell.metadata.get("tags", []))


def prose(source: str) -> str:
    """The text of a cell as a reader meets it: without the markup that is not read."""
    text = re.sub(r"<!--.*?-->", "", source, flags=re.DOTALL)
    text = re.sub(r"```.*?```", " ", text, flags=re.DOTALL)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    return re.sub(r"<[^>]+>|^[>#\-*|\s]+", " ", text, flags=re.MULTILINE)


def words(source: str) -> int:
    return sum(any(letter.isalnum() for letter in word) for word in prose(source).split())


def text_of(output) -> str:
    data = output.get("data", {})
    return output.get("text", "") or data.get("text/plain", "")


def shows_picture(output) -> bool:
    data = output.get("data", {})
    if any(kind.startswith("image/") for kind in data):
        return True
    return bool(re.search(r"<(?:svg|img|iframe)\b", data.get("text/html", ""))) or text_of(
        output
    ).startswith(PANELS)


def is_guess(output) -> bool:
    return text_of(output).startswith("Predict")


def numbers_in(source: str) -> tuple[int, int]:
    """Number expressions in digits, and in words. A formula or code in the text is neither."""
    text = NO_NUMBERS.sub(" ", prose(source))
    digits = re.findall(r"(?<![\w.])[-+]?\d[\d,.]*", text)
    return len(digits), len(IN_WORDS.findall(text))


def paragraphs(source: str) -> list[str]:
    """Paragraphs and items of lists; tables are none."""
    parts = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", source)
    return [part for part in parts if not part.lstrip().startswith("|")]


def results_of(notebook, name: str) -> list[float]:
    """Every number that a chapter prints, and every cell of the tables it is about."""
    found = []
    for output in (o for cell in notebook.cells for o in cell.get("outputs", [])):
        text = text_of(output) + re.sub(
            r"<[^>]+>", " ", output.get("data", {}).get("text/html", "")
        )
        found += [float(number) for number in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?", text)]
    for file in TABLES.get(name[:2], ()):
        table = pd.read_csv(ROOT / "data" / "results" / file).select_dtypes("number")
        found += table.drop(columns=list(ABOUT & set(table.columns))).stack().dropna().tolist()
    return found


def typed(source: str, results: list[float]) -> list[str]:
    """Percentages, millimetres, seconds and verdicts that were typed and equal a result.

    The shares of labels that the studies compare are no results, nor is a whole.
    """
    text = numbers.NUMBER.sub("", source)
    found = [said[0] for said in VERDICT.finditer(text)]
    for said in re.finditer(rf"(?<![\w.])(\d+(?:\.\d+)?){UNIT}", text):
        places = len(said[1].partition(".")[2])
        if said[2] in ("%", "percent") and float(said[1]) in SHARES:
            continue
        if any(round(result, places) == float(said[1]) for result in results):
            found.append(said[0])
    return found


def measure(notebook, name: str) -> Style:
    """A chapter's measures, of its notebook with outputs."""
    style, since, digits, in_words = Style(name), 0, 0, 0
    results = results_of(notebook, name.split("/")[-1])
    gaps, following = [], [*notebook.cells[1:], None]
    for cell, after in zip(notebook.cells, following, strict=True):
        if cell.cell_type == "markdown":
            count = words(cell.source)
            style.words += count
            pictures = len(re.findall(r"!\[|<img|<svg", cell.source))
            style.pictures += pictures
            since = 0 if pictures else since + count
            some, more = numbers_in(cell.source)
            digits, in_words = digits + some, in_words + more
            style.crowded += sum(numbers_in(part)[0] > 2 for part in paragraphs(cell.source))
            style.typed_results += len(typed(cell.source, results))
            style.minutes += sum(map(int, re.findall(r"^\*(\d+) minutes?\*$", cell.source, re.M)))
            gaps.append(since)
        elif cell.cell_type == "code":
            lines = cell.source.splitlines()
            if not FOLDED & tags(cell):
                style.code_lines += sum(bool(line.strip()) for line in lines)
                style.wide_lines += sum(len(line) > COLUMNS for line in lines)
            for output in cell.outputs:
                if is_guess(output):
                    style.guesses += 1
                elif shows_picture(output):
                    style.pictures += 1
                    style.uncaptioned += after is None or not CAPTION.match(after.source)
                    style.first_shown = style.first_shown or style.words
                    since = 0
                else:
                    printed = text_of(output).strip().splitlines()
                    style.text_tables += len(printed) >= TABLE_LINES
    style.longest = max(gaps, default=0)
    style.first_shown = style.first_shown if style.pictures else style.words
    style.words_a_line = round(style.words / max(style.code_lines, 1), 1)
    style.digits = round(1000 * digits / max(style.words, 1), 1)
    style.with_words = round(1000 * (digits + in_words) / max(style.words, 1), 1)
    return style


def limits(name: str) -> dict[str, float]:
    key = "in_depth" if name.startswith("in_depth") else name[:2]
    return LIMITS | OWN.get(key, {})


def faults(style: Style) -> list[str]:
    """Which measures of a chapter are beyond its limits."""
    found = []
    for what, limit in limits(style.name).items():
        value = getattr(style, what)
        if value < limit if what in LEAST else value > limit:
            found.append(f"{what} {value}, limit {limit}")
    return found


def read(name: str) -> Style:
    return measure(nbformat.read(BOOK / f"{name}.ipynb", as_version=4), name)


def main(names: list[str]) -> int:
    names = names or [
        md.relative_to(BOOK).with_suffix("").as_posix() for md in notebook_files(BOOK)
    ]
    styles = [read(name) for name in names]
    print(pd.DataFrame([asdict(style) for style in styles]).set_index("name").T.to_string())
    broken = {style.name: faults(style) for style in styles if style.name in RETOLD}
    for name, found in broken.items():
        print(f"{name}: {'; '.join(found) or 'within its limits'}")
    return 1 if any(broken.values()) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Chapters that were rewritten keep to the limits, and the measures find what breaks them."""

import importlib.util
import re
import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

SCRIPT = Path(__file__).resolve().parents[1] / "benchmarks" / "chapter_style.py"
spec = importlib.util.spec_from_file_location("chapter_style", SCRIPT)
style = sys.modules["chapter_style"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(style)


@pytest.mark.parametrize("name", style.RETOLD)
def test_a_rewritten_chapter_keeps_to_the_limits(name):
    assert style.faults(style.read(name)) == []


@pytest.mark.parametrize("name", style.RETOLD)
def test_the_figures_of_a_rewritten_chapter_are_numbered_in_their_order(name):
    notebook = nbformat.read(style.BOOK / f"{name}.ipynb", as_version=4)
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    for kind in ("Figure", "Table"):
        numbers = re.findall(rf"^\*\*{kind} (\S+)\.\*\*", text, re.MULTILINE)
        whole = f"{int(name[:2])}." if re.match(r"\d\d_", name) else ""
        assert numbers == [f"{whole}{i}" for i in range(1, len(numbers) + 1)]


SHEETS = sorted((style.BOOK / "exercises").glob("[0-9]*.md"))
ANSWERS = re.split(r"^## (?=\d\d, )", (style.BOOK / "exercises" / "chapter_answers.md").read_text(
    "utf-8"), flags=re.MULTILINE)[1:]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text"),
    [(sheet.stem, sheet.read_text("utf-8")) for sheet in SHEETS] + [(a[:2], a) for a in ANSWERS],
    ids=[sheet.stem for sheet in SHEETS] + [answer[:5] for answer in ANSWERS],
)
def test_exercises_and_their_answers_hold_no_typed_result(name, text):
    results = style.results_of(new_notebook(), name)
    assert style.typed(re.sub(r"```.*?```", "", text, flags=re.DOTALL), results) == []


def cell(source, *outputs, folded=False):
    tags = {"tags": ["hide-input"]} if folded else {}
    return new_code_cell(source, outputs=list(outputs), metadata=tags)


def picture():
    return new_output("display_data", data={"image/png": "AA=="})


def printed(text):
    return new_output("stream", text=text)


def measured(*cells):
    made = [new_markdown_cell(one) if isinstance(one, str) else one for one in cells]
    return style.measure(new_notebook(cells=made), "09_x")


def test_words_code_and_pictures_are_counted():
    found = measured(
        "# A title\n\n*5 minutes*\n\nfour words of text", cell("x = 1\n\ny = 2", picture()),
        "**Figure 9.1.** Two words.", cell("z = 3", picture(), folded=True),
        "five words that come last", cell("pass", new_output("display_data", data={
            "text/plain": "Predict: what?"})),
    )  # fmt: skip
    assert (found.words, found.code_lines, found.words_a_line) == (17, 3, 5.7)
    assert (found.pictures, found.guesses, found.minutes) == (2, 1, 5)
    assert (found.first_shown, found.longest, found.uncaptioned) == (8, 8, 1)


def test_printed_tables_and_wide_lines_are_found():
    wide = "x = " + "1" * 80
    found = measured(cell(wide, printed("a\nb\nc\nd\n")), cell(wide, printed("a"), folded=True))
    assert (found.text_tables, found.wide_lines) == (1, 1)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("It goes 59 mm.", 1),
        ("It goes 59\N{NO-BREAK SPACE}mm.", 1),
        ("It goes 59 mm<!--{far:.0f} mm-->.", 0),  # the cell says so
        ("It goes 58 mm.", 0),  # nothing of that is printed
        ("It takes 59 steps.", 0),  # no unit of a result
        ("It is right in 12 % and in 12.4 percent.", 2),
        ("At 100 % of labels", 0),
        ("This claim is not held.", 1),
        ("It held the cube.", 0),
    ],
)
def test_a_typed_result_is_found(text, count):
    assert measured(cell("pass", printed("far 59.2, right 12.37")), text).typed_results == count


def test_results_of_stored_tables_are_known():
    results = style.results_of(new_notebook(), "02_vision")
    assert len(results) > 1000 and style.results_of(new_notebook(), "01_simulation") == []


def test_numbers_in_formulas_and_names_do_not_count():
    assert style.numbers_in("In chapter 03, figure 1.2: $4 x$, `a[5]` and 6 or seven") == (1, 1)
    assert style.numbers_in("Here\n\n$$\nx = 1 + 2 + 3\n$$\n\nare 4") == (1, 0)
    assert measured("One 1, 2 and 3.\n\n- 1\n- 2\n\n| 1 | 2 | 3 |").crowded == 1


def test_what_is_beyond_a_limit_is_named():
    found = style.faults(style.Style("01_x", words=2201, guesses=4))
    assert found == ["words 2201, limit 2200"]
    assert "guesses 0, limit 4" in style.faults(style.Style("01_x"))
    assert style.faults(style.Style("in_depth/02_x", words=1500)) == []

"""The field's words: names that were replaced must not come back."""

import ast
import io
import json
import re
import tokenize
from pathlib import Path

import jupytext
import numpy as np
import pandas as pd
import pytest
from safetensors import safe_open

from ptae_lite import artefacts, renamed
from ptae_lite.__main__ import parser

ROOT = Path(__file__).resolve().parents[1]
REPLACED = (
    pd.read_csv(Path(__file__).with_name("replaced_names.csv")).groupby("kind")["old"].agg(set)
)
SOURCE = ROOT / "src" / "ptae_lite"
CODE = [ROOT / "run.py", *sorted(SOURCE.rglob("*.py")), *sorted((ROOT / "benchmarks").glob("*.py"))]
PAGES = sorted((ROOT / "book").glob("*.md")) + sorted((ROOT / "book" / "exercises").glob("*.md"))
PAGES += sorted((ROOT / "book" / "in_depth").glob("*.md"))


def identifiers(source: str) -> set[str]:
    words = tokenize.generate_tokens(io.StringIO(source).readline)
    return {token.string for token in words if token.type == tokenize.NAME}


def code_of(page: Path) -> str:
    """The code of a page's cells, without magics."""
    cells = [cell.source for cell in jupytext.read(page).cells if cell.cell_type == "code"]
    lines = "\n".join(cells).splitlines()
    return "\n".join("pass" if line.startswith(("%", "!")) else line for line in lines) + "\n"


@pytest.mark.parametrize("path", CODE, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_code_uses_the_fields_words(path):
    assert not identifiers(path.read_text("utf-8")) & REPLACED["identifier"]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_cells_use_the_fields_words(page):
    assert not identifiers(code_of(page)) & REPLACED["identifier"]


def test_modules_have_the_fields_names():
    there = {
        part
        for path in SOURCE.rglob("*.py")
        for part in path.relative_to(SOURCE).with_suffix("").parts
    }
    assert not there & REPLACED["module"]


def options(made) -> set[str]:
    """All option strings of a parser and of its commands."""
    found = set()
    for action in made._actions:
        found |= set(action.option_strings)
        for one in (action.choices or {}).values() if isinstance(action.choices, dict) else ():
            found |= options(one) | set(action.choices)
    return found


def test_options_and_commands_have_the_fields_names():
    assert not options(parser()) & (set(renamed.OPTIONS) | {"eyes", "eyes-ptae"})


def test_stored_tables_and_arrays_have_the_fields_names():
    for name in artefacts.manifest():
        path, found = artefacts.stored(name), set()
        if name.endswith(".csv"):
            found = set(pd.read_csv(path, nrows=1).columns)
        elif name.endswith(".npz"):
            with np.load(path) as file:
                found = set(file.files)
        elif name.endswith(".safetensors"):
            with safe_open(path, framework="pt") as file:
                about = json.loads(file.metadata()["about"])
            found = set(about) | set(about.get("config", ())) | set(about["recipe"])
        assert not found & (set(renamed.COLUMNS) | set(renamed.SETTINGS) | {"films", "told"}), name


def test_no_value_in_a_table_has_an_old_name():
    for name in artefacts.manifest():
        if name.endswith(".csv"):
            table = pd.read_csv(artefacts.stored(name), dtype=str)
            for column in {"model", "variant", "choice", "encoder"} & set(table):
                assert not set(table[column]) & set(renamed.VALUES), (name, column)


def documented(node) -> set[str]:
    """The names that the docstring's Args or Attributes explain."""
    found = re.search(
        r"(?:Args|Attributes):\n(.*?)(?:\n\n|\n(?=\S)|\Z)", ast.get_docstring(node) or "", re.S
    )
    return set(re.findall(r"^    (\w+):", found[1], re.M)) if found else set()


def given(node) -> set[str]:
    """The parameters of a function, or of what makes an object; else the fields of a class."""
    if isinstance(node, ast.ClassDef):
        makes = [part for part in node.body if getattr(part, "name", "") == "__init__"]
        if not makes:
            return {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)}
        node = makes[0]
    named = [*node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
    return {one.arg for one in named if one}


@pytest.mark.parametrize(
    "path", sorted(SOURCE.rglob("*.py")), ids=lambda path: path.relative_to(ROOT).as_posix()
)
def test_what_a_docstring_explains_is_a_parameter(path):
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            assert documented(node) <= given(node), node.name

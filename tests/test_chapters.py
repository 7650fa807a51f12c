"""Chapters come from one list; what a reader lays beside them is left out, by name."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from ptae_lite.book import chapters, contents, exercises, notebooks
from ptae_lite.errors import ArtefactError
from ptae_lite.reproduce import fingerprints

BOOK = Path(__file__).resolve().parents[1] / "book"
INDEX = """\
# A book

```{toctree}
:caption: Chapters
:numbered:

02_two
01_one
```

```{toctree}
:caption: Reference

api/index
```
"""
CHAPTER = """\
---
jupytext:
  formats: ipynb,md:myst
  text_representation:
    extension: .md
    format_name: myst
---

# {title}

**Time:** 1 h.
**Prerequisites:** none.

```{{code-cell}} ipython3
print({code})
```
"""
BESIDE = ["01_one-Copy1.ipynb", "01_one-Copy1.md", "03_mine [old].md", "Untitled.ipynb",
          "api/notes.md"]  # fmt: skip


@pytest.fixture
def book(tmp_path):
    """A book of two chapters, with what a reader may leave in its folder."""
    folder = tmp_path / "book"
    (folder / "api" / ".ipynb_checkpoints").mkdir(parents=True)
    (folder / "index.md").write_text(INDEX, "utf-8")
    (folder / "api/index.md").write_text("# Api\n", "utf-8")
    for name in ("01_one", "02_two"):
        (folder / f"{name}.md").write_text(CHAPTER.format(title=name, code="1 + 1"), "utf-8")
        nbformat.write(new_notebook(cells=[new_code_cell("1 + 1")]), folder / f"{name}.ipynb")
    for name in BESIDE:
        if name.endswith(".md"):
            (folder / name).write_text(CHAPTER.format(title="Mine", code="1 / 0"), "utf-8")
        else:
            nbformat.write(new_notebook(cells=[new_code_cell("1 / 0")]), folder / name)
    shutil.copy(folder / "01_one.ipynb", folder / "api/.ipynb_checkpoints/01_one-checkpoint.ipynb")
    for name in ("conf.py", "conftest.py", "_static"):
        copy = shutil.copytree if (BOOK / name).is_dir() else shutil.copy
        copy(BOOK / name, folder / name)
    return folder


def test_the_list_names_every_chapter_of_the_book():
    files = chapters.chapter_files(BOOK)
    assert len(files) >= 7 and all(path.is_file() for path in files)
    assert [path.stem[:2] for path in files] == [f"{i:02}" for i in range(1, len(files) + 1)]
    assert (BOOK / "exercises" / "for_the_teacher.md").is_file()  # the folder that is no page
    assert "api/data" in chapters.page_names(BOOK)


def test_chapters_are_found_by_name_and_in_the_order_of_the_list(book):
    assert [path.name for path in chapters.chapter_files(book)] == ["02_two.md", "01_one.md"]
    assert chapters.notebook_files(book, ["02_two.ipynb"]) == [book / "02_two.md"]
    with pytest.raises(ArtefactError, match="No chapter 01_one-Copy1 in .*02_two, 01_one"):
        chapters.notebook_files(book, ["01_one-Copy1"])
    with pytest.raises(ArtefactError, match="lists no chapters"):
        chapters.chapter_files(book / "api")


def test_what_lies_beside_the_chapters_is_named(book):
    assert chapters.left_out(book) == BESIDE
    assert all(name in chapters.notice(book) for name in BESIDE)
    for name in BESIDE:
        (book / name).unlink()
    assert chapters.notice(book) == ""


def test_nothing_that_counts_chapters_counts_a_copy(book):
    names = {"01_one", "02_two"}
    assert set(fingerprints.chapters(book)) == names
    assert {one.file for one in contents.Contents(book).chapters} == names
    sheets = book / "exercises"
    shutil.copytree(BOOK / "exercises", sheets)
    shutil.copy(sheets / "01_simulation.md", sheets / "01_one.md")
    shutil.copy(sheets / "01_simulation.md", sheets / "01_one-Copy1.md")
    assert [sheet.name for sheet in exercises.sheets(sheets)] == ["01_one"]


def test_the_notebooks_of_the_chapters_alone_are_written(book, monkeypatch, capsys):
    monkeypatch.chdir(book.parent)
    monkeypatch.setattr(notebooks, "execute", lambda notebook, folder: None)
    assert notebooks.main(["--from", "md"]) == 0
    out = capsys.readouterr().out
    assert "wrote book/02_two.ipynb" in out.replace(os.sep, "/") and "Left out" in out
    assert "1 / 0" in (book / "01_one-Copy1.ipynb").read_text("utf-8")


@pytest.mark.slow
def test_the_notebooks_of_the_chapters_alone_are_tested(book):
    command = [sys.executable, "-m", "pytest", "--nbval-lax", "--collect-only", "-q", "-p",
               "no:cacheprovider", str(book)]  # fmt: skip
    run = subprocess.run(command, cwd=book.parent, capture_output=True, text=True)
    collected = {line.split("::")[0] for line in run.stdout.splitlines() if "::" in line}
    assert {Path(name).name for name in collected} == {"01_one.ipynb", "02_two.ipynb"}, run.stdout
    assert "Left out" in run.stdout and "Untitled.ipynb" in run.stdout


@pytest.mark.slow
def test_a_copy_neither_breaks_the_build_nor_is_a_page(book, tmp_path):
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", str(book), str(tmp_path / "w/h")]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    pages = {path.stem for path in (tmp_path / "w/h").glob("*.html")}
    assert {"01_one", "02_two"} <= pages and not {"01_one-Copy1", "Untitled"} & pages
    twins = {path.name for path in (tmp_path / "w/h/_sources").glob("*.ipynb")}
    assert twins == {"01_one.ipynb", "02_two.ipynb"}

"""Plain Markdown of a chapter becomes boxes, captions, links and numbers of a page."""

import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from ptae_lite.book import chapters, notebooks, numbers
from ptae_lite.errors import ArtefactError

BOOK = Path(__file__).resolve().parents[1] / "book"
HEADER = """\
---
jupytext:
  cell_metadata_filter: -jupyter
  formats: ipynb,md:myst
  notebook_metadata_filter: -jupytext.text_representation.jupytext_version,-kernelspec
  text_representation:
    extension: .md
    format_name: myst
    format_version: 0.13
---
"""
INDEX = """\
# A book

```{toctree}
:caption: Chapters
:numbered:

01_one
```

```{toctree}
:caption: In depth

in_depth/01_more
```

```{toctree}
glossary
```
"""
CHAPTER = """
# One

## First

*8 minutes*

```{code-cell} ipython3
:tags: [hide-input]

far_mm = {"push": 59.2}
```

A *clip* goes **?<!--{far_mm["push"]:.0f} mm-->**, as figure 1.1 shows. Another *clip* does not.
It says "?<!--{"push " + "red"}-->".

**Figure 1.1.** What to see.

```{code-cell} ipython3
far_mm["push"] = 7
```

> **Key result.** It goes ?<!--{far_mm["push"] +
> 1} of ten--> far.

<details><summary>More</summary>

Some **bold** text.

</details>
"""
DEPTH = "\n# More\n\nSee chapter 01: ?<!--{one}-->, ?<!--{two}-->.\n"
GLOSSARY = "# Glossary\n\n```{glossary}\nClip\n  A film.\n```\n"


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """A small book whose pairs are written."""
    folder = tmp_path_factory.mktemp("once") / "book"
    (folder / "in_depth").mkdir(parents=True)
    (folder / "index.md").write_text(INDEX, "utf-8")
    (folder / "glossary.md").write_text(GLOSSARY, "utf-8")
    (folder / "01_one.md").write_text(HEADER + CHAPTER, "utf-8")
    cell = "\n```{code-cell} ipython3\none, two = 1, 2\n```\n"
    (folder / "in_depth/01_more.md").write_text(HEADER + cell + DEPTH, "utf-8")
    for name in ("conf.py", "_static"):
        copy = shutil.copytree if (BOOK / name).is_dir() else shutil.copy
        copy(BOOK / name, folder / name)
    for md in chapters.notebook_files(folder):
        notebooks.write(md)
    return folder


@pytest.fixture
def written(once, tmp_path):
    return shutil.copytree(once, tmp_path / "book")


def site_of(book, tmp_path):
    out = tmp_path / "work" / "html"
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-b",
        "html",
        "-W",
        "--keep-going",
        str(book),
        str(out),
    ]
    made = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    return out, made


@pytest.mark.slow
def test_numbers_are_written_into_both_halves_of_a_pair_and_stay(written):
    source = written / "01_one.md"
    text = source.read_text("utf-8")
    assert "**59\N{NO-BREAK SPACE}mm<!--{far_mm" in text
    assert "It goes 8\N{NO-BREAK SPACE}of\N{NO-BREAK SPACE}ten<!--" in text
    twin = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
    assert notebooks.compare(source, source.with_suffix(".ipynb")) == []
    code = [cell for cell in twin.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == [1, 2]
    assert [cell.metadata.get("jupyter") for cell in code] == [{"source_hidden": True}, None]
    notebooks.write(source)
    assert source.read_text("utf-8") == text
    assert "1<!--{one}-->, 2<!--{two}-->" in (written / "in_depth/01_more.md").read_text("utf-8")


@pytest.mark.slow
def test_a_page_has_boxes_captions_links_and_numbers(written, tmp_path):
    out, made = site_of(written, tmp_path)
    assert made.returncode == 0, made.stderr
    page = (out / "01_one.html").read_text("utf-8")
    body = page.split("<article")[1].split("</article")[0]
    assert '<p class="minutes"><em>8 minutes</em></p>' in body
    assert "<strong>59\N{NO-BREAK SPACE}mm</strong>" in body and "<!--{" not in body
    assert "It says “push\N{NO-BREAK SPACE}red”." in body
    assert "json" not in body  # nothing is left of the cells that asked
    assert body.count('href="glossary.html#term-Clip"') == 1
    assert '<p class="caption-below" id="figure-1-1">' in body and 'href="#figure-1-1"' in body
    assert '<div class="box key-result admonition">' in body
    assert '<p class="admonition-title">Key result</p>' in body
    assert "It goes 8\N{NO-BREAK SPACE}of\N{NO-BREAK SPACE}ten far." in body
    assert "<details><summary>More</summary>" in body and "<strong>bold</strong>" in body
    depth = (out / "in_depth/01_more.html").read_text("utf-8")
    assert 'href="../01_one.html"' in depth and "In depth" in page
    assert (out / "_sources/in_depth/01_more.ipynb").exists()


@pytest.mark.slow
def test_a_number_that_moved_fails_the_build_and_is_written_anew(written, tmp_path):
    source = written / "01_one.md"
    text = source.read_text("utf-8")
    source.write_text(text.replace("59.2", "61.2"), "utf-8")
    out, made = site_of(written, tmp_path)
    assert made.returncode != 0
    assert "01_one: 59\N{NO-BREAK SPACE}mm in the text is 61\N{NO-BREAK SPACE}mm by" in made.stderr
    assert "61\N{NO-BREAK SPACE}mm" in (out / "01_one.html").read_text("utf-8")
    notebooks.write(source)
    assert source.read_text("utf-8") == text.replace("59", "61")


def test_a_way_without_a_value_is_an_error():
    notebook = new_notebook(cells=[new_markdown_cell("Far: <!--{far}-->")])
    with pytest.raises(ArtefactError, match="no value before it"):
        numbers.ask(notebook)


@pytest.mark.parametrize("how", ["{far:.0f}\n%", "{near\n+ far}", "{near\n> - far}"])
def test_a_comment_may_not_break_where_a_page_ends_the_paragraph(how):
    notebook = new_notebook(cells=[new_markdown_cell(f"Far: 59<!--{how}-->")])
    with pytest.raises(ArtefactError, match="break it elsewhere"):
        numbers.ask(notebook)
    numbers.ask(new_notebook(cells=[new_markdown_cell("Far: 59<!--{near +\n> far} mm-->")]))


def test_other_comments_and_code_are_left_alone():
    cells = [new_markdown_cell("One <!-- not {yet --> and 2<!-- plain -->"),
             new_code_cell("print('3<!--{x}-->')")]  # fmt: skip
    notebook = new_notebook(cells=cells)
    numbers.ask(notebook)
    assert notebook.cells == cells and numbers.take(notebook) == []


def test_what_stands_before_a_value_stays():
    values = iter(["60 mm", "5", "6"])
    text = "of **?<!--{a} mm-->**, (4<!--{b}-->) and\n4<!--{c}-->."
    filled = numbers.fill(text, values)
    assert filled == "of **60\N{NO-BREAK SPACE}mm<!--{a} mm-->**, (5<!--{b}-->) and\n6<!--{c}-->."

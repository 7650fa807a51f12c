"""What every chapter keeps: pairs that agree, short cells, nothing that ties it to one machine.

A rule is a function from a notebook to a list of complaints. Each is tried on every chapter, and
on an example that breaks it.
"""

import asyncio
import re
from pathlib import Path

import jupytext
import nbformat
import pytest
from jupyter_server.services.contents.largefilemanager import AsyncLargeFileManager
from jupytext.async_contentsmanager import build_async_jupytext_contents_manager_class
from nbconvert.exporters import ScriptExporter
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from test_marks import HEADER

from ptae_lite.book import chapters, notebooks
from ptae_lite.book.chapters import notebook_files
from ptae_lite.errors import ArtefactError

BOOK = Path(__file__).resolve().parents[1] / "book"
CHAPTERS = notebook_files(BOOK)  # and pages in depth
PAIRS = [md for md in CHAPTERS if md.with_suffix(".ipynb").exists()]  # the rest fails once, below
MAX_LINES = 25
MACHINE_PATH = re.compile(
    r"(?<![\w.])/(?:home|Users|root|tmp|work|opt|mnt|usr|var)/|\b[A-Z]:\\\\?\w|~/"
)
PACKED = re.compile(r"[A-Za-z0-9+/=]{200,}")  # base64, in which any word may turn up
NETWORK = re.compile(
    r"^\s*(?:import|from)\s+(?:urllib|requests|httpx|aiohttp|socket|http|ftplib|playwright)\b"
    r"|torch\.hub|load_state_dict_from_url|snapshot_download|meshcat\.Visualizer\(\s*\)"
    r"|^\s*[!%]\s*(?:pip|conda|uv|wget|curl|git)\b",
    re.MULTILINE,
)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def texts(cell):
    """What a cell has put out as text: pictures and packed viewers are left out."""
    for output in cell.get("outputs", []):
        yield output.get("text", "")
        yield from output.get("traceback", [])
        yield output.get("data", {}).get("text/plain", "")
        yield PACKED.sub("", output.get("data", {}).get("text/html", ""))


def cells_are_short(notebook):
    for number, cell in enumerate(code_cells(notebook), start=1):
        count = len(cell.source.splitlines())
        if count > MAX_LINES:
            yield f"code cell {number} has {count} lines"


def no_machine_paths(notebook):
    for number, cell in enumerate(notebook.cells, start=1):
        for text in (cell.source, *texts(cell)):
            yield from (f"cell {number}: {found}" for found in MACHINE_PATH.findall(text))


def no_addresses(notebook):
    for number, cell in enumerate(code_cells(notebook), start=1):
        yield from (f"code cell {number}: {it}" for it in re.findall(r"https?://", cell.source))


def no_network(notebook):
    for number, cell in enumerate(code_cells(notebook), start=1):
        yield from (f"code cell {number}: {found}" for found in NETWORK.findall(cell.source))


def checked_cells_have_outputs(notebook):
    for number, cell in enumerate(code_cells(notebook), start=1):
        if "nbval-check-output" in cell.metadata.get("tags", []) and not cell.outputs:
            yield f"code cell {number} is to be checked and has no output"


def kernel_is_python3(notebook):
    name = notebook.metadata.get("kernelspec", {}).get("name")
    if name != "python3":
        yield f"kernel {name!r}"


def tier_comes_first(notebook):
    cells = code_cells(notebook)
    if not cells or not re.search(r"\btier\(\)", cells[0].source):
        yield "the first code cell does not call tier()"


RULES = [
    cells_are_short,
    no_machine_paths,
    no_addresses,
    no_network,
    checked_cells_have_outputs,
    kernel_is_python3,
    tier_comes_first,
]


def half_pairs(book):
    """The chapters and pages in depth of which one half is missing."""
    return [name for name in (*chapters.chapter_names(book), *chapters.in_depth_names(book))
            if not all((book / f"{name}.{end}").exists() for end in ("md", "ipynb"))]  # fmt: skip


def too_large(book):
    return [
        path.name for path in book.rglob("*.ipynb") if path.stat().st_size > notebooks.LIMIT_BYTES
    ]


# ---------------------------------------------------------------- every chapter


def test_every_chapter_is_a_pair():
    assert half_pairs(BOOK) == []


def test_no_notebook_is_too_large():
    assert too_large(BOOK) == []


@pytest.mark.parametrize("md", PAIRS, ids=lambda path: path.stem)
def test_the_pair_agrees(md):
    assert notebooks.compare(md, md.with_suffix(".ipynb")) == []


@pytest.mark.parametrize("md", PAIRS, ids=lambda path: path.stem)
def test_the_twin_makes_the_same_source(md):
    """Or JupyterLab refuses to open the pair where the twin is the newer file."""
    twin = nbformat.read(md.with_suffix(".ipynb"), as_version=4)
    for key in ("kernelspec", "language_info", notebooks.STAMP):
        twin.metadata.pop(key, None)
    assert jupytext.writes(twin, fmt="md:myst") == md.read_text(encoding="utf-8")


@pytest.mark.parametrize("md", CHAPTERS, ids=lambda path: path.stem)
def test_the_header_holds_no_version_of_the_tool(md):
    assert "jupytext_version:" not in md.read_text(encoding="utf-8")


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
@pytest.mark.parametrize("md", PAIRS, ids=lambda path: path.stem)
def test_chapter(md, rule):
    assert list(rule(nbformat.read(md.with_suffix(".ipynb"), as_version=4))) == []


# ---------------------------------------------------------------- the rules find what they forbid


def notebook_of(*sources, kernel="python3"):
    cells = [new_code_cell("print(tier())"), *map(new_code_cell, sources)]
    spec = {"name": kernel, "display_name": "Python 3"}
    return new_notebook(cells=cells, metadata={"kernelspec": spec})


def test_a_good_notebook_breaks_no_rule():
    notebook = notebook_of("\n".join(["x = 1"] * MAX_LINES), "# a comment\n\ny = a / b")
    notebook.cells.append(new_markdown_cell("[a link](https://example.org)"))
    assert [list(rule(notebook)) for rule in RULES] == [[]] * len(RULES)


@pytest.mark.parametrize(
    ("rule", "source"),
    [
        (cells_are_short, "\n".join(["x = 1"] * (MAX_LINES + 1))),
        (no_machine_paths, "open('/home/me/data.npz')"),
        (no_machine_paths, "open('C:\\\\data.npz')"),
        (no_machine_paths, "open('~/data.npz')"),
        (no_addresses, "source = 'https://example.org'"),
        (no_network, "import socket"),
        (no_network, "x = 1\nfrom urllib.request import urlopen"),
        (no_network, "torch.hub.load('a', 'b')"),
        (no_network, "!pip install numpy"),
        (no_network, "viewer = meshcat.Visualizer()"),
    ],
)
def test_a_rule_finds_a_source_that_breaks_it(rule, source):
    broken = [each for each in RULES if list(each(notebook_of(source)))]
    assert broken == [rule]


@pytest.mark.parametrize(
    "output",
    [
        new_output("stream", text="saved /home/me/x"),
        new_output("display_data", data={"text/html": f"<i>{'A' * 300}</i> /home/me"}),
        new_output("execute_result", data={"text/plain": "PosixPath('/home/me/x')"}),
        new_output("error", ename="E", evalue="", traceback=["File /home/me/x.py:1"]),
    ],
)
def test_a_rule_finds_a_path_in_an_output(output):
    notebook = notebook_of("x")
    notebook.cells[1].outputs = [output]
    assert list(no_machine_paths(notebook)) == ["cell 2: /home/"]


def test_a_rule_finds_a_path_in_the_text_and_none_in_a_packed_picture():
    notebook = notebook_of("x")
    packed = "A" * 99 + "+/home/" + "A" * 99
    notebook.cells[1].outputs = [new_output("display_data", data={"text/html": packed})]
    assert list(no_machine_paths(notebook)) == []
    notebook.cells.append(new_markdown_cell("Open `~/book`."))
    assert list(no_machine_paths(notebook)) == ["cell 3: ~/"]


def test_a_rule_finds_a_check_without_output():
    notebook = notebook_of("1 + 1")
    notebook.cells[1].metadata["tags"] = ["nbval-check-output"]
    assert list(checked_cells_have_outputs(notebook))
    notebook.cells[1].outputs = [new_output("stream", text="2")]
    assert not list(checked_cells_have_outputs(notebook))


def test_a_rule_finds_a_private_kernel():
    assert list(kernel_is_python3(notebook_of(kernel="my-env")))


def test_a_rule_finds_a_missing_tier():
    assert list(tier_comes_first(new_notebook(cells=[new_code_cell("x = 1")])))
    assert list(tier_comes_first(new_notebook(cells=[new_markdown_cell("tier()")])))


def test_a_missing_half_and_a_large_file_are_found(tmp_path):
    (tmp_path / "01_one.md").touch()
    (tmp_path / "02_two.ipynb").write_bytes(b" " * (notebooks.LIMIT_BYTES + 1))
    named = "```{toctree}\n:caption: Chapters\n\n01_one\n02_two\n```\n"
    (tmp_path / "index.md").write_text(named, encoding="utf-8")
    assert half_pairs(tmp_path) == ["01_one", "02_two"]
    assert too_large(tmp_path) == ["02_two.ipynb"]


# ---------------------------------------------------------------- making the twins

CHAPTER = (
    HEADER
    + """
# A chapter

```{code-cell} ipython3
:tags: [nbval-check-output]

import os, sys
print(os.environ["PTAE_TIER"], flush=True)
print("noise", file=sys.stderr, flush=True)
print("end")
```
"""
)


@pytest.fixture
def pair(tmp_path):
    """A small chapter and its twin, which was made without a kernel."""
    md = tmp_path / "01_small.md"
    md.write_text(CHAPTER, encoding="utf-8")
    notebook = notebooks.read(md)
    notebooks.clean(notebook)
    notebooks.set_ids(notebook)
    notebook.metadata[notebooks.STAMP] = {"cells": notebooks.fingerprint(notebook)}
    ipynb = md.with_suffix(".ipynb")
    ipynb.write_bytes(notebooks.to_bytes(notebook, ipynb.name))
    return md, ipynb


def test_compare_a_pair_that_agrees(pair):
    assert notebooks.compare(*pair) == []


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("# A chapter", "# Another", "cell 1: source '# A chapter'"),
        ("print(", "print( ", "cell 2: source"),
        (
            '"nbval-check-output"',
            '"other"',
            "cell 2: tags ['nbval-check-output'] against ['other']",
        ),
    ],
)
def test_compare_finds(pair, old, new, complaint):
    md, ipynb = pair
    ipynb.write_text(ipynb.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    (found,) = notebooks.compare(md, ipynb)
    assert complaint in found


def test_compare_finds_cells_of_another_type_or_number(pair):
    md, ipynb = pair
    notebook = nbformat.read(ipynb, as_version=4)
    notebook.cells = [new_code_cell("# A chapter", id="a"), *notebook.cells[1:], new_code_cell("x")]
    nbformat.write(notebook, ipynb)
    number, kind = notebooks.compare(md, ipynb)
    assert "has 2 cells" in number and "has 3" in number
    assert "cell_type 'markdown' against 'code'" in kind


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Proactor event loop:RuntimeWarning")  # on Windows
def test_a_twin_is_run_in_the_default_tier_and_is_the_same_each_time(pair, monkeypatch):
    md, ipynb = pair
    monkeypatch.setenv("PTAE_TIER", "full")
    notebooks.write(md)
    first = ipynb.read_bytes()
    notebooks.write(md)
    assert ipynb.read_bytes() == first
    (output,) = nbformat.read(ipynb, as_version=4).cells[1].outputs
    assert (output.name, output.text) == ("stdout", "replay\nend\n")


def test_a_failing_chapter_leaves_its_twin_alone(pair, monkeypatch, capsys):
    md, ipynb = pair
    before = ipynb.read_bytes()
    md.write_text(CHAPTER.replace('print("end")', "1 / 0"), encoding="utf-8")
    monkeypatch.setattr(notebooks, "notebook_files", lambda book, names: [md])
    assert notebooks.main([]) == 1
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert ipynb.read_bytes() == before


def outputs_after_cleaning(*bundles):
    cell = new_code_cell(outputs=[new_output("display_data", data=data) for data in bundles])
    cell.metadata["execution"] = {"iopub.status.busy": "2026-01-01"}
    notebook = new_notebook(cells=[cell], metadata={"widgets": {}})
    notebooks.clean(notebook)
    assert "widgets" not in notebook.metadata and "execution" not in cell.metadata
    return [output.data for output in notebook.cells[0].outputs]


def test_viewers_and_widgets_are_dropped_and_what_stands_in_for_them_stays():
    viewer, panel = "<iframe data-ptae-embed></iframe>", "<b>panel</b>"
    assert outputs_after_cleaning(
        {"text/html": viewer, "image/png": "AA=="},
        {"text/html": panel, notebooks.WIDGET_VIEW: {"model_id": "1"}, "text/plain": "panel"},
        {notebooks.WIDGET_VIEW: {"model_id": "2"}},
    ) == [{"image/png": "AA=="}, {"text/html": panel, "text/plain": "panel"}]


def test_a_viewer_without_a_picture_is_an_error():
    with pytest.raises(ArtefactError, match="stand in"):
        outputs_after_cleaning({"text/html": "<iframe data-ptae-embed></iframe>"})


def test_ids_follow_the_content():
    def ids(*sources):
        notebook = notebook_of(*sources)
        notebooks.set_ids(notebook)
        return [cell.id for cell in notebook.cells[1:]]

    assert ids("a", "b") == ids("a", "b")
    assert ids("new", "a", "b")[1:] == ids("a", "b")
    assert len(set(ids("a", "a", "a"))) == 3


def test_a_large_notebook_is_refused():
    with pytest.raises(ArtefactError, match="limit is 500000"):
        notebooks.to_bytes(notebook_of("x" * notebooks.LIMIT_BYTES), "01_large.ipynb")


# ---------------------------------------------------------------- what a reader wrote stays


def edit(ipynb, old, new):
    """As an editor does that knows nothing of pairs."""
    text = ipynb.read_text(encoding="utf-8")
    assert old in text
    ipynb.write_text(text.replace(old, new), encoding="utf-8")


@pytest.fixture
def command(pair, monkeypatch):
    """`run.py notebooks` on the small chapter, whose cells are not run."""
    monkeypatch.setattr(notebooks, "notebook_files", lambda book, names: [pair[0]])
    monkeypatch.setattr(notebooks, "execute", lambda notebook, folder: None)
    return notebooks.main


def test_a_new_source_is_written_into_its_twin(pair, command):
    md, ipynb = pair
    md.write_text(CHAPTER.replace("# A chapter", "# Another"), encoding="utf-8")
    assert notebooks.edits(md) == ""
    assert command([]) == 0
    assert "# Another" in ipynb.read_text(encoding="utf-8")


@pytest.mark.parametrize("change", ["edited", "added", "deleted", "tagged"])
def test_cells_that_were_changed_in_the_twin_alone_are_not_overwritten_unasked(
    pair, command, capsys, change
):
    md, ipynb = pair
    notebook = nbformat.read(ipynb, as_version=4)
    if change == "edited":
        notebook.cells[1].source = "mine = 1"
    elif change == "added":
        notebook.cells.append(new_code_cell("mine = 1"))
    elif change == "deleted":
        del notebook.cells[1]
    else:
        notebook.cells[1].metadata["tags"] = ["mine"]
    nbformat.write(notebook, ipynb)
    before = [path.read_bytes() for path in pair]
    assert command([]) == 1
    said = capsys.readouterr().err
    where = {"added": "3 of the .ipynb", "deleted": "2 of the .md"}.get(change, "2 of the .ipynb")
    assert where in said and "--from ipynb" in said and len(said.splitlines()) == 1
    assert [path.read_bytes() for path in pair] == before


@pytest.mark.parametrize("side", ["ipynb", "md"])
def test_either_side_can_be_kept(pair, command, side):
    md, ipynb = pair
    edit(ipynb, "# A chapter", "# Mine")
    md.write_text(CHAPTER.replace('print("end")', "print('other')"), encoding="utf-8")
    assert command(["--from", side]) == 0
    assert notebooks.compare(md, ipynb) == [] and notebooks.edits(md) == ""
    assert ("# Mine" in md.read_text(encoding="utf-8")) is (side == "ipynb")
    assert md.read_text(encoding="utf-8").startswith(CHAPTER[: CHAPTER.index("# A chapter")])
    assert command([]) == 0


@pytest.mark.slow
def test_the_numbers_of_exercises_are_renewed_without_their_mistakes(tmp_path):
    md = tmp_path / "01_small.md"
    assert not notebooks.renew_sheet(md)  # there is none
    sheet = tmp_path / "exercises" / md.name
    sheet.parent.mkdir()
    cell = "```{code-cell} ipython3\n%s\n```\n\n"
    wrong = cell % ":tags: [mistake]\n\nfar = 3"
    text = HEADER + "\n" + cell % "far = 59" + wrong + "It goes ?<!--{far} mm-->.\n"
    sheet.write_text(text, encoding="utf-8")
    assert notebooks.renew_sheet(md)
    assert sheet.read_text("utf-8") == text.replace("?<", "59\N{NO-BREAK SPACE}mm<")


def test_a_twin_that_was_only_run_or_saved_with_its_source_holds_no_edits(pair):
    md, ipynb = pair
    notebook = nbformat.read(ipynb, as_version=4)
    notebook.cells[1].outputs = [new_output("stream", text="2")]
    nbformat.write(notebook, ipynb)
    assert notebooks.edits(md) == ""
    for path in pair:  # as JupyterLab does, which knows nothing of the stamp
        path.write_text(path.read_text(encoding="utf-8").replace("# A c", "# My c"), "utf-8")
    assert notebooks.edits(md) == ""


def test_a_missing_source_is_written_from_its_twin_when_asked(pair, command, capsys):
    md, ipynb = pair
    md.unlink()
    assert command([]) == 1 and "01_small.md is missing" in capsys.readouterr().err
    assert command(["--from", "md"]) == 1 and "--from ipynb" in capsys.readouterr().err
    assert command(["--from", "ipynb"]) == 0
    assert md.read_text(encoding="utf-8") == CHAPTER
    ipynb.unlink()
    assert command(["--from", "ipynb"]) == 1 and "is missing" in capsys.readouterr().err


@pytest.mark.parametrize("content", ["", "<<<<<<< ours", "[]", "{}"])
def test_a_twin_that_is_no_notebook_is_not_overwritten_unasked(pair, command, capsys, content):
    md, ipynb = pair
    ipynb.write_text(content, encoding="utf-8")
    assert command([]) == 1
    assert "is no notebook" in capsys.readouterr().err
    assert ipynb.read_text(encoding="utf-8") == content
    assert command(["--from", "md"]) == 0 and notebooks.compare(md, ipynb) == []


def save_as_jupyterlab(folder, name):
    """Open a pair, run it (or so it looks) and save it, by the server's own manager of files."""
    manager = build_async_jupytext_contents_manager_class(AsyncLargeFileManager)(root_dir=folder)

    async def work():
        notebook = (await manager.get(name, type="notebook", content=True))["content"]
        notebook.metadata["kernelspec"] = {
            "name": "python3", "language": "python", "display_name": "My Python (hub)"
        }  # fmt: skip
        notebook.metadata["language_info"] = {"name": "python", "version": "3.99.0"}
        notebook.metadata["widgets"] = {"application/vnd.jupyter.widget-state+json": {"state": {}}}
        for number, cell in enumerate(code_cells(notebook)):
            cell.execution_count = number
            cell.metadata |= {"execution": {"iopub.status.busy": "2026"}, "trusted": True}
            cell.outputs = [new_output("stream", text=f"run {number}")]
        await manager.save({"type": "notebook", "format": "json", "content": notebook}, name)

    try:
        asyncio.run(work())
    finally:
        manager.notary.store.close()  # a database, of whom the reader trusts


@pytest.mark.parametrize("md", CHAPTERS, ids=lambda path: path.stem)
def test_saving_a_chapter_that_was_only_run_changes_nothing_in_its_source(md, tmp_path):
    copy = tmp_path / md.name
    copy.write_bytes(md.read_bytes())
    notebook = notebooks.read(md)
    notebooks.clean(notebook)
    copy.with_suffix(".ipynb").write_bytes(notebooks.to_bytes(notebook, md.name))
    save_as_jupyterlab(str(tmp_path), f"{md.stem}.ipynb")
    assert "run 0" in copy.with_suffix(".ipynb").read_text(encoding="utf-8")
    assert copy.read_bytes() == md.read_bytes()


def test_a_twin_is_converted_to_a_python_script(pair):
    _, ipynb = pair
    notebook = nbformat.read(ipynb, as_version=4)
    body, found = ScriptExporter().from_notebook_node(notebook)
    assert found["output_extension"] == ".py" and 'print("end")' in body

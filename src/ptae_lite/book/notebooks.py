"""Write the notebook twins of the chapters: `python3 run.py notebooks [NAME ...]`.

A chapter is a pair of files. `NN_name.md` (MyST Markdown) is the source, which people edit and
review. `NN_name.ipynb` has the same cells with their outputs, for readers who look at it where
nothing runs. This command makes the second from the first. The same cells and outputs give the same
bytes, so a difference in a twin always means something. A twin stores a hash of its cells. So cells
that a reader changed only in the twin are never overwritten without being asked.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections import Counter
from difflib import SequenceMatcher
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellControlSignal, DeadKernelError
from nbformat import NotebookNode

from ptae_lite.book import numbers
from ptae_lite.book.chapters import EXERCISES, notebook_files, notice
from ptae_lite.errors import ArtefactError, FileError
from ptae_lite.files import atomic_write
from ptae_lite.pipes import piped

LIMIT_BYTES = 500_000
EMBED_MARK = "data-ptae-embed"  # stands in the HTML of every 3-D viewer
WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
TIMEOUT_S = 600  # for a cell
# Tools that convert notebooks need these. The running version of Python is left out, because it
# differs between readers.
LANGUAGE = {"name": "python", "file_extension": ".py", "nbconvert_exporter": "python"}
# Set in the twins only. In a source, JupyterLab would replace it by this machine's name for Python.
KERNEL = {"name": "python3", "language": "python", "display_name": "Python 3"}
FOLDED = {"hide-input", "remove-input"}  # tags of cells whose code a page folds or leaves out
MISTAKE = "mistake"  # tag of an exercise's cells that do not run
STAMP = "ptae_lite"  # key in a twin's metadata: the hash of the cells it was written with


def read(md: Path) -> NotebookNode:
    """A chapter's source as a notebook without outputs.

    Raises:
        ArtefactError: the file is missing.
    """
    if not md.is_file():
        raise ArtefactError(
            f"{md} is missing; write it from its notebook: run.py notebooks {md.stem} --from ipynb"
        )
    return jupytext.read(md, fmt="md:myst")


def execute(notebook: NotebookNode, folder: Path, *, static: bool = False) -> None:
    """Run every cell in `folder`, in the default tier whatever the environment says.

    Args:
        static: for a page without a kernel, where panels hold all their pictures.
    """
    env = {**os.environ, "PTAE_TIER": "replay", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
    env["PTAE_STATIC"] = str(int(static))  # in JupyterLab, a kernel answers the sliders
    env["SOURCE_DATE_EPOCH"] = "0"  # matplotlib writes this date into its SVG files
    # no time stamps, which differ in every run, and no widget state, which nothing reads later
    options = {"timeout": TIMEOUT_S, "record_timing": False, "store_widget_state": False}
    quiet = ["--IPKernelApp.log_level=40"]  # no warnings about this machine
    client = NotebookClient(notebook, kernel_name="python3", extra_arguments=quiet, **options)
    client.execute(cwd=str(folder), env=env)


def clean(notebook: NotebookNode) -> None:
    """Remove from a notebook what must not be in the repository; fold the code a page folds."""
    notebook.metadata.pop("widgets", None)
    notebook.metadata["language_info"] = dict(LANGUAGE)
    notebook.metadata["kernelspec"] = dict(KERNEL)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.metadata.pop("execution", None)
            if FOLDED & set(cell.metadata.get("tags", [])):
                cell.metadata["jupyter"] = {"source_hidden": True}  # as JupyterLab says it
            cell.outputs = _clean_outputs(cell.outputs)


def _clean_outputs(outputs: list[NotebookNode]) -> list[NotebookNode]:
    kept = []
    for output in outputs:
        if output.get("name") == "stderr":
            continue
        _clean_bundle(output.get("data", {}))
        if output.get("data") == {}:
            continue
        if output.output_type == "stream" and kept and kept[-1].output_type == "stream":
            kept[-1].text += output.text  # where a stream is cut in two is a matter of chance
        else:
            kept.append(output)
    return kept


def _clean_bundle(bundle: dict) -> None:
    bundle.pop(WIDGET_VIEW, None)
    if EMBED_MARK in bundle.get("text/html", ""):
        if not {"image/png", "text/plain"} & bundle.keys():
            raise ArtefactError("A 3-D viewer needs an image/png or text/plain to stand in for it.")
        del bundle["text/html"]


def set_ids(notebook: NotebookNode) -> None:
    """Give each cell an id made from its content, so a new cell does not change the others."""
    seen = Counter()
    for cell in notebook.cells:
        content = f"{cell.cell_type}\n{cell.source}"
        seen[content] += 1
        cell.id = hashlib.sha256(f"{seen[content]}\n{content}".encode()).hexdigest()[:12]


def to_bytes(notebook: NotebookNode, name: str) -> bytes:
    """The notebook as the bytes of its file.

    Raises:
        ArtefactError: it is too large.
    """
    nbformat.validate(notebook)
    data = nbformat.writes(notebook).encode() + b"\n"
    if len(data) > LIMIT_BYTES:
        raise ArtefactError(f"{name} has {len(data)} bytes, and the limit is {LIMIT_BYTES}.")
    return data


def write(md: Path) -> Path:
    """Run a chapter, renew the numbers in its text and write its twin.

    The source is set as JupyterLab would save it. If anything fails, both files stay as they were.
    """
    source, notebook = read(md), read(md)
    numbers.ask(notebook)
    execute(notebook, md.parent.resolve())
    values = numbers.take(notebook)
    for one in (source, notebook):
        in_order = iter(values)
        for cell in one.cells:
            if cell.cell_type == "markdown":
                cell.source = numbers.fill(cell.source, in_order)
    clean(notebook)
    set_ids(notebook)
    notebook.metadata[STAMP] = {"cells": fingerprint(notebook)}
    ipynb = md.with_suffix(".ipynb")
    content = to_bytes(notebook, ipynb.name)
    text = jupytext.writes(source, fmt="md:myst")
    with atomic_write(md) as new_md, atomic_write(ipynb) as new_ipynb:
        new_md.write_text(text, encoding="utf-8", newline="\n")
        new_ipynb.write_bytes(content)  # neither takes its place before both are there
    return ipynb


def renew_sheet(md: Path) -> bool:
    """Run the exercises of a chapter, with their answers, and renew the numbers in their text.

    Returns:
        Whether there is such a sheet, and it has numbers.
    """
    sheet = md.parent / EXERCISES / md.name
    if not sheet.is_file() or not numbers.COMMENT.search(text := sheet.read_text(encoding="utf-8")):
        return False
    notebook = read(sheet)
    notebook.cells = [c for c in notebook.cells if MISTAKE not in c.metadata.get("tags", [])]
    numbers.ask(notebook)
    execute(notebook, sheet.parent.resolve())
    with atomic_write(sheet) as temporary:
        text = numbers.fill(text, iter(numbers.take(notebook)))
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return True


def fingerprint(notebook: NotebookNode) -> str:
    """A hash of the cells' types, sources and tags."""
    return hashlib.sha256(json.dumps(_written(notebook)).encode()).hexdigest()[:16]


def _written(notebook: NotebookNode) -> list[tuple]:
    tags = (tuple(cell.metadata.get("tags", ())) for cell in notebook.cells)
    return [(cell.cell_type, cell.source, t) for cell, t in zip(notebook.cells, tags, strict=True)]


def edits(md: Path) -> str:
    """The cells in which a pair differs because its twin was edited, in words; else empty.

    A twin that is unchanged since this module wrote it has no edits: only the source is new.
    """
    twin = _twin(md)
    if twin is None or twin.metadata.get(STAMP, {}).get("cells") == fingerprint(twin):
        return ""
    if not md.is_file():
        return f"all, for {md.name} is missing"
    sources, twins = _written(read(md)), _written(twin)
    ours, theirs = [], []
    for kind, a, b, c, d in SequenceMatcher(None, sources, twins, autojunk=False).get_opcodes():
        if kind != "equal":
            theirs += range(c + 1, d + 1)
            ours += range(a + 1, b + 1) if c == d else ()
    sides = (f"{', '.join(map(str, numbers))} of the {end}"
             for numbers, end in ((theirs, ".ipynb"), (ours, ".md")) if numbers)  # fmt: skip
    return " and ".join(sides)


def _twin(md: Path) -> NotebookNode | None:
    """A chapter's twin, if there is one.

    Raises:
        ArtefactError: the file is not a notebook.
    """
    ipynb = md.with_suffix(".ipynb")
    if not ipynb.exists():
        return None
    try:
        return nbformat.read(ipynb, as_version=4)
    except Exception as error:  # a file that is not a notebook can fail with any error
        raise ArtefactError(
            f"{ipynb} is no notebook ({type(error).__name__}); if nothing in it matters, write it "
            f"anew: run.py notebooks {md.stem} --from md"
        ) from None


def refuse_edited(mds: list[Path]) -> None:
    """Check that no twin has cells that a reader wrote and the source lacks.

    Raises:
        ArtefactError: one has.
    """
    found = {md: words for md in mds if (words := edits(md))}
    if found:
        raise ArtefactError("\n".join(
            f"{md.stem}: the .ipynb was edited, and differs from the .md in cells {words}; keep "
            f"the cells of the one or the other: run.py notebooks {md.stem} --from ipynb (or md)."
            for md, words in found.items()
        ))  # fmt: skip


def take_cells(md: Path) -> None:
    """Write a chapter's source from the cells of its twin. The source's header stays.

    Raises:
        ArtefactError: the twin is missing.
    """
    twin = _twin(md)
    if twin is None:
        raise ArtefactError(f"{md.with_suffix('.ipynb')} is missing, so nothing is taken from it.")
    for cell in twin.cells:
        cell.metadata.pop("vscode", None)
    if md.is_file():
        twin.metadata = read(md).metadata
    with atomic_write(md) as temporary:
        temporary.write_text(jupytext.writes(twin, fmt="md:myst"), encoding="utf-8", newline="\n")


def compare(md: Path, ipynb: Path) -> list[str]:
    """The differences of a pair in its cells' types, sources or tags, in words.

    Outputs do not count.
    """
    sources, twins = read(md).cells, nbformat.read(ipynb, as_version=4).cells
    differences = []
    if len(sources) != len(twins):
        differences.append(f"{md.name} has {len(sources)} cells, {ipynb.name} has {len(twins)}")
    for number, (source, twin) in enumerate(zip(sources, twins, strict=False), start=1):
        where = f"{md.stem}, cell {number}"
        for what in ("cell_type", "source", "tags"):
            a, b = (cell.get(what, cell.metadata.get(what)) or [] for cell in (source, twin))
            if a != b:
                differences.append(f"{where}: {what} {a!r} against {b!r}")
    return differences


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py notebooks`."""
    made = argparse.ArgumentParser(
        prog="run.py notebooks", description="Run chapters and write their .ipynb twins."
    )
    made.add_argument(
        "names", nargs="*", metavar="NAME", help="chapters or pages in depth, such as 01_simulation"
    )
    made.add_argument("--from", dest="side", choices=("md", "ipynb"),
                      help="whose cells to keep where the .ipynb alone was edited")  # fmt: skip
    return made


def main(argv: list[str]) -> int:
    """Write the twins; returns the exit code."""
    args = parser().parse_args(argv)
    book = Path("book")
    try:
        chosen = notebook_files(book, args.names)
        if args.side is None:
            refuse_edited(chosen)
        if line := notice(book):
            print(line, flush=True)
        for md in chosen:
            if args.side == "ipynb":
                take_cells(md)
            print(f"Running {md} ...", flush=True)
            ipynb = write(md)
            print(f"wrote {ipynb}, {ipynb.stat().st_size / 1e3:.0f} kB", flush=True)
            if renew_sheet(md):
                print(f"renewed the numbers of its exercises, {EXERCISES}/{md.name}", flush=True)
    except (ArtefactError, FileError, CellControlSignal, DeadKernelError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(piped(lambda: main(sys.argv[1:])))

"""Write the notebook twins of the chapters: `python -m ptae_lite.book.notebooks [NAME ...]`.

A chapter is a pair. `NN_name.md` (MyST Markdown) is the source that people edit and review;
`NN_name.ipynb` has the same cells with their outputs, for readers who look at the notebook where
nothing runs. This command makes the second from the first. The same cells with the same outputs
give the same bytes, so a difference in a twin always means something.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
from collections import Counter
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellControlSignal, DeadKernelError
from nbformat import NotebookNode

from ptae_lite.errors import ArtefactError, FileError
from ptae_lite.files import whole
from ptae_lite.pipes import piped

LIMIT_BYTES = 500_000
EMBED_MARK = "data-ptae-embed"  # stands in the HTML of every 3-D viewer
WIDGET_VIEW = "application/vnd.jupyter.widget-view+json"
TIMEOUT_S = 600  # for a cell


def chapters(book: Path, names: list[str] | None = None) -> list[Path]:
    """The chapters' sources in order; `names` ("01_simulation") restricts them."""
    found = {path.stem: path for path in sorted(book.glob("[0-9]*.md"))}
    wanted = [Path(name).stem for name in names] if names else list(found)
    unknown = [name for name in wanted if name not in found]
    if unknown:
        raise ArtefactError(f"No chapter {unknown[0]} in {book}; there are: {', '.join(found)}.")
    return [found[name] for name in wanted]


def read(md: Path) -> NotebookNode:
    """A chapter's source as a notebook without outputs."""
    return jupytext.read(md, fmt="md:myst")


def execute(notebook: NotebookNode, folder: Path) -> None:
    """Run every cell in `folder`, in the default tier whatever the caller's environment says."""
    env = {**os.environ, "PTAE_TIER": "replay", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
    env["SOURCE_DATE_EPOCH"] = "0"  # matplotlib dates its SVG files; so every run gets the same
    # Neither time stamps, which differ in every run, nor widget state, which nothing reads later.
    options = {"timeout": TIMEOUT_S, "record_timing": False, "store_widget_state": False}
    client = NotebookClient(notebook, kernel_name="python3", **options)
    client.execute(cwd=str(folder), env=env)


def clean(notebook: NotebookNode) -> None:
    """Drop from a notebook what does not belong into the repository."""
    notebook.metadata.pop("widgets", None)
    notebook.metadata["language_info"] = {"name": "python"}  # without the running version
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.metadata.pop("execution", None)
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
    """Name each cell after its content, so that inserting a cell leaves the other names alone."""
    seen = Counter()
    for cell in notebook.cells:
        content = f"{cell.cell_type}\n{cell.source}"
        seen[content] += 1
        cell.id = hashlib.sha256(f"{seen[content]}\n{content}".encode()).hexdigest()[:12]


def to_bytes(notebook: NotebookNode, name: str) -> bytes:
    """The notebook as it stands in its file; an `ArtefactError` where it is too large."""
    nbformat.validate(notebook)
    data = nbformat.writes(notebook).encode() + b"\n"
    if len(data) > LIMIT_BYTES:
        raise ArtefactError(f"{name} has {len(data)} bytes, and the limit is {LIMIT_BYTES}.")
    return data


def write(md: Path) -> Path:
    """Run a chapter and write its twin, which stays as it was when anything fails."""
    notebook = read(md)
    execute(notebook, md.parent.resolve())
    clean(notebook)
    set_ids(notebook)
    ipynb = md.with_suffix(".ipynb")
    content = to_bytes(notebook, ipynb.name)
    with whole(ipynb) as beside:
        beside.write_bytes(content)
    return ipynb


def compare(md: Path, ipynb: Path) -> list[str]:
    """Where a pair differs in its cells' types, sources or tags, in words; outputs do not count."""
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


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(description="Run chapters and write their .ipynb twins.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="chapters, such as 01_simulation")
    args = parser.parse_args(argv)
    try:
        for md in chapters(Path("book"), args.names):
            print(f"Running {md} ...", flush=True)
            ipynb = write(md)
            print(f"wrote {ipynb}, {ipynb.stat().st_size / 1e3:.0f} kB", flush=True)
    except (ArtefactError, FileError, CellControlSignal, DeadKernelError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(piped(lambda: main(sys.argv[1:])))

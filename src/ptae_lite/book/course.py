"""Make the course's notebooks from its exercises: `python3 run.py course OUT`.

`book/exercises/NN_name.md` has the exercises of chapter NN: questions, answers, checks, and likely
mistakes. Two notebooks are made from it: the student's, with stubs, and the instructor's, with the
answers. Their cells have nbgrader's marks, and nbgrader can make the student's notebook from the
instructor's.

An exercise begins with a heading such as `## 3.1 Write code: attention (20 min)`. Tags say what its
cells are. Cells without a tag are in both notebooks:

- `answer`, a text: the answer, what to listen for, misconceptions. The student has a stub.
- `answer`, code: the part between BEGIN SOLUTION and END SOLUTION is a stub for the student.
- `check`: says in one sentence what the reader's code lacks; see `exercise_check.check`.
- `mistake`: code in place of the answer, for the tests only. Its metadata `hint` is a part of the
  sentence that the check must give for it.
"""

from __future__ import annotations

import argparse
import copy
import re
import shutil
import sys
import tempfile
from dataclasses import dataclass
from html import escape
from pathlib import Path

import jupytext
from nbformat import NotebookNode

from ptae_lite.book import notebooks
from ptae_lite.book.chapters import chapter_names
from ptae_lite.errors import ArtefactError, PTAEError
from ptae_lite.files import as_called
from ptae_lite.pipes import piped

FOLDER = Path("book", "exercises")
FRONT_PAGE = "for_the_teacher.md"
KINDS = ("Write code", "Move a panel", "Think")
PARTS = ("**Answer.**", "**Listen for.**", "**Misconceptions.**")  # of an answer in words
TAGS = {"answer", "check", "mistake"}
BEGIN, END = "### BEGIN SOLUTION", "### END SOLUTION"
SEED = "SEED = 0"  # the line that `--seed` changes
# The stubs of nbgrader, so that its student's notebook is the same as ours.
CODE_STUB = ("# YOUR CODE HERE", "raise NotImplementedError()")
TEXT_STUB = "YOUR ANSWER HERE"
_HEADING = re.compile(r"## (\d+)\.(\d+) ([\w ]+): (.+) \((\d+) min\)$", re.MULTILINE)


@dataclass(frozen=True)
class Exercise:
    """One exercise: what its heading says, and its cells."""

    number: str
    kind: str
    title: str
    minutes: int
    cells: list[NotebookNode]

    def tagged(self, tag: str, cell_type: str = "code") -> list[NotebookNode]:
        """Its cells of a type that have a tag."""
        return [cell for cell in self.cells if cell.cell_type == cell_type and tag in tags(cell)]


@dataclass(frozen=True)
class Sheet:
    """The exercises of a chapter. `opening` are the cells before the first one."""

    name: str
    opening: list[NotebookNode]
    exercises: list[Exercise]
    metadata: NotebookNode

    @property
    def title(self) -> str:
        """The heading of the chapter's exercises."""
        return self.opening[0].source.splitlines()[0].removeprefix("# ")


def tags(cell: NotebookNode) -> list[str]:
    """The tags of a cell."""
    return cell.metadata.get("tags", [])


def sheets(folder: Path = FOLDER) -> list[Sheet]:
    """The exercises of all chapters, in order.

    Raises:
        ArtefactError: there are none, or one of them lacks something.
    """
    folder = Path(folder).resolve()
    files = [folder / f"{name}.md" for name in chapter_names(folder.parent)]
    found = [read(md) for md in files if md.is_file()]
    if not found:
        raise ArtefactError(f"No exercises in {folder}; they are files such as 01_simulation.md.")
    return found


def read(md: Path) -> Sheet:
    """The exercises of a chapter.

    Raises:
        ArtefactError: one of them lacks something. The message says what.
    """
    notebook = jupytext.read(md, fmt="md:myst")
    groups: list[list[NotebookNode]] = [[]]
    for cell in notebook.cells:
        if cell.cell_type == "markdown" and cell.source.startswith("## "):
            groups.append([])
        groups[-1].append(cell)
    opening, *parts = groups
    if not opening or not opening[0].source.startswith("# ") or not parts:
        raise ArtefactError(f"{md.name} needs a title, and exercises that begin with ##.")
    if sum(cell.source.splitlines().count(SEED) for cell in notebook.cells) != 1:
        raise ArtefactError(f"{md.name} needs the line {SEED} once, for run.py course --seed.")
    exercises = [_exercise(md, place, cells) for place, cells in enumerate(parts, start=1)]
    return Sheet(md.stem, opening, exercises, notebook.metadata)


def _exercise(md: Path, place: int, cells: list[NotebookNode]) -> Exercise:
    heading = cells[0].source.splitlines()[0]
    found = _HEADING.match(heading)
    number = f"{int(md.stem.split('_')[0])}.{place}"
    if not found or f"{found[1]}.{found[2]}" != number or found[3] not in KINDS:
        raise ArtefactError(
            f"{md.name}: the heading {heading!r} must be like '## {number} Think: title (10 min)', "
            f"with one of {', '.join(KINDS)}."
        )
    exercise = Exercise(number, found[3], found[4], int(found[5]), cells)
    lacks = _lacks(exercise)
    if lacks:
        raise ArtefactError(f"{md.name}, exercise {number}: {lacks}.")
    return exercise


def _lacks(one: Exercise) -> str:
    unknown = sorted({tag for cell in one.cells for tag in tags(cell)} - TAGS)
    words, code = one.tagged("answer", "markdown"), one.tagged("answer")
    wanted = int(one.kind == "Write code")
    sources = [cell.source for cell in one.cells if cell.cell_type == "code"]
    if unknown:
        return f"there is no tag {unknown[0]!r}; there are {', '.join(sorted(TAGS))}"
    if len(words) != 1 or any(part not in words[0].source for part in PARTS):
        return f"it needs one answer in words, with {', '.join(PARTS)}"
    if (len(code), len(one.tagged("check"))) != (wanted, wanted):
        return f"{one.kind!r} needs {wanted} answers in code and as many checks"
    if code and (code[0].source.count(BEGIN), code[0].source.count(END)) != (1, 1):
        return f"its answer in code needs {BEGIN} and {END} once"
    if len(one.tagged("mistake")) < 2 * wanted:
        return "it needs two likely mistakes"
    if any(not cell.metadata.get("hint") for cell in one.tagged("mistake")):
        return "each mistake needs a hint in its metadata"
    if one.kind == "Move a panel" and not any("Panel(" in source for source in sources):
        return "there is no Panel in it"
    return ""


def stub(cell: NotebookNode) -> str:
    """What the student finds instead of an answer. nbgrader writes the same."""
    if cell.cell_type == "markdown":
        return TEXT_STUB
    head, rest = cell.source.split(BEGIN)
    indent, tail = head[len(head.rstrip(" ")) :], rest.split(END)[1]
    return head + f"\n{indent}".join(CODE_STUB) + tail


def notebook(sheet: Sheet, *, student: bool, seed: int = 0) -> NotebookNode:
    """A chapter's exercises as a notebook without outputs, for a student or an instructor."""
    cells = copy.deepcopy(sheet.opening)
    for exercise in sheet.exercises:
        for cell in copy.deepcopy(exercise.cells):
            tag = next(iter(tags(cell)), None)
            if tag == "mistake":
                continue
            if tag and cell.cell_type == "markdown":
                cell.metadata = _marks(exercise, "words", cell, grade=True, solution=True)
            elif tag:
                part = {"answer": "code", "check": "check"}[tag]
                graded = tag == "check"
                cell.metadata = _marks(exercise, part, cell, grade=graded, solution=not graded)
            if tag and student:  # nbgrader protects the instructor's cells when it releases them
                cell.metadata["deletable"] = False
                if tag == "check":
                    cell.metadata["editable"] = False
            if student and tag == "answer":
                cell.source = stub(cell)
            cells.append(cell)
    for cell in cells:
        lines = cell.source.split("\n")
        cell.source = "\n".join(f"SEED = {seed}" if line == SEED else line for line in lines)
    metadata = copy.deepcopy(sheet.metadata)
    metadata.pop("jupytext", None)  # these notebooks have no .md twin
    made = NotebookNode(nbformat=4, nbformat_minor=5, metadata=metadata, cells=cells)
    notebooks.set_ids(made)
    return made


def _marks(exercise: Exercise, part: str, cell: NotebookNode, *, grade: bool, solution: bool):
    """nbgrader's metadata. An answer in code is graded in its check, one in words in itself."""
    marks = {
        "grade": grade,
        "solution": solution,
        "locked": grade and not solution,
        "task": False,
        "grade_id": f"exercise-{exercise.number.replace('.', '-')}-{part}",
        "schema_version": 3,
        "cell_type": cell.cell_type,
    }
    return NotebookNode(nbgrader=NotebookNode(marks | ({"points": 1} if grade else {})))


def write(out: Path, folder: Path = FOLDER, seed: int = 0) -> list[Path]:
    """Write `student/` and `instructor/` into a new folder, all or nothing; returns the files.

    Raises:
        ArtefactError: the folder is not empty (it may hold somebody's work), or is inside the book.
    """
    out = Path(out).absolute()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ArtefactError(f"{out} is there already; name a new folder, nothing was written.")
    if out.is_relative_to(Path(folder).absolute().parent):
        raise ArtefactError(f"{out} lies in the book; name a folder outside, nothing was written.")
    files = {}
    for sheet in sheets(folder):
        for who in ("student", "instructor"):
            name = f"{who}/{sheet.name}.ipynb"
            files[name] = notebooks.to_bytes(
                notebook(sheet, student=who == "student", seed=seed), name
            )
    files[f"instructor/{FRONT_PAGE}"] = (Path(folder) / FRONT_PAGE).read_bytes()
    out.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        for name, data in files.items():
            (made / name).parent.mkdir(exist_ok=True)
            (made / name).write_bytes(data)
        made.chmod(0o755)  # only the owner may open a temporary folder
        if out.exists():
            out.rmdir()
        made.rename(out)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise
    return [out / name for name in files]


class Table:
    """The exercises of all chapters, for the course's page."""

    def __init__(self, folder: Path | str = "exercises"):
        self.sheets = sheets(Path(folder))

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{one.number}</td><td>{escape(one.title)}</td>"
            f"<td>{escape(one.kind.lower())}</td><td>{one.minutes}</td></tr>"
            for sheet in self.sheets
            for one in sheet.exercises
        )
        heads = "".join(f"<th>{head}</th>" for head in ("", "exercise", "kind", "minutes"))
        return f'<table class="contents"><thead><tr>{heads}</tr></thead>{rows}</table>'


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py course`."""
    made = argparse.ArgumentParser(
        prog="run.py course", description="Write the student's and instructor's notebooks."
    )
    made.add_argument("out", type=as_called, metavar="OUT", help="a new folder")
    made.add_argument("--seed", type=int, default=0, help="other numbers in the exercises")
    return made


def main(argv: list[str]) -> int:
    """Write the notebooks; returns the exit code."""
    args = parser().parse_args(argv)
    try:
        written = write(args.out, seed=args.seed)
    except (PTAEError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"wrote {len(written)} files: {args.out}/student and {args.out}/instructor")
    return 0


if __name__ == "__main__":
    sys.exit(piped(lambda: main(sys.argv[1:])))

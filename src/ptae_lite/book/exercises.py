"""The exercises of the course, and the notebooks that are made from them.

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

Numbers in answers are made as in a chapter (see `numbers`); `run.py notebooks NN_name` renews those
of the exercises, too. They are of seed 0.
"""

from __future__ import annotations

import copy
import re
from dataclasses import dataclass
from pathlib import Path

import jupytext
from nbformat import NotebookNode

from ptae_lite.book import notebooks
from ptae_lite.book.chapters import chapter_names
from ptae_lite.errors import ArtefactError

FOLDER = Path("book", "exercises")
KINDS = ("Write code", "Move a panel", "Think")
PARTS = ("**Answer.**", "**Listen for.**", "**Misconceptions.**")  # of an answer in words
TAGS = {"answer", "check", notebooks.MISTAKE}
BEGIN, END = "### BEGIN SOLUTION", "### END SOLUTION"
SEED = "SEED = 0"  # the line that another seed changes
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

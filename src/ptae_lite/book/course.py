"""Write a course: `python3 run.py course OUT`.

- `student/`, `instructor/`: the exercises as notebooks with stubs, and with answers.
- `instructor/`: also the answers to the exercises at the chapters' ends, and an exam.
- `slides/`: the slides of each chapter.
- `course.html`, `data_sheet.html`, `model_cards.html`: pages of the book.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from nbclient.exceptions import CellControlSignal, DeadKernelError

from ptae_lite.book import exam, lecture, notebooks
from ptae_lite.book.exercises import FOLDER, notebook, sheets
from ptae_lite.errors import ArtefactError, PTAEError
from ptae_lite.files import as_called
from ptae_lite.pipes import piped

FOR_TEACHERS = ("for_the_teacher.md", "chapter_answers.md")  # beside the exercises


def refuse_old(out: Path, folder: Path = FOLDER) -> None:
    """Check that a course can be written there.

    Raises:
        ArtefactError: the folder is not empty (it may hold somebody's work), or is inside the book.
    """
    out = Path(out).absolute()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ArtefactError(f"{out} is there already; name a new folder, nothing was written.")
    if out.is_relative_to(Path(folder).absolute().parent):
        raise ArtefactError(f"{out} lies in the book; name a folder outside, nothing was written.")


def write(
    out: Path, folder: Path = FOLDER, seed: int = 0, more: Mapping[str, bytes] | None = None
) -> list[Path]:
    """Write the exercises and the exam into a new folder, all or nothing; returns the files.

    Args:
        out: the new folder.
        folder: the exercises.
        seed: of the numbers in exercises and exam.
        more: other files, by name.

    Raises:
        ArtefactError: see `refuse_old`, or the exercises lack something.
    """
    refuse_old(out, folder)
    out, files = Path(out).absolute(), dict(more or {})
    for sheet in sheets(folder):
        for who in ("student", "instructor"):
            name = f"{who}/{sheet.name}.ipynb"
            made = notebook(sheet, student=who == "student", seed=seed)
            files[name] = notebooks.to_bytes(made, name)
    for name in FOR_TEACHERS:
        files[f"instructor/{name}"] = Path(folder, name).read_bytes()
    files["instructor/exam.md"] = exam.paper(seed).encode()
    files["instructor/exam_answers.md"] = exam.answers(seed).encode()
    out.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        for name, data in files.items():
            (made / name).parent.mkdir(parents=True, exist_ok=True)
            (made / name).write_bytes(data)
        made.chmod(0o755)  # only the owner may open a temporary folder
        if out.exists():
            out.rmdir()
        made.rename(out)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise
    return [out / name for name in files]


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py course`."""
    made = argparse.ArgumentParser(
        prog="run.py course", description="Write exercises, slides, an exam and their answers."
    )
    made.add_argument("out", type=as_called, metavar="OUT", help="a new folder")
    made.add_argument("--seed", type=int, default=0, help="other numbers in exercises and exam")
    return made


def main(argv: list[str]) -> int:
    """Write the course; returns the exit code."""
    args = parser().parse_args(argv)
    try:
        refuse_old(args.out)
        sheets()  # what an author forgot is said at once, and not after the chapters have run
        more = lecture.files(FOLDER.parent, lambda md: print(f"Running {md} ...", flush=True))
        written = write(args.out, seed=args.seed, more=more)
    except (PTAEError, OSError, CellControlSignal, DeadKernelError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"wrote {len(written)} files into {args.out}; begin with slides/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(piped(lambda: main(sys.argv[1:])))

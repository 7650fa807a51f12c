"""Run every chapter and build the site: `python3 run.py book`.

The new site is built beside the old one, and replaces it when Sphinx has ended. A build that is
stopped leaves the old one as it was. The output of Sphinx and of the kernels goes to a log.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from ptae_lite import run_mode
from ptae_lite.artefacts import ROOT
from ptae_lite.book.chapters import notice
from ptae_lite.book.machine import CHAPTER_GB
from ptae_lite.cli import guarded
from ptae_lite.files import as_called, file_lock
from ptae_lite.pipes import piped

TIMES = "chapter_times.json"
ENDED = "chapters_ended.jsonl"  # the book's conf.py adds a line as each chapter ends
LOG = Path("logs", "sphinx.log")
TAIL = 15  # lines shown of a chapter's traceback
POLL_S = 0.2
KILLED = (
    "A chapter's kernel was killed, probably for lack of memory: a chapter takes up to "
    f"{CHAPTER_GB} GB, and two chapters run at a time; python3 run.py doctor says what there is."
)


def build(out, book=ROOT / "book", show: Callable = lambda name, chapter: None) -> dict | None:
    """Build into `out`/html.

    Args:
        show: called with name, seconds and traceback of each chapter when it ends.

    Returns:
        seconds and tracebacks of the chapters, and Sphinx's exit code; None if Sphinx did not end.

    Raises:
        FileError: another run builds into the same folder.
    """
    out = Path(out)
    with file_lock(out / "html"):
        work, done = out / "html.part", out / "html"
        (out / TIMES).unlink(missing_ok=True)  # of an earlier run
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
        # A fresh environment makes Sphinx read, and so execute, every chapter; two at a time.
        options = ["-b", "html", "-W", "--keep-going", "-E", "-j", "2", "-d", work / "doctrees"]
        command = [sys.executable, "-m", "sphinx", *map(str, (*options, book, work / "html"))]
        status = run(command, out / LOG, work / ENDED, show)
        if not (work / TIMES).exists():
            return None
        times = json.loads((work / TIMES).read_text(encoding="utf-8"))
        if done.exists():
            done.rename(work / "before")
        (work / "html").rename(done)
        (work / TIMES).replace(out / TIMES)
        shutil.rmtree(work)
    return {"chapters": times, "status": status}


def run(command: list[str], log: Path, ended: Path, show: Callable) -> int:
    """Run Sphinx with its output in `log`, and show each chapter that appears in `ended`.

    Returns:
        Sphinx's exit code.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    start, shown = time.monotonic(), 0
    with (
        log.open("wb") as file,
        subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT) as process,
    ):
        try:
            while True:
                status = process.poll()  # asked first, so that the last look misses none
                for name, chapter in chapters(ended)[shown:]:
                    clock("")
                    show(name, chapter)
                    shown += 1
                if status is not None:
                    clock("")
                    return status
                clock(f"{shown} have run, {time.monotonic() - start:.0f} s ...")
                time.sleep(POLL_S)
        except BaseException:
            process.kill()
            raise


def chapters(ended: Path) -> list[list]:
    """Name, seconds and traceback of each chapter that has ended, without an unfinished line."""
    text = ended.read_text(encoding="utf-8") if ended.exists() else ""
    return [json.loads(line) for line in text.splitlines(keepends=True) if line.endswith("\n")]


def kernel_was_killed(log: Path) -> bool:
    """Whether the system killed a chapter's kernel. Sphinx then stops."""
    return log.exists() and "DeadKernelError" in log.read_text(encoding="utf-8", errors="replace")


def clock(text: str) -> None:
    """Write the line of a terminal that changes; nothing if the output is not a terminal."""
    if sys.stdout.isatty():
        print(f"\r{text:<60}\r", end="", flush=True)


def chapter_lines(name: str, chapter: dict) -> list[str]:
    """How long a chapter took, and the end of its traceback if it failed."""
    state = "FAILED after" if chapter["traceback"] else "ran in"
    tail = (chapter["traceback"] or "").strip().splitlines()[-TAIL:]
    seconds = chapter["seconds"] or 0
    return [f"{name:<26} {state} {seconds:.1f} s", *("    " + line for line in tail)]


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py book`."""
    made = argparse.ArgumentParser(prog="run.py book", description=__doc__.split(":")[0] + ".")
    made.add_argument("--tier", choices=run_mode.TIERS, help="stored results, short or full runs")
    made.add_argument("--out", type=as_called, default=Path("build"), help="folder that gets html/")
    made.add_argument(
        "--book", type=as_called, default=ROOT / "book", help="folder of the chapters"
    )
    return made


def main(arguments=None) -> int:
    """Build the site; returns the exit code."""
    options = parser().parse_args(arguments)
    log = Path(options.out, LOG)
    if options.tier:
        os.environ["PTAE_TIER"] = options.tier

    def show(name: str, chapter: dict) -> None:
        print("\n".join(chapter_lines(name, chapter)), flush=True)

    def work() -> int:
        print(
            f"Running every chapter (tier {run_mode.tier()}) and building the site ...", flush=True
        )
        if line := notice(Path(options.book)):
            print(line, flush=True)
        built = build(options.out, options.book, show)
        if built is None:
            print(f"The book was not built; {log} says why.")
            if kernel_was_killed(log):
                print(KILLED)
            return 1
        print(f"Open {Path(options.out, 'html', 'index.html')}")
        if built["status"]:
            print(f"The book has faults; {log} says which.")
        return 1 if built["status"] else 0

    return guarded("book", work)


if __name__ == "__main__":
    sys.exit(piped(main))

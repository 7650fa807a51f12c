"""Run every chapter and build the site: `python -m ptae_lite.book.site`.

The new site is built beside the old one and takes its place when Sphinx has come to its end; a
build that is stopped leaves the old one as it was.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

from ptae_lite.artefacts import ROOT
from ptae_lite.console import guarded
from ptae_lite.files import alone

TIMES = "chapter_times.json"
TAIL = 15  # lines shown of a chapter's traceback


def build(out, book=ROOT / "book") -> dict | None:
    """Build into `out`/html; the chapters' seconds and tracebacks, or None without an end.

    Raises:
        FileError: another run builds into the same folder.
    """
    out = Path(out)
    with alone(out / "html"):
        work, done = out / "html.part", out / "html"
        (out / TIMES).unlink(missing_ok=True)  # nothing of an earlier run may be taken for this one
        shutil.rmtree(work, ignore_errors=True)
        # A fresh environment makes Sphinx read, and so execute, every chapter; two at a time.
        command = [
            sys.executable,
            "-m",
            "sphinx",
            "-b",
            "html",
            "-W",
            "--keep-going",
            "-E",
            "-j",
            "2",
        ]
        folders = ["-d", work / "doctrees", book, work / "html"]
        status = subprocess.call([str(part) for part in (*command, *folders)])
        if not (work / TIMES).exists():
            return None
        times = json.loads((work / TIMES).read_text(encoding="utf-8"))
        if done.exists():
            done.rename(work / "before")
        (work / "html").rename(done)
        (work / TIMES).replace(out / TIMES)
        shutil.rmtree(work)
    return {"chapters": times, "status": status}


def chapter_lines(times: dict) -> list[str]:
    """One line per chapter: its seconds, and for a failed one the end of its traceback."""
    lines = []
    width = max(map(len, times), default=0)
    for name in sorted(times):
        chapter = times[name]
        state = "FAILED after" if chapter["traceback"] else "ran in"
        lines.append(f"{name:<{width}}  {state} {chapter['seconds'] or 0:.1f} s")
        tail = (chapter["traceback"] or "").strip().splitlines()[-TAIL:]
        lines.extend("    " + line for line in tail)
    return lines


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split(":")[0])
    parser.add_argument("--out", default="build", help="folder that gets html/")
    parser.add_argument("--book", default=str(ROOT / "book"), help="folder of the chapters")
    options = parser.parse_args(arguments)

    def work() -> int:
        built = build(options.out, options.book)
        if built is None:
            print("The book was not built; the messages above say why.")
            return 1
        print("\n".join(["", *chapter_lines(built["chapters"])]))
        print(f"Open {Path(options.out, 'html', 'index.html')}")
        if built["status"]:
            print("The book has faults; the messages above say which.")
        return 1 if built["status"] else 0

    return guarded("book", work)


if __name__ == "__main__":
    sys.exit(main())

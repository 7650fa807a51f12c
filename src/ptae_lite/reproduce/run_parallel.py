"""Run commands side by side: `python -m ptae_lite.reproduce.run_parallel MODULE ... + MODULE ...`.

A study often ends with one long training. The next study then uses the other cores.
"""

from __future__ import annotations

import subprocess
import sys
from itertools import groupby

from ptae_lite import progress


def commands(words: list[str]) -> list[list[str]]:
    """The words of each command."""
    return [list(group) for between, group in groupby(words, "+".__eq__) if not between]


def main(arguments: list[str]) -> int:
    """Run each command to its end; returns 0 if none failed."""
    asked = commands(arguments)
    running = [
        subprocess.Popen([sys.executable, "-m", *words], env=env)
        for words, env in zip(asked, progress.environments(len(asked)), strict=True)
    ]
    try:
        return int(any([process.wait() for process in running]))  # a list: all are waited for
    finally:
        for process in running:
            process.terminate()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

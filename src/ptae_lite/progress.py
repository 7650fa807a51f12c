"""How far a command is, as it tells the full re-run that started it: one number in a file.

The variable `FILE` names that file. Standard library only, so that it costs no time.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

FILE = "PTAE_PROGRESS"


def tell(share: float) -> None:
    """Write how far this command is, from 0 to 1, if a re-run wants to know."""
    path = os.environ.get(FILE)
    if path:
        new = Path(f"{path}.new")  # put in place whole: a reader would miss an empty file
        with suppress(OSError):  # the re-run may be gone
            new.write_text(str(share))
            new.replace(path)


def environments(count: int) -> list[dict]:
    """The environments of `count` commands side by side. Each has a file of its own, at 0."""
    path, found = os.environ.get(FILE), []
    for number in range(count):
        own = {FILE: f"{path}.{number}"} if path else {}
        for name in own.values():
            Path(name).write_text("0")
        found.append(os.environ | own)
    return found


def share_in(folder) -> float | None:
    """How far the slowest command is that writes to a folder, from 0 to 1; None if none does."""
    shares = []
    for path in Path(folder).iterdir():
        with suppress(ValueError, OSError):  # one that is being written
            shares.append(float(path.read_text()))
    return min(shares, default=None)

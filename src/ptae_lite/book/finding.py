"""What the doctor's parts share: a finding, the project's folder, and the name of its Python.

Standard library only, like all parts of the doctor.
"""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[3]
GOOD, WARNING, PROBLEM = "good", "warning", "PROBLEM"


class Finding(NamedTuple):
    """One line of the doctor.

    Args:
        what: what was checked.
        state: `GOOD`, `WARNING` or `PROBLEM`.
        says: an explanation.
        mend: a command that mends it, if there is one.
    """

    what: str
    state: str
    says: str
    mend: str = ""


def python() -> str:
    """This Python, as a reader in the project's folder would type it."""
    path = Path(sys.executable)
    text = str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)
    return f'"{text}"' if " " in text else text


def starter() -> str:
    """How a reader starts `run.py` on this system."""
    return "py run.py" if os.name == "nt" else "python3 run.py"


def installed(package: str) -> str | None:
    """The installed version of a package; None if it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None

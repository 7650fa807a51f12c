"""What the doctor's parts share: a finding, and the project and the Python that they speak of.

Standard library only, as all of the doctor.
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
    """One line: what was looked at, how it is, and the command that mends it."""

    what: str
    state: str
    says: str
    mend: str = ""


def python() -> str:
    """The Python that runs this, as a reader in the project's folder would type it."""
    path = Path(sys.executable)
    text = str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)
    return f'"{text}"' if " " in text else text


def starter() -> str:
    return "py run.py" if os.name == "nt" else "python3 run.py"


def installed(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None

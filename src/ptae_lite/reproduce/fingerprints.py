"""Hashes that tell which version of the project made something."""

from __future__ import annotations

import hashlib
import platform
from importlib import metadata
from pathlib import Path

from ptae_lite.artefacts import ROOT
from ptae_lite.book.chapters import notebook_files

SOURCE = Path(__file__).resolve().parents[1]
ASIDE = (
    "plots",
    "widgets",
    "book",
    "reproduce",
)  # they show and compare; no result depends on them
PACKAGES = (
    "torch",
    "numpy",
    "pandas",
    "pybullet",
    "pybullet-arm64",
    "ipywidgets",
    "jupyterlab",
    "sphinx",
)


def of_files(paths, below: Path) -> str:
    """One hash of the names and contents of text files. Line ends do not matter."""
    digest = hashlib.sha256()
    for path in sorted(paths):
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(below).as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def library() -> str:
    """Hash of the modules on which results depend."""
    paths = SOURCE.rglob("*.py")
    return of_files([p for p in paths if p.relative_to(SOURCE).parts[0] not in ASIDE], SOURCE)


def chapters(book: Path = ROOT / "book") -> dict[str, str]:
    """Hash of the source of each chapter and each page in depth."""
    return {
        path.relative_to(book).with_suffix("").as_posix(): of_files([path], book)
        for path in notebook_files(book)
    }


def environment(root: Path = ROOT) -> str:
    """Hash of `environment.txt`."""
    return of_files([root / "environment.txt"], root)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages on which numbers can depend."""
    found = {"python": platform.python_version(), "system": platform.system(),
             "machine": platform.machine()}  # fmt: skip
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found

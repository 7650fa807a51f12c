"""Make the `.venv/` of this project use its own library: `python installation.py [--from FOLDER]`.

The environment's Python runs this before anything else works, so it uses the standard library only.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
LINK = "00_ptae_lite.pth"  # its name sorts before that of an editable installation
LONGEST = 127  # bytes of a script's first line that every system reads


def link(packages: Path, root: Path = ROOT) -> None:
    """Let Python find the library by a relative path, which stays right if the folder is moved or
    copied.

    Args:
        packages: the environment's folder of packages.
    """
    path = os.path.relpath(root / "src", packages)
    (packages / LINK).write_text(path + "\n", encoding="ascii")


def settle(programs: Path, before: Path, root: Path = ROOT) -> None:
    """After the project was moved or copied: no program may start the Python of the old place.

    Args:
        programs: the environment's folder of programs.
        before: the old place of the project.
    """
    old, new = (os.fsencode(folder / ".venv") for folder in (before, root))
    for path in programs.iterdir():
        content = path.read_bytes() if path.is_file() and not path.is_symlink() else b""
        if old not in content:
            continue
        if b"\0" in content:  # a launcher of Windows; what we start is `python -m ...`
            path.unlink()
        else:
            path.write_bytes(startable(moved(content, old, new)))


def moved(script: bytes, old: bytes, new: bytes) -> bytes:
    """A script with the path `new` instead of `old`, quoted where a shell needs quotes."""
    word = new if os.name == "nt" else os.fsencode(shlex.quote(os.fsdecode(new)))
    path = re.escape(old)
    pattern = rb"((?<=[= ])" + path + rb"(?=[)\s]))|" + path
    return re.sub(pattern, lambda found: word if found[1] else new, script)


def startable(script: bytes) -> bytes:
    """A script that every system can start.

    If its first line is too long or has a space, a shell starts it.
    """
    first, newline, rest = script.partition(b"\n")
    if not first.startswith(b"#!") or (b" " not in first and len(first) <= LONGEST):
        return script
    if first.startswith((b"#!/bin/sh", b"#!/usr/bin/env ")):
        return script
    # Two lines replace the first. Python reads them as a string.
    shell = b"#!/bin/sh\n'''exec' \"" + first[2:].strip() + b'" "$0" "$@"\n\' \'\'\''
    return shell + newline + rest


def main(arguments=None) -> int:
    """Mend the environment; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split(":")[0])
    parser.add_argument("--from", dest="before", metavar="FOLDER", help="where it was made")
    options = parser.parse_args(arguments)
    try:
        link(Path(sysconfig.get_path("purelib")))
        if options.before:
            settle(Path(sysconfig.get_path("scripts")), Path(options.before))
    except OSError as error:  # such as a read-only folder; the doctor then still reports it
        print(f".venv/ cannot be changed ({error}).", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

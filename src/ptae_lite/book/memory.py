"""How much memory a process may use here, and what limits it. Standard library only."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def limits(root: Path = Path("/")) -> dict[str, int]:
    """The limits of this process's memory in bytes, by what sets them; empty if unknown.

    Args:
        root: where `/proc` and `/sys` are.
    """
    found = {}
    with suppress(AttributeError, ValueError, OSError):  # Windows
        found["the machine"] = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    group = min(_control_groups(root), default=None)
    if group is not None:
        found["its control group (a container or a hub)"] = group
    return found


def _control_groups(root: Path) -> list[int]:
    """The limits of this process's control groups (versions 1 and 2) and of their parents."""
    try:
        lines = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if controllers == "":  # version 2
            top, name = root / "sys/fs/cgroup", "memory.max"
        elif "memory" in controllers.split(","):  # version 1
            top, name = root / "sys/fs/cgroup/memory", "memory.limit_in_bytes"
        else:
            continue
        inner = top / group.strip("/")  # inside a container the path may be that of outside
        folders = [inner, *inner.parents]
        for folder in folders[: folders.index(top) + 1]:
            try:
                text = (folder / name).read_text(encoding="ascii").strip()
            except OSError:
                continue
            if text.isdigit():  # and not "max"
                found.append(int(text))
    return found


def address_space() -> int | None:
    """The limit of `ulimit -v` in bytes; None if there is none."""
    try:
        import resource
    except ImportError:
        return None  # Windows
    soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if soft == resource.RLIM_INFINITY else soft

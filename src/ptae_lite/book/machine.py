"""What the doctor says of the machine: disk, memory, cores, browser, and variables.

Standard library only, like all parts of the doctor.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from ptae_lite.book import memory
from ptae_lite.book.finding import GOOD, PROBLEM, ROOT, WARNING, Finding, installed, python

FREE_GB, INSTALL_GB = 2, 6  # a full re-run leaves some 0.5 GB; the install needs more
CHAPTER_GB, LAB_GB = 0.75, 0.2  # measured: the kernel of a chapter at most, and JupyterLab
MEMORY_GB = 2  # two chapters side by side, as the book is built; training a CAE takes 1.4
ADDRESSES_GB = 3  # a chapter maps large libraries into its address space and reads little of them
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
# Variables that run.py removes for everything it starts (its FOREIGN, without VIRTUAL_ENV).
FOREIGN = (
    "PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "PYTHONOPTIMIZE", "PYTHONWARNINGS",
    "PYTEST_ADDOPTS", "PYTEST_PLUGINS", "PYTEST_DISABLE_PLUGIN_AUTOLOAD", "JUPYTER_PATH",
)  # fmt: skip


def check_disk(free_bytes: int | None = None, root: Path = ROOT) -> Finding:
    """Whether there is room for the installation and for runs."""
    free = (shutil.disk_usage(root).free if free_bytes is None else free_bytes) / 1e9
    there = (root / ".venv").exists() or installed("torch")  # on a hub, without .venv/
    needed = FREE_GB if there else INSTALL_GB
    if free < needed:
        says = f"{free:.1f} GB are free, {needed} are needed; your runs lie in {root / 'build'}"
        return Finding("disk", PROBLEM, says, f"{python()} -m pip cache purge")
    return Finding("disk", GOOD, f"{free:.1f} GB are free")


def check_memory(limits: dict[str, int] | None = None, addresses: int | None = None) -> Finding:
    """Compares the smallest limit of the memory with what the chapters were measured to use."""
    if limits is None:
        limits, addresses = memory.limits(), memory.address_space()
    needs = f"a chapter takes up to {CHAPTER_GB} GB, JupyterLab {LAB_GB}"
    if addresses is not None and addresses < ADDRESSES_GB * 1e9:
        says = f"ulimit -v leaves {addresses / 1e9:.1f} GB of addresses, a chapter needs "
        return Finding("memory", PROBLEM, says + f"{ADDRESSES_GB}", "ulimit -v unlimited")
    if not limits:
        return Finding("memory", GOOD, f"not asked on this system; {needs}")
    by = min(limits, key=limits.get)
    whole = limits[by] / 1e9
    says = f"{whole:.1f} GB, by {by}"
    if whole < CHAPTER_GB + LAB_GB:
        return Finding("memory", PROBLEM, f"{says}: {needs}, so kernels may be killed")
    if whole < 0.9 * MEMORY_GB:
        says += f": {needs}; the book is built two chapters at a time, training a CAE takes 1.4"
        return Finding("memory", WARNING, says)
    return Finding("memory", GOOD, says)


def check_cores(count: int | None = None) -> Finding:
    """Whether there is more than one core."""
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    count = count or len(usable(0))
    says = f"{count}; everything runs on one, a full re-run is planned for two"
    return Finding("cores", GOOD if count > 1 else WARNING, says)


def check_chromium(find=shutil.which) -> Finding:
    """Whether there is a browser for the tests of the pages."""
    path = next(filter(None, map(find, BROWSERS)), None)
    if path:
        return Finding("Chromium", GOOD, path)
    mend = "sudo apt install chromium" if sys.platform == "linux" else ""
    says = "is not installed: the tests skip what they would look at in a browser"
    return Finding("Chromium", WARNING, says, mend)


def check_variables(environ=os.environ) -> list[Finding]:
    """Variables of other projects that change what Python does when it is started by hand."""
    named = [name for name in FOREIGN if name in environ]
    active = environ.get("VIRTUAL_ENV")
    if active and Path(active).resolve() != (ROOT / ".venv").resolve():
        named.append("VIRTUAL_ENV")
    says = "run.py starts everything without it; what is started by hand obeys it"
    unset = "set {}=" if os.name == "nt" else "unset {}"
    return [
        Finding("variable", WARNING, f"{name}={environ[name]}: {says}", unset.format(name))
        for name in named
    ]


def examine() -> list[Finding]:
    """All findings on the machine."""
    looks = [check_disk(), check_memory(), check_cores(), check_chromium()]
    return [*looks, *check_variables()]

"""Run the unit tests and every notebook: `python3 run.py test`."""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from xml.etree import ElementTree

from ptae_lite.book.chapters import IN_DEPTH
from ptae_lite.book.finding import ROOT, starter
from ptae_lite.pipes import piped
from ptae_lite.run_mode import TIERS

EXTRAS = ("bert", "cluster", "course")  # extras of pyproject.toml that some tests need
EXTRAS_STAMP = Path(".venv", "extras.sha256")
NOT_QUICK = ("browser", "stops", "slow", "extras")  # markers of tests that only --all runs
WORKERS = 8  # at most: each takes 0.7 GB, and more save no time beside the longest file


def call(module: str, *arguments, log: str | None = None) -> int:
    """Run a module in the repository and wait for it; returns its exit code.

    The module handles Ctrl-C itself.

    Args:
        log: write its error stream to build/logs/LOG.log.
    """
    command = [sys.executable, "-m", module, *map(str, arguments)]
    if log:
        path = ROOT / "build" / "logs" / f"{log}.log"
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            process = subprocess.Popen(command, cwd=ROOT, stderr=file)
    else:
        process = subprocess.Popen(command, cwd=ROOT)
    while True:
        try:
            return process.wait()
        except KeyboardInterrupt:
            continue  # pytest and Sphinx end by themselves


def build_book() -> int:
    """Build the site; returns the exit code."""
    return call("ptae_lite.book.site")


def ensure_extras(root: Path = ROOT) -> None:
    """Install the packages of the extras into .venv/. The pins of environment.txt stay."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [one for extra in EXTRAS for one in project["optional-dependencies"][extra]]
    pinned = (root / "environment.txt").read_text(encoding="utf-8")
    stamp = hashlib.sha256("\n".join([*wanted, pinned]).encode()).hexdigest()
    done = root / EXTRAS_STAMP
    if done.exists() and done.read_text(encoding="utf-8") == stamp:
        return
    print(
        f"Installing {', '.join(wanted)} into .venv/, for the tests of the extras ...", flush=True
    )
    install = ["install", "--quiet", "--disable-pip-version-check", "-c", "environment.txt"]
    if call("pip", *install, *wanted, log="extras"):
        print("They could not be installed (build/logs/extras.log); their tests are skipped.")
        return
    done.write_text(stamp, encoding="utf-8")


def cores() -> int:
    """How many cores this process may use."""
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    return len(usable(0))


def phases(everything: bool) -> dict[str, list[str]]:
    """The arguments of pytest for each group of tests, in order."""
    # One worker takes a whole file: its tests share costly things, and its cells share a kernel.
    together, names = ["--dist", "loadfile"], [f"not {name}" for name in NOT_QUICK]
    nbval = ["--nbval-lax", "--nbval-cell-timeout=300"]
    if not everything:
        nbval.append(f"--ignore=book/{IN_DEPTH}")
    found = {"unit tests": ["-m", "not browser" if everything else " and ".join(names), *together]}
    if everything:  # each page goes to the next free worker
        found["pages in a browser"] = ["-m", "browser", "--dist", "worksteal"]
    return found | {"cells of notebooks": [*nbval, *together, "book"]}


def counts(junit: Path) -> str:
    """How many tests failed, passed or were skipped; empty if pytest did not end."""
    if not junit.exists():
        return ""
    suite = next(ElementTree.parse(junit).iter("testsuite")).attrib
    failed, skipped = int(suite["failures"]) + int(suite["errors"]), int(suite["skipped"])
    ran = int(suite["tests"]) - skipped
    parts = {"failed": failed, "passed": ran - failed, "skipped": skipped}
    return ", ".join(f"{count} {what}" for what, count in parts.items() if count)


def run_phase(name: str, options: list[str]) -> tuple[int, str]:
    """Run a group of tests; returns pytest's exit code, and the counts or the name of the log."""
    file = name.split()[0]
    junit = ROOT / "build" / f"junit-{file}.xml"
    junit.unlink(missing_ok=True)  # of an earlier run
    print(f"\n{name.capitalize()} ...", flush=True)
    pytest = ["-rs", "-q", "--no-header", "--tb=short", "-n", min(cores(), WORKERS)]
    # Messages of kernels and workers on the error stream are of no use to a reader.
    status = call("pytest", *pytest, f"--junitxml={junit}", *options, log=file)
    return status, counts(junit) or f"see build/logs/{file}.log"


def run_phases(everything: bool) -> int:
    """Run all groups of tests; returns 0 if all passed.

    Args:
        everything: also the tests that `--all` adds.
    """
    start, results = time.monotonic(), {}
    if everything:
        ensure_extras()
        results["book"] = (build_book(), "")  # first: the browser looks at what it built
    for name, options in phases(everything).items():
        results[name] = run_phase(name, options)
    failed = any(status for status, _ in results.values())
    print(f"\n{'FAILED' if failed else 'Passed'} in {(time.monotonic() - start) / 60:.1f} min: "
          + "; ".join(f"{name} {'FAILED ' * bool(status)}{said}".strip()
                      for name, (status, said) in results.items())
          + ("." if everything else f". Left out: tests marked {', '.join(NOT_QUICK)}, and the "
             f"cells of the pages in depth; {starter()} test --all runs them, too."))  # fmt: skip
    return 1 if failed else 0


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py test`."""
    made = argparse.ArgumentParser(
        prog="run.py test", description=__doc__.split(":")[0] + ".",
        usage="run.py test [-h] [--tier TIER] [--all]\n       run.py test [--tier TIER] -- ARGS",
        epilog="ARGS go to pytest, which then runs only the tests that they name.",
    )  # fmt: skip
    made.add_argument("--tier", choices=TIERS, help="stored results, short or full runs")
    made.add_argument("--all", action="store_true", help="browser, kills, extras, all else")
    return made


def main(arguments=None) -> int:
    """Run the tests; returns 0 if all passed."""
    own = sys.argv[1:] if arguments is None else list(arguments)
    extra = []
    if "--" in own:
        at = own.index("--")
        own, extra = own[:at], own[at + 1 :]
    known = parser()
    options = known.parse_args(own)
    if extra and options.all:
        known.error("either --all or arguments after --")
    if options.tier:
        os.environ["PTAE_TIER"] = options.tier
    if extra:
        return 1 if call("pytest", "-rs", "--junitxml=build/junit.xml", *extra) else 0
    return run_phases(options.all)


if __name__ == "__main__":
    sys.exit(piped(main))

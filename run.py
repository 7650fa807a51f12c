#!/usr/bin/env python3
"""Make the environment in .venv/, then do one job of the book.

    python3 run.py book               run every chapter and build the site into build/html
    python3 run.py test [-- ARGS]     the book, unit tests, every notebook; or pytest with ARGS
    python3 run.py lab [-- ARGS]      open the chapters in JupyterLab (ARGS go to it)
    python3 run.py notebooks [NAME]   write the .ipynb twins of the chapters, with their outputs
    python3 run.py doctor             what is wrong here, and the command that mends it
    python3 run.py certify            run the chapters, and write down what came out
    python3 run.py full [--seeds 1]   make everything anew and compare it with what is stored
    python3 run.py course OUT         write the exercises for students and for instructors

Standard library only, on Linux, macOS and Windows: this file runs before anything is installed.
"""

from __future__ import annotations  # so that an old Python reaches the sentence in check_python

import argparse
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent
STAMP = Path(".venv", "installed.sha256")  # which environment.txt the .venv/ was made from
MINIMUM = (3, 11)
NEEDED_GB = 6  # PyTorch with its CUDA libraries, and as much again while pip unpacks it
TIERS = ("replay", "quick", "full")
FIND_PYBULLET = "import importlib.util as u, sys; sys.exit(u.find_spec('pybullet') is None)"
NO_PYBULLET = (
    "Note: nothing can be recorded or acted out here, because PyBullet has wheels for Python 3.11 "
    "to 3.13 on Linux (x86-64), macOS and Windows only; everything else works."
)


class Stop(Exception):
    """The reader has to do something first; the message is one sentence saying what."""


def say(text: str) -> None:
    if text:
        print(text, flush=True)  # flushed, so that it stands before what a child prints


def check_python(version: tuple, whose: str = "this one") -> None:
    if tuple(version[:2]) < MINIMUM:
        need, have = (".".join(map(str, v[:2])) for v in (MINIMUM, version))
        raise Stop(f"The book needs Python {need} or newer; {whose} is {have}.")


def check_venv_modules(find=importlib.util.find_spec) -> None:
    missing = [name for name in ("venv", "ensurepip") if find(name) is None]
    if missing:
        raise Stop(
            f"This Python cannot make a virtual environment: its module {missing[0]} is missing "
            "(on Debian and Ubuntu: sudo apt install python3-venv)."
        )


def check_disk(free_bytes: int) -> None:
    if free_bytes < NEEDED_GB * 1e9:
        raise Stop(
            f"The first installation needs {NEEDED_GB} GB of free disk space, "
            f"and there are {free_bytes / 1e9:.1f} GB."
        )


def venv_python(root: Path = ROOT, windows: bool = os.name == "nt") -> Path:
    return root / ".venv" / ("Scripts/python.exe" if windows else "bin/python")


def venv_version(root: Path = ROOT) -> tuple:
    """The version an existing .venv was made with, which need not be ours."""
    text = (root / ".venv" / "pyvenv.cfg").read_text(encoding="utf-8")
    found = re.search(r"^version(?:_info)?\s*=\s*(\d+)\.(\d+)", text, re.MULTILINE)
    return tuple(map(int, found.groups())) if found else tuple(sys.version_info[:2])


def fingerprint(root: Path = ROOT) -> str:
    """Changes when an installation would: it covers the two files that decide one."""
    digest = hashlib.sha256()
    for name in ("environment.txt", "pyproject.toml"):
        digest.update((root / name).read_bytes())
    return digest.hexdigest()


def is_installed(root: Path = ROOT) -> bool:
    stamp = root / STAMP
    return stamp.exists() and stamp.read_text(encoding="utf-8") == fingerprint(root)


def install_commands(python: Path, uv: str | None) -> list:
    installer = [str(python), "-m", "pip", "install", "--disable-pip-version-check"]
    if uv:
        installer = [uv, "pip", "install", "--python", str(python)]
    # The package itself comes without dependencies: environment.txt has pinned them all.
    return [
        [*installer, "--quiet", "-r", "environment.txt"],
        [*installer, "--quiet", "--no-deps", "-e", "."],
    ]


def child_environment(environ: dict, tier: str | None = None) -> dict:
    """The environment of everything started here: one thread per process, no random hashes."""
    child = dict(environ)
    child["PTAE_TIER"] = tier or environ.get("PTAE_TIER") or TIERS[0]
    child["OMP_NUM_THREADS"] = "1"  # two kernels at once would otherwise fight for the cores
    child["PYTHONHASHSEED"] = "0"
    child["PYTHONUTF8"] = "1"  # texts are UTF-8, also where the system's locale is not
    child["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # silences a warning of the debugger
    if "PIP_FIND_LINKS" in environ:
        child.setdefault("UV_FIND_LINKS", environ["PIP_FIND_LINKS"])  # uv does not read pip's
    return child


def call(command: list, env: dict) -> int:
    """Run a command in the repository and wait for it; Ctrl-C is the child's to answer."""
    process = subprocess.Popen([str(part) for part in command], cwd=ROOT, env=env)
    while True:
        try:
            return process.wait()
        except KeyboardInterrupt:
            continue  # JupyterLab asks whether to stop; pytest and Sphinx end by themselves


def ensure_environment(env: dict, root: Path = ROOT) -> Path:
    """Make .venv/ if there is none, install if the pinned files changed; its Python."""
    python = venv_python(root)
    if not python.exists():
        check_venv_modules()
        check_disk(shutil.disk_usage(root).free)
        say("Making the virtual environment .venv/ ...")
        if call([sys.executable, "-m", "venv", root / ".venv"], env):
            shutil.rmtree(root / ".venv", ignore_errors=True)  # half of one would be taken for one
            raise Stop("The virtual environment could not be made; the messages above say why.")
    version = venv_version(root)
    check_python(version, "the one in .venv/ (delete that folder to have it made anew)")
    if is_installed(root):
        return python
    uv = shutil.which("uv")
    say(f"Installing environment.txt with {'uv' if uv else 'pip'} (minutes, the first time) ...")
    start = time.monotonic()
    (root / STAMP).unlink(missing_ok=True)  # until the end, nothing is known to be installed
    for command in install_commands(python, uv):
        if call(command, env):
            raise Stop(
                "The packages could not be installed; the messages above say why, the job "
                "`doctor` whether they can be here, and the same command tries again."
            )
    (root / STAMP).write_text(fingerprint(root), encoding="utf-8")
    say(f"Installed in {time.monotonic() - start:.0f} s.")
    if call([python, "-c", FIND_PYBULLET], env):
        say(NO_PYBULLET)
    return python


def book(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Run every chapter and build the site into build/html."""
    say(f"Running every chapter (tier {env['PTAE_TIER']}) and building the site ...")
    return 1 if call([python, "-m", "ptae_lite.book.site"], env) else 0


def test(python: Path, env: dict, args: argparse.Namespace) -> int:
    """The book, unit tests and pages in a browser, every notebook; with ARGS those tests alone."""
    pytest = [python, "-m", "pytest", "--durations=10", "-rs"]  # with the reason of each skip
    units = [*pytest, "--junitxml=build/junit-unit.xml", *args.extra]
    if args.extra:
        return 1 if call(units, env) else 0
    results = {"book": book(python, env, args)}  # first: the browser looks at what it built
    results["unit tests"] = call(units, env)
    # loadfile: the cells of one notebook share a kernel, so they must stay with one worker.
    nbval = ["--nbval-lax", "--nbval-cell-timeout=300", "-n", "2", "--dist", "loadfile"]
    notebooks = [*pytest, *nbval, "--junitxml=build/junit-notebooks.xml", "book"]
    results["notebooks"] = call(notebooks, env)
    for name, status in results.items():
        say(f"{name}: {'passed' if status == 0 else 'FAILED'}")
    return 1 if any(results.values()) else 0


def lab(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Open the chapters in JupyterLab, reachable from this machine only."""
    command = [python, "-m", "jupyter", "lab", "--ip=127.0.0.1", "--ServerApp.root_dir=book"]
    return call([*command, *args.extra], env)


def notebooks(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Write the .ipynb twins of the chapters, with their outputs."""
    return call([python, "-m", "ptae_lite.book.notebooks", *args.names], env)


def doctor(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Say what is wrong here, and the command that mends each thing."""
    return call([python, Path("src", "ptae_lite", "book", "doctor.py")], env)


def full(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Make everything anew, from the recording to the book, and compare it with data/."""
    out = Path(args.out).absolute()
    options = ["--seeds", args.seeds, "--out", out, "--device", args.device]
    return call(
        [python, "-m", "ptae_lite.reproduce.pipeline", *options, *["--plan"] * args.plan], env
    )


def certify(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Run the chapters and write what came out into one small file; or --check such a FILE."""
    command = [python, "-m", "ptae_lite.reproduce.certificate"]
    if args.check:
        return call([*command, "--check", Path(args.check).absolute()], env)
    env["PTAE_TIER"] = "replay"
    (ROOT / "build/chapter_times.json").unlink(missing_ok=True)  # of an earlier run
    book(python, env, args)  # what fails in it stands in the certificate
    out = Path(args.out).absolute()  # from where the reader is, as OUT of a course
    return call([*command, "--out", out, "--name", args.name], env)


def course(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Write the exercises into a new folder OUT: one part for students, one for instructors."""
    # The job runs in the repository; OUT is meant from where the reader is.
    options = [Path(args.out).absolute(), "--seed", args.seed]
    return call([python, "-m", "ptae_lite.book.course", *options], env)


JOBS = (book, test, lab, notebooks, doctor, certify, full, course)


def parse(argv: list) -> argparse.Namespace:
    own, extra = argv, []
    if "--" in argv:
        own, extra = argv[: argv.index("--")], argv[argv.index("--") + 1 :]
    parser = argparse.ArgumentParser(prog="run.py", description=__doc__.split("\n\n")[0])
    jobs = parser.add_subparsers(dest="job", required=True, metavar="JOB")
    for job in JOBS:
        sub = jobs.add_parser(job.__name__, help=job.__doc__)
        sub.set_defaults(run=job, tier=None)
        if job in (book, test):
            sub.add_argument("--tier", choices=TIERS, help="stored results, short or full runs")
        if job is notebooks:
            sub.add_argument("names", nargs="*", metavar="NAME", help="such as 01_simulation")
        if job is certify:
            sub.add_argument("--name", default="", help="who hands it in; decides what is asked")
            sub.add_argument("--out", default=ROOT / "build/certificate.json", help="file to write")
            sub.add_argument("--check", metavar="FILE", help="check a certificate, in seconds")
        if job is full:
            sub.add_argument("--seeds", type=int, default=3, help="trainings of each kind")
            sub.add_argument(
                "--out", default=ROOT / "build/full", help="folder, new or to go on with"
            )
            sub.add_argument("--device", default="auto", help="of the CAEs: cpu, cuda, or auto")
            sub.add_argument("--plan", action="store_true", help="only show what would be done")
        if job is course:
            sub.add_argument("out", metavar="OUT", help="a new folder")
            sub.add_argument("--seed", type=int, default=0, help="other numbers in the exercises")
    args = parser.parse_args(own)
    if extra and args.run not in (test, lab):
        parser.error(f"{args.job} takes no arguments after --")
    args.extra = extra
    return args


def main(argv: list) -> int:
    try:
        check_python(sys.version_info)
        args = parse(argv)
        env = child_environment(os.environ, args.tier)
        if args.run is doctor:  # installs nothing: it says what there is
            python = venv_python() if venv_python().exists() else Path(sys.executable)
        else:
            python = ensure_environment(env)
        return args.run(python, env, args)
    except Stop as stop:
        print(stop, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

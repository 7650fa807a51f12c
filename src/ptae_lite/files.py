"""Safe writing: a file is written whole or not at all, and one run at a time works in a folder."""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from filelock import FileLock, Timeout

from ptae_lite.errors import FileError

PART = ".part"  # a file is first written to NAME.PROCESS.part, beside its final place


def as_called(path) -> Path:
    """A path that a reader gave, relative to the folder in which `run.py` was called, if it was."""
    return Path(os.environ.get("PTAE_CALLED_FROM", ""), path).absolute()


@contextmanager
def atomic_write(path):
    """Yield a temporary path beside `path`, and rename it to `path` at the end.

    If writing stops early for any reason, `path` stays as it was.

    Raises:
        FileError: the file cannot be written, for example on a full disk.
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
    """Write arrays into an `.npz` file, whole or not at all.

    Raises:
        FileError: the file cannot be written.
    """
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _temporary(path: Path) -> Path:
    """The temporary name of a file. It has the process number, so two processes never share one."""
    return path.with_name(f"{path.name}.{os.getpid()}{PART}")


def cannot_write(path, error: OSError) -> str:
    """The message for a file that could not be written."""
    return (
        f"{path} cannot be written ({error.strerror or error}); nothing there was changed; "
        "make room, or name another place, and give the same command again"
    )


def check_writable(path) -> None:
    """Check before the work, not after it, that a file can be written.

    Raises:
        FileError: it cannot.
    """
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
        for folder in made:  # a run that is refused later must leave no folders
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def file_lock(path, wait_s: float = 0):
    """Hold the lock of `path`, so that no other run works on it.

    The lock is one of the operating system, on the file `NAME.lock` beside `path`. It ends with the
    process that holds it, even if that process is killed.

    Args:
        wait_s: how many seconds to wait for another run.

    Raises:
        FileError: another run still holds the lock, or the lock cannot be made.
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

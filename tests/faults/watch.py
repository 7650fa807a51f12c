"""What the tests of this folder share: nothing else changed, and jobs that are stopped midway."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[2]
TINY = Path(__file__).with_name("tiny.py")
PATIENCE_S = 240  # for a job of seconds, on a machine with much else to do


def contents(*folders) -> dict:
    """Every file below the folders with the hash of its bytes, and every folder."""
    found = {}
    for folder in map(Path, folders):
        for path in sorted(folder.rglob("*")):
            digest = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "folder"
            found[str(path)] = digest
    return found


@contextmanager
def unchanged(*folders):
    """No byte below the folders is another one afterwards, and nothing is new or gone."""
    before = contents(*folders)
    yield
    assert contents(*folders) == before


def environment(**more) -> dict:
    path = f"{ROOT / 'src'}{os.pathsep}{TINY.parent}"
    return os.environ | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"} | more


def start(*job, **more) -> subprocess.Popen:
    """A tiny job as a process group of its own, as a shell starts one."""
    return subprocess.Popen(
        [sys.executable, str(TINY), *map(str, job)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        env=environment(**more), preexec_fn=heed_ctrl_c if os.name == "posix" else None,
    )  # fmt: skip


def heed_ctrl_c() -> None:
    """A shell that runs the tests in its background has them, and what they start, ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def finish(process) -> tuple[int, str]:
    """Wait for a job; its exit code and all that it said on the error stream."""
    _, said = process.communicate(timeout=PATIENCE_S)
    return process.returncode, said.decode("utf-8", "replace")


def run(*job, **more) -> tuple[int, str]:
    return finish(start(*job, **more))


def until(process, there) -> None:
    """Wait until `there()` is true: the job has something to lose, and is not at its end."""
    end = time.monotonic() + PATIENCE_S
    while not there():
        assert process.poll() is None, process.stderr.read().decode()
        assert time.monotonic() < end
        time.sleep(0.01)


def until_said(process, times: int, word: bytes = b"begun") -> None:
    while times:
        line = process.stdout.readline()
        assert line, process.stderr.read().decode()
        times -= line.strip() == word


def sockets_of(process) -> set[str]:
    """The addresses of every internet socket of a job and of what it has started."""
    own = psutil.Process(process.pid)
    tree = [own, *own.children(recursive=True)]
    assert len(tree) > 2  # it has started something
    sockets = [one.net_connections(kind="inet") for one in tree if one.is_running()]
    return {one.laddr.ip for found in sockets for one in found}


def stop(process, how: signal.Signals) -> tuple[int, str]:
    """Ctrl-C (SIGINT) or kill -9 (SIGKILL) for the job with all that it has started."""
    os.killpg(process.pid, how)
    return finish(process)


def ended_by_ctrl_c(result: tuple[int, str], name: str) -> bool:
    """One sentence, the exit code of an interrupted command, and no traceback."""
    code, said = result
    assert "Traceback" not in said, said
    return code == 130 and f"{name}: stopped; what was finished is kept" in said

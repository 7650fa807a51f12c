"""What the commands share: options, error messages, and checks before the work."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from pathlib import Path

from tqdm import tqdm

from ptae_lite import artefacts, progress
from ptae_lite.errors import PTAEError
from ptae_lite.files import cannot_write

INTERRUPTED = 130  # exit code of a command that Ctrl-C ended
RECORDING = "build/recording"


class Bar(tqdm):
    """A progress bar. It also tells a full re-run how far it is."""

    def display(self, *args, **options):
        """Show it."""
        if self.total:
            progress.tell(self.n / self.total)
        return super().display(*args, **options)


def bar(items, **options):
    """A progress bar on the error stream."""
    return Bar(items, file=sys.stderr, dynamic_ncols=True, **options)


def data_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose the samples a command works on."""
    parser.add_argument(
        "--data", default="recording",
        help="'recording' for the stored features, a recording's folder, or the authors' data "
             "folder",
    )  # fmt: skip
    parser.add_argument(
        "--holdout", type=int, metavar="N",
        help="patterns kept aside from an authors' folder without its test part",
    )  # fmt: skip


def caution(samples) -> dict:
    """What to print beside scores on patterns that only replace the test set."""
    if samples.holdout is None:
        return {}
    return {"test_part": f"{samples.holdout} held-out training patterns, not the paper's test set"}


def guarded(name: str, work: Callable[[], int | None]) -> int:
    """Run a command and return its exit code. An error becomes one sentence on the error stream."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a character unknown to the locale must not end it
            stream.reconfigure(errors="backslashreplace")
    try:
        return work() or 0
    except PTAEError as error:
        sentence = str(error)
    except BrokenPipeError:  # the output is closed: see `piped`
        raise
    except OSError as error:  # such as a full disk in the middle of a table
        sentence = cannot_write(error.filename or "a file", error)
    except BrokenExecutor:
        sentence = (
            "a worker process was killed, perhaps because memory ran out; what was finished is "
            "kept, and the same command goes on from there (--workers 1 needs least memory)"
        )
    except KeyboardInterrupt:
        print(f"{name}: stopped; what was finished is kept", file=sys.stderr)
        return INTERRUPTED
    print(f"{name}: {sentence}", file=sys.stderr)
    return 1


def refuse_data(path, instead: str) -> None:
    """Refuse to write into the data that the book is built on.

    Raises:
        PTAEError: `path` is inside `data/`.
    """
    if Path(path).resolve().is_relative_to(artefacts.data_folder().resolve()):
        raise PTAEError(f"{path}: data/ holds what the book is built on; write into {instead}/")


def whole_number(least: int):
    """An `argparse` type: a whole number that is at least `least`."""

    def number(text: str) -> int:
        if not text.strip().lstrip("+-").isdigit() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {least} up")
        return int(text)

    return number

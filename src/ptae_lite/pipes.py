"""A command ends without a traceback if its output is closed, as in `... | head -3`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

READER_GONE = 141  # a shell's exit code of a program that was ended by a closed pipe


def piped(main: Callable[[], int]) -> int:
    """Run `main` and return its exit code, or `READER_GONE` if its output was closed."""
    try:
        try:
            return main()
        finally:
            sys.stdout.flush()  # here, where the error can still be caught
    except BrokenPipeError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nowhere, stream.fileno())  # Python flushes once more when it ends
        return READER_GONE

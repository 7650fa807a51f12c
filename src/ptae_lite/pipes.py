"""Commands end without a traceback where nobody reads on, as in `... | head -3`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

READER_GONE = 141  # the status of a program that its closed pipe ended, as shells count


def piped(main: Callable[[], int]) -> int:
    """Run `main`; its exit code, or `READER_GONE` where its output found no reader."""
    try:
        try:
            return main()
        finally:
            sys.stdout.flush()  # here, and not after the last moment to catch anything
    except BrokenPipeError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nowhere, stream.fileno())  # Python flushes once more when it ends
        return READER_GONE

"""For `pytest --nbval book`: the chapters' notebooks alone, with their widgets."""

import os
from pathlib import Path

from ptae_lite.book import chapters

BOOK = Path(__file__).parent
os.environ["PTAE_STATIC"] = "0"  # no panel draws all its pictures, as for a page without a kernel
collect_ignore = [name for name in chapters.left_out(BOOK) if name.endswith(".ipynb")]


def pytest_terminal_summary(terminalreporter):
    if line := chapters.notice(BOOK):
        terminalreporter.write_line(line)

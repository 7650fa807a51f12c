"""One line of progress for long work, in a notebook and on a page.

Progress bars made of widgets are missing on a page without a kernel, and bars of text leave a line
for each step. This one is a single output that is updated. A page keeps its last state.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sized
from html import escape
from typing import TypeVar

from IPython.display import HTML, display

Item = TypeVar("Item")
EVERY_S = 0.2  # between two updates


def line(items: Iterable[Item], label: str = "training") -> Iterator[Item]:
    """Yield the items, and show a line that says how many are done.

    Use it like `tqdm`: `training.train(samples, progress=progress.line)`. The last line has no
    seconds, so a page that is made again stays the same.
    """
    total = len(items) if isinstance(items, Sized) else 0
    shown = display(_Line(label, 0, total), display_id=True)
    done, last_s = 0, time.monotonic()
    try:
        for item in items:
            yield item
            done += 1
            if time.monotonic() - last_s > EVERY_S:
                last_s = time.monotonic()
                _renew(shown, _Line(label, done, total))
    finally:
        _renew(shown, _Line(label, done, total, ended=True))


def _renew(shown, line) -> None:
    if shown is not None:  # outside IPython there is no page to renew
        shown.update(line)


class _Line(HTML):
    def __init__(self, label: str, done: int, total: int, ended: bool = False):
        count = f"{done} of {total}" if total else f"{done}"
        state = "" if not ended else " done" if done >= total else " - stopped"
        self.text = f"{label}: {count}{state}"
        bar = ""
        if not ended:
            share = f' value="{done}" max="{total}"' if total else ""
            bar = f' <progress{share} aria-label="{escape(label)}"></progress>'
        super().__init__(f"<span>{escape(self.text)}</span>{bar}")

    def __repr__(self) -> str:
        return self.text

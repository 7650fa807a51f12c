"""One line of progress for long work, in a notebook and on a page.

Bars of widgets vanish from a page without a kernel, and bars of text leave a line for each of
their states. This one is a single output that is renewed: what stays in the page is its last state.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sized
from html import escape
from typing import TypeVar

from IPython.display import HTML, display

Item = TypeVar("Item")
EVERY_S = 0.2  # a page need not be renewed more often


def line(items: Iterable[Item], label: str = "training") -> Iterator[Item]:
    """The items, one after the other, with a line that says how many are done.

    Wraps what has a length, as `tqdm` does: `training.train(samples, progress=progress.line)`.
    The final line holds no seconds, so a page that is made again stays the same.
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

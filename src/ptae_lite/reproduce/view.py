"""The progress of a long run: which stage, how far, and about how much time is left."""

from __future__ import annotations

import sys
import time

QUIET_S = 600  # between two lines in a log file, where a line cannot be overwritten


def duration(minutes: float) -> str:
    """Minutes as text, such as `5 min` or `2 h 05 min`."""
    whole = max(round(minutes), 1)
    return f"{whole} min" if whole < 60 else f"{whole // 60} h {whole % 60:02d} min"


class View:
    """Shows the progress of a run, on one line that is overwritten, or in a few lines of a log.

    Args:
        estimates: planned minutes of every stage, in order.
        spent: minutes that earlier stages took, by their number. They show how fast this machine
            is.
    """

    def __init__(
        self, names, estimates, spent: dict[int, float], stream=None, clock=time.monotonic
    ):
        self.names, self.estimates, self.spent = list(names), list(estimates), dict(spent)
        self.stream, self.clock = stream or sys.stderr, clock
        self.at, self.begun, self.shown = 0, clock(), -QUIET_S
        self.share, self.again = 0.0, False

    def begin(self, at: int) -> None:
        """Stage number `at` begins."""
        self.at, self.begun, self.shown = at, self.clock(), -QUIET_S
        self.share, self.again = 0.0, False
        self.show()

    def done(self) -> float:
        """The stage has ended; returns its minutes."""
        self.spent[self.at] = minutes = (self.clock() - self.begun) / 60
        self._write(f"{self._place()} done in {duration(minutes)}", last=True)
        return minutes

    def tick(self, share: float | None) -> None:
        """Set how far the stage is, from 0 to 1; None if nothing new is known.

        If it falls, a further part of the stage has begun. Then no share is one of the whole stage.
        """
        if share is not None:
            self.again = self.again or share < self.share
            self.share = share
        self.show()

    def minutes_left(self) -> float:
        """Minutes left for the whole run, by the plan and by the speed of this machine so far."""
        planned = sum(self.estimates[i] for i in self.spent)
        speed = sum(self.spent.values()) / planned if planned > 2 else 1.0
        gone = (self.clock() - self.begun) / 60
        mine = max(self.estimates[self.at] * speed - gone, 0)
        if self.share > 0.05 and not self.again:  # the stage's own progress is a better estimate
            mine = gone * (1 - self.share) / self.share
        later = range(self.at + 1, len(self.names))
        return mine + speed * sum(self.estimates[i] for i in later if i not in self.spent)

    def show(self) -> None:
        """Write the line."""
        if not self.stream.isatty() and self.clock() - self.shown < QUIET_S:
            return
        self.shown = self.clock()
        share = f" {self.share:.0%}" if self.share and not self.again else ""
        self._write(f"{self._place()}{share}, about {duration(self.minutes_left())} left in all")

    def _place(self) -> str:
        return f"[{self.at + 1}/{len(self.names)}] {self.names[self.at]}"

    def _write(self, text: str, last: bool = False) -> None:
        if self.stream.isatty():
            self.stream.write("\r" + text.ljust(70) + ("\n" if last else ""))
        else:
            self.stream.write(text + "\n")
        self.stream.flush()

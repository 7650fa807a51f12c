"""Rows of a benchmark: a measure beside its limit, and the table of them."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass


@dataclass
class Row:
    """One measure. Without a value, `how` says what to do to get one."""

    measure: str
    limit: float
    unit: str = "min"
    value: float | None = None
    how: str = "measured"
    at_most: bool = True
    low: float | None = None
    high: float | None = None

    @property
    def holds(self) -> bool | None:
        if self.value is None:
            return None
        return self.value <= self.limit if self.at_most else self.value >= self.limit

    def extrapolate(self, seconds: list[float], count: int, how: str) -> Row:
        """Minutes of `count` pieces, of which some took these seconds each."""
        minutes = [one * count / 60 for one in seconds]
        self.value, self.low, self.high = statistics.median(minutes), min(minutes), max(minutes)
        self.how = f"extrapolated from {how}"
        return self


def clocked(job) -> float:
    begun = time.perf_counter()
    job()
    return time.perf_counter() - begun


def laps(times: list):
    """A progress function that notes how long each turn of a loop takes."""

    def wrap(turns):
        for turn in turns:
            begun = time.perf_counter()
            yield turn
            times.append(time.perf_counter() - begun)

    return wrap


def table(rows: list[Row]) -> str:
    """The rows as a Markdown table."""
    lines = ["| measure | value | min to max | limit | holds | how |", "|---|--:|--:|--:|---|---|"]
    for row in rows:
        value = "" if row.value is None else f"{row.value:.1f} {row.unit}"
        spread = "" if row.low is None else f"{row.low:.1f} to {row.high:.1f}"
        limit = f"{'≤' if row.at_most else '≥'} {row.limit:g} {row.unit}"
        holds = {True: "yes", False: "NO", None: "?"}[row.holds]
        lines.append(f"| {' | '.join((row.measure, value, spread, limit, holds, row.how))} |")
    return "\n".join(lines)

"""How much a chapter really runs: replay, quick or full; and whether a kernel answers.

The tier is chosen once, outside, by the environment variable `PTAE_TIER`; the first cell of a
chapter prints it. Lessons hold no branches: a number that depends on the tier is written as
`by_tier(replay=40, quick=300, full=2000)`.
"""

from __future__ import annotations

import os

from ptae_lite.errors import ConfigError

TIERS = {
    "replay": "stored models and tables, evaluation done here and now",
    "quick": "short trainings are really run; their numbers are rough",
    "full": "everything is trained to the end",
}


def tier() -> str:
    """The tier that this run is in."""
    name = os.environ.get("PTAE_TIER", "replay")
    if name not in TIERS:
        raise ConfigError(f"PTAE_TIER is {name!r}; it can be {', '.join(TIERS)}")
    return name


def by_tier(*, replay, quick, full):
    """The value for this tier."""
    return {"replay": replay, "quick": quick, "full": full}[tier()]


def is_static() -> bool:
    """Whether this runs for a page without a kernel: `PTAE_STATIC=1`, as the site's build sets."""
    return os.environ.get("PTAE_STATIC") == "1"

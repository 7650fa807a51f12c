"""How much a chapter really runs: replay, quick or full; and what it runs for.

The tier is chosen once, outside, by the environment variable `PTAE_TIER`; the first cell of a
chapter prints it. Lessons hold no branches: a number that depends on the tier is written as
`by_tier(replay=40, quick=300, full=2000)`.
"""

from __future__ import annotations

import os

from IPython import get_ipython

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


def for_site() -> bool:
    """Whether this runs for a page of the site: `PTAE_STATIC=1`, as its build sets."""
    return os.environ.get("PTAE_STATIC") == "1"


def is_static() -> bool:
    """Whether this runs for a page without a kernel: of the site, or one that `nbconvert` makes.

    Who sits before a notebook can be asked for input; who runs one as a batch says that nobody
    can. `PTAE_STATIC=0` makes widgets also there.
    """
    if "PTAE_STATIC" in os.environ:
        return for_site()
    shell = get_ipython()
    request = shell.get_parent() if hasattr(shell, "get_parent") else {}
    return request.get("content", {}).get("allow_stdin") is False

"""The tier of a run: how much a chapter really computes (replay, quick or full).

The environment variable `PTAE_TIER` chooses the tier, and the first cell of a chapter prints it.
Chapters have no branches. A number that depends on the tier is written as
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
    """The tier of this run.

    Raises:
        ConfigError: `PTAE_TIER` has another value.
    """
    name = os.environ.get("PTAE_TIER", "replay")
    if name not in TIERS:
        raise ConfigError(f"PTAE_TIER is {name!r}; it can be {', '.join(TIERS)}")
    return name


def by_tier(*, replay, quick, full):
    """The value for the tier of this run."""
    return {"replay": replay, "quick": quick, "full": full}[tier()]


def for_site() -> bool:
    """Whether this runs for a page of the site: the build sets `PTAE_STATIC=1`."""
    return os.environ.get("PTAE_STATIC") == "1"


def is_batch() -> bool:
    """Whether nobody is there: a notebook that a person has open allows input, a batch does not."""
    shell = get_ipython()
    request = shell.get_parent() if hasattr(shell, "get_parent") else {}
    return request.get("content", {}).get("allow_stdin") is False


def is_static() -> bool:
    """Whether this runs for a page without a kernel: of the site, or one that `nbconvert` makes.

    `PTAE_STATIC=0` makes widgets in a batch, too.
    """
    return for_site() if "PTAE_STATIC" in os.environ else is_batch()

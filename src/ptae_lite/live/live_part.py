"""A live part over stored answers: in the site's page a button loads the model and runs it there.

In a notebook the stored answers are shown, and below them a panel that the kernel answers.
"""

from __future__ import annotations

import base64
from collections.abc import Callable
from html import escape
from typing import Any

from IPython.display import display
from matplotlib.figure import Figure

from ptae_lite.errors import PTAEError
from ptae_lite.live import scripts
from ptae_lite.run_mode import for_site, is_batch
from ptae_lite.widgets.panel_frames import as_html

PARTS = ("vision", "transformer", "labels", "conflict", "act", "policies")  # see loader.js
WITHOUT = (
    "This site was built without the scripts that run models in a page; these are stored answers."
)
NO_SCRIPT = "<noscript><p>No scripts run in this browser; these are stored answers.</p></noscript>"


class LivePart:
    """Stored answers, and the name of the live part that can take their place.

    Args:
        part: one of `PARTS`.
        stored: a panel, a figure or an image: what is shown until the reader asks for the model,
            and where it cannot run.
        label: what the part is, for screen readers.
        alt: describes a stored figure to those who cannot see it.
        offer: the text of the button.
        kernel: makes a panel that a notebook's kernel answers; None if `stored` is one.

    Raises:
        PTAEError: there is no such part.
    """

    def __init__(self, part: str, stored: Any, label: str, *, alt: str = "",
                 offer: str = "Run the model here", kernel: Callable | None = None):  # fmt: skip
        if part not in PARTS:
            raise PTAEError(f"no live part {part!r}; there are {', '.join(PARTS)}")
        self.part, self.stored, self.label, self.alt, self.offer = part, stored, label, alt, offer
        self.kernel = kernel

    def html(self) -> str:
        """The stored answers, in the place of the live part."""
        inside = NO_SCRIPT + _html_of(self.stored, self.alt)
        if scripts.missing():
            return f"<p>{WITHOUT}</p>{inside}"
        return (
            f'<div data-ptae-live="{self.part}" data-offer="{escape(self.offer)}" role="group" '
            f'aria-label="{escape(self.label)}">{inside}</div>'
        )

    def _repr_mimebundle_(self, include=None, exclude=None):
        if for_site():
            return {"text/html": self.html(), "text/plain": repr(self)}
        bundle = _bundle_of(self.stored)
        data, about = bundle if isinstance(bundle, tuple) else (bundle, {})
        return data | {"text/plain": repr(self)}, about

    def _ipython_display_(self) -> None:
        shown = self._repr_mimebundle_()
        data, about = shown if isinstance(shown, tuple) else (shown, {})
        display(data, metadata=about, raw=True)
        if self.kernel and not for_site() and not is_batch():
            display(self.kernel())

    def __repr__(self) -> str:
        return f"LivePart({self.part!r}, {self.label!r})"


def _html_of(stored: Any, alt: str) -> str:
    bundle = _bundle_of(stored)
    bundle = bundle[0] if isinstance(bundle, tuple) else bundle
    if "text/html" in bundle:
        return bundle["text/html"]
    if "image/svg+xml" in bundle:
        return f'<div role="img" aria-label="{escape(alt)}">{bundle["image/svg+xml"]}</div>'
    kind = next(name for name in bundle if name.startswith("image/"))
    image = bundle[kind]
    coded = image if isinstance(image, str) else base64.b64encode(image).decode("ascii")
    return f'<img style="max-width:100%" alt="{escape(alt)}" src="data:{kind};base64,{coded}">'


def _bundle_of(stored: Any):
    """What a notebook would show of an object: contents by kind, perhaps with metadata."""
    if isinstance(stored, Figure):
        return {"text/html": as_html(stored, "")}
    if hasattr(stored, "_repr_mimebundle_"):
        found = stored._repr_mimebundle_()
        if found:
            return found
    shows = {"text/html": "html", "image/svg+xml": "svg", "image/png": "png", "image/jpeg": "jpeg"}
    made = {kind: getattr(stored, f"_repr_{name}_", lambda: None)() for kind, name in shows.items()}
    return {kind: content for kind, content in made.items() if content}

"""A panel with a button that runs some work for the panel's values, if there is a kernel."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets

from ptae_lite.run_mode import is_static
from ptae_lite.widgets.panel_frames import as_html
from ptae_lite.widgets.panels import Panel


class TrainButton:
    """A panel, and a button below it.

    Args:
        panel: shown above the button. A page without a kernel shows the panel only.
        work: called with the panel's values and with `tell`, a function that shows a line of text
            during the work. It returns what a panel's function may return; it appears below.
        button: the text on the button.
    """

    def __init__(self, panel: Panel, work: Callable[..., Any], button: str):
        self.panel, self.work, self.button = panel, work, button

    def widget(self) -> ipywidgets.VBox:
        """The panel's widget, the button, a line about the progress, and the result."""
        box = self.panel.widget()
        controls = dict(zip(self.panel.values, box.children, strict=False))
        button = ipywidgets.Button(description=self.button, layout={"width": "max-content"})
        line, result = ipywidgets.HTML(), ipywidgets.HTML()

        def tell(text: str) -> None:
            line.value = f'<span role="status">{escape(text)}</span>'

        def press(_button) -> None:
            button.disabled = True
            try:
                made = self.work(tell=tell, **{n: c.value for n, c in controls.items()})
                label = "The figure shows what was just made."
                result.value = escape(made) if isinstance(made, str) else as_html(made, label)
            except Exception:
                result.value = f'<pre role="alert">{escape(traceback.format_exc())}</pre>'
                raise  # a callback's error goes to a log that few readers open, so show it, too
            finally:
                button.disabled = False

        button.on_click(press)
        return ipywidgets.VBox([*box.children, button, line, result])

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, Any]:
        bundle = self.panel._repr_mimebundle_(include, exclude)
        if not is_static():
            bundle |= self.widget()._repr_mimebundle_() | {"text/plain": repr(self)}
        return bundle

    def __repr__(self) -> str:
        return f"TrainButton({self.panel!r}, {self.button!r})"

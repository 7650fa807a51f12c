"""Sliders that work with a kernel, and on a page without one.

A `Panel` is a pure function and the values with which it may be called. With a kernel it is a
widget. In the static book it is plain HTML with one frame for each combination of values. That
needs no library and no network, and the keyboard works as in any form.
"""

from __future__ import annotations

import base64
import inspect
import io
import json
import traceback
from collections.abc import Callable, Iterable, Mapping
from html import escape
from itertools import product
from numbers import Real
from typing import Any

import ipywidgets
import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

from ptae_lite.errors import PTAEError
from ptae_lite.plots.style import few_colours
from ptae_lite.run_mode import is_static
from ptae_lite.widgets.panel_frames import ON_INPUT, as_html, laid_away, saved

# Gives a screen reader what is written beside the sliders of a widget: their names and values.
# ipywidgets gives it no names, and positions instead of values.
_TELL_SLIDERS = """
const box = this.closest('.widget-vbox');
const tell = () => {
  for (const slider of box.querySelectorAll('.widget-slider')) {
    const handle = slider.querySelector('.noUi-handle');
    const told = {'aria-label': '.widget-label', 'aria-valuetext': '.widget-readout'};
    for (const [attribute, place] of Object.entries(told)) {
      const text = slider.querySelector(place).textContent;
      if (handle.getAttribute(attribute) !== text) handle.setAttribute(attribute, text);
    }
  }
};
new MutationObserver(tell).observe(
  box, {subtree: true, childList: true, characterData: true, attributeFilter: ['aria-valuetext']});
tell();
"""


class Panel:
    """A function under one or more sliders or choices.

    With a kernel it is a widget, with a picture of the start for pages that show no widgets. For a
    page without a kernel (`run_mode.is_static`) it is HTML with every frame drawn in advance. Each
    frame is drawn once.

    Args:
        function: called as `function(name=value, ...)`; returns a matplotlib figure, an object with
            `_repr_html_` (its picture is its `figure`, if it has one), or a text. It must depend
            on its arguments alone.
        values: the values of the function's one control, or a dictionary with the values of each
            control, by argument name. Numbers make a slider, anything else a choice.
        label: the text at the one control. With several controls it is the panel's title, and each
            control has the name of its argument.
        start: the first value, or a dictionary of them; None for the first of each list.
        labels: texts for controls, instead of the arguments' names.
        describe: called like `function`; returns a sentence about the figure, for readers who
            cannot see it. None for the labels and the values.

    Raises:
        PTAEError: a control has no values or one twice, or the function returns something else. An
            error of the function at the start also ends here; a later one is shown instead of the
            frame.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        values: Iterable | Mapping[str, Iterable],
        label: str,
        *,
        start: Any = None,
        labels: Mapping[str, str] | None = None,
        describe: Callable[..., str] | None = None,
    ):
        if isinstance(values, Mapping):
            self.labels = {name: name.replace("_", " ") for name in values} | dict(labels or {})
        else:
            name = next(iter(inspect.signature(function).parameters))
            values, start = {name: values}, None if start is None else {name: start}
            self.labels = {name: label}
        self.values = {name: list(allowed) for name, allowed in values.items()}
        for name, allowed in self.values.items():
            if not allowed or any(value in allowed[:i] for i, value in enumerate(allowed)):
                raise PTAEError(f"{name} needs at least one value, and each only once: {allowed}")
        self.function, self.label, self.describe = function, label, describe
        self.start = {name: allowed[0] for name, allowed in self.values.items()} | (start or {})
        self._frames: dict[tuple[int, ...], Any] = {}
        self._faces: dict[tuple[int, ...], str] = {}
        # Drawn now and not when shown: IPython prints an error that is raised while showing, but
        # the cell counts as passed.
        self.face(**self.start)
        self._static = self.html() if is_static() else None

    def frame(self, **values) -> Any:
        """What the function returns for these values.

        Raises:
            PTAEError: a value is not in the panel, or the function returns something else.
        """
        key = self._positions(values)
        if key not in self._frames:
            made = self.function(**values)
            if isinstance(made, Figure):
                plt.close(made)  # or the notebook would show it a second time, below the cell
            elif not isinstance(made, str) and not hasattr(made, "_repr_html_"):
                raise PTAEError(
                    f"the function of panel {self.label!r} returned {type(made).__name__}; it "
                    "must return a matplotlib figure, a text or an object with _repr_html_"
                )
            self._frames[key] = made
        return self._frames[key]

    def face(self, **values) -> str:
        """The frame for these values as HTML. It is the same with and without a kernel."""
        key = self._positions(values)
        if key not in self._faces:
            self._faces[key] = as_html(self.frame(**values), self.description(**values))
        return self._faces[key]

    def description(self, **values) -> str:
        """The text that replaces the picture for those who cannot see it."""
        self._positions(values)
        if self.describe is not None:
            return self.describe(**values)
        texts = (f"{self.labels[name]} = {_text(value)}" for name, value in values.items())
        return ("" if len(values) == 1 else f"{self.label}: ") + ", ".join(texts)

    def widget(self) -> ipywidgets.VBox:
        """The widget: a control for each argument, and the frame below."""
        controls = {}
        for name, allowed in self.values.items():
            slides = _all_numbers(allowed)
            kind = ipywidgets.SelectionSlider if slides else ipywidgets.Dropdown
            controls[name] = kind(
                options=[(_text(value), value) for value in allowed],
                value=self.start[name],
                description=self.labels[name],
                style={"description_width": "initial"},
                layout={"width": "min(34rem, 100%)" if slides else "max-content"},
            )
        view = ipywidgets.HTML(self.face(**self.start))

        def update(_change):
            try:
                view.value = self.face(**{name: c.value for name, c in controls.items()})
            except Exception:
                view.value = f'<pre role="alert">{escape(traceback.format_exc())}</pre>'
                raise  # a callback's error goes to a log that few readers open, so show it, too

        for control in controls.values():
            control.observe(update, "value")
        script = f'<style onload="{escape(_TELL_SLIDERS)}"></style>'  # a <script> would not run
        telling = ipywidgets.HTML(script, layout={"display": "none"})
        return ipywidgets.VBox([*controls.values(), view, telling])

    def html(self) -> str:
        """The HTML without a kernel: controls, and every different frame."""
        rows = "".join(self._row(name) for name in self.values)
        combinations = product(*self.values.values())
        faces = [self.face(**dict(zip(self.values, c, strict=True))) for c in combinations]
        number = {face: i for i, face in enumerate(dict.fromkeys(faces))}
        first = self.face(**self.start)
        frames = "".join(
            f"<div data-frame>{face}</div>" if face == first
            else f"<div data-frame hidden>{laid_away(face)}</div>" for face in number
        )  # fmt: skip
        return (
            f'<div data-ptae-embed="panel" role="group" aria-label="{escape(self.label)}" '
            f'oninput="{escape(ON_INPUT)}" data-order="{[number[face] for face in faces]}">'
            f'{rows}<div aria-live="polite">{frames}</div></div>'
        )

    def _row(self, name: str) -> str:
        allowed, first = self.values[name], self.values[name].index(self.start[name])
        texts = [_text(value) for value in allowed]
        if _all_numbers(allowed):
            control = (
                f'<input type="range" min="0" max="{len(allowed) - 1}" step="1" value="{first}" '
                f'aria-valuetext="{escape(texts[first])}" autocomplete="off">'
            )
            output = f"<output>{escape(texts[first])}</output>"
        else:
            options = "".join(
                f'<option value="{i}"{" selected" if i == first else ""}>{escape(text)}</option>'
                for i, text in enumerate(texts)
            )
            control, output = f'<select autocomplete="off">{options}</select>', ""
        return (
            f'<div data-values="{escape(json.dumps(texts))}" style="margin:.4em 0">'
            f"<label>{escape(self.labels[name])} {control}</label> {output}</div>"
        )

    def _positions(self, values: Mapping[str, Any]) -> tuple[int, ...]:
        """The place of each value among those of its control."""
        if set(values) != set(self.values):
            raise PTAEError(f"panel {self.label!r} takes {', '.join(self.values)}")
        for name, value in values.items():
            if value not in self.values[name]:
                allowed = ", ".join(_text(one) for one in self.values[name])
                raise PTAEError(f"{name} = {_text(value)} is not in this panel; it has {allowed}")
        return tuple(self.values[name].index(values[name]) for name in self.values)

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, Any]:
        if self._static is not None:
            return {"text/html": self._static, "text/plain": repr(self)}
        bundle = self.widget()._repr_mimebundle_() | {"text/plain": repr(self)}
        at_start = self.frame(**self.start)
        at_start = getattr(at_start, "figure", at_start)
        if isinstance(at_start, Figure):
            picture = few_colours(Image.open(io.BytesIO(saved(at_start, "png"))))
            bundle["image/png"] = base64.b64encode(picture).decode("ascii")
        return bundle

    def __repr__(self) -> str:
        start = ", ".join(f"{name}={_text(value)}" for name, value in self.start.items())
        return f"Panel({self.label!r}, {start})"


def _all_numbers(values: list) -> bool:
    return all(isinstance(value, Real) and not isinstance(value, bool) for value in values)


def _text(value: Any) -> str:
    return str(value).removesuffix(".0") if isinstance(value, float) else str(value)

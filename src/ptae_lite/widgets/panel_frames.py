"""Frames of a panel as HTML, and the script of a page without a kernel that shows one of them."""

from __future__ import annotations

import base64
import io
import re
import zlib
from html import escape
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

# Runs when a control of the panel moves: shows the frame for their positions. Positions with the
# same content share a frame. A hidden frame with a scene or a photo is kept in a template, because
# browsers also load hidden scenes, and keep only about 16 alive. A hidden drawing is deflated to a
# ninth of its size, and unpacked when it is first shown. On the site, what is hidden comes when it
# is asked for; see `book/late.py`. The code is an attribute and not a script, so it needs no names
# that could occur twice on a page. In an attribute, URL alone is the document's.
ON_INPUT = """
let index = 0;
const order = JSON.parse(this.dataset.order);
for (const row of this.querySelectorAll('[data-values]')) {
  const values = JSON.parse(row.dataset.values), control = row.querySelector('input, select');
  const output = row.querySelector('output'), position = Number(control.value);
  index = index * values.length + position;
  if (output) {
    output.value = values[position];
    control.setAttribute('aria-valuetext', values[position]);
  }
}
if (this.querySelector('[data-late]')) {
  lateFrames().then(() => this.dispatchEvent(new Event('input')));
  return;
}
this.querySelectorAll('[data-frame]').forEach((frame, i) => {
  const shown = i === order[index], kept = frame.querySelector(':scope > template');
  if (shown && kept) frame.replaceChildren(kept.content.cloneNode(true));
  if (!shown && frame.querySelector('iframe')) {
    const away = document.createElement('template');
    away.innerHTML = frame.innerHTML;
    frame.replaceChildren(away);
  }
  for (const image of shown ? frame.querySelectorAll('img[data-packed]') : []) {
    const packed = Uint8Array.from(atob(image.dataset.packed), letter => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
    new Response(stream).arrayBuffer().then(drawn => {
      image.src = window.URL.createObjectURL(new Blob([drawn], {type: 'image/svg+xml'}));
    });
    image.removeAttribute('data-packed');
  }
  frame.hidden = !shown;
});
"""
SHARP_DPI = 150  # of a figure with pictures
_DRAWING = re.compile(r'src="data:image/svg\+xml;base64,([^"]+)"')


def as_html(made: Any, description: str) -> str:
    """HTML of a figure (with its description), of a text, or of an object with `_repr_html_`."""
    if isinstance(made, Figure):
        kind, picture = "svg+xml", saved(made, "svg")
        if any(axes.images for axes in made.axes):  # camera's pictures: a fifth of the size
            kind, picture = "webp", _webp(made)
        coded = base64.b64encode(picture).decode("ascii")
        return (
            f'<img style="max-width:100%" alt="{escape(description)}" '
            f'src="data:image/{kind};base64,{coded}">'
        )
    return f"<pre>{escape(made)}</pre>" if isinstance(made, str) else made._repr_html_()


def laid_away(face: str) -> str:
    """A frame that is hidden at first, so that it takes little room and loads nothing."""
    if "<iframe" in face or "data:image/webp" in face:
        return f"<template>{face}</template>"
    return _DRAWING.sub(_packed, face)


def _packed(source: re.Match) -> str:
    drawn = zlib.compress(base64.b64decode(source[1]), 9)
    return f'data-packed="{base64.b64encode(drawn).decode("ascii")}"'


def saved(figure: Figure, kind: str) -> bytes:
    """The figure as a file. The same figure gives the same bytes: no random names, no date."""
    file = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with plt.rc_context({"svg.hashsalt": "ptae_lite"}):
        figure.savefig(file, format=kind, metadata=metadata)
    return file.getvalue()


def _webp(figure: Figure) -> bytes:
    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=SHARP_DPI)
    Image.open(drawn).convert("RGB").save(small, "WEBP", quality=85, method=6)
    return small.getvalue()

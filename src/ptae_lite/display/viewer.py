"""A recorded 3-D scene as one HTML page that needs no server, no kernel and no network.

The page holds three packed parts: meshcat's viewer script, the commands that build the scene, and
the movement: a 4 x 4 pose for each frame and moving link, which a short script hands to the viewer.
"""

from __future__ import annotations

import base64
import html
import json
import zlib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Viewer:
    """A recorded scene that a notebook, a static page or a file can show.

    `commands` build the scene at frame 0; `poses` (T, M, 4, 4) are the world transforms of the M
    links named in `moving`, lengths in metres. `still_png` is what is seen where no script runs.
    """

    commands: list[dict]
    moving: tuple[str, ...]
    poses: Float[np.ndarray, "T M 4 4"]
    frames_per_s: float
    look_at_m: tuple[float, float, float]  # the mouse turns the scene about this point
    title: str
    still_png: bytes | None = None
    height_px: int = 440

    def html(self) -> str:
        """The page: complete in itself, and the same bytes each time."""
        scene = {
            "commands": self.commands,
            "moving": self.moving,
            "last": len(self.poses) - 1,
            "frames_per_s": self.frames_per_s,
            "look_at_m": self.look_at_m,
        }
        parts = {
            "VIEWER": _viewer_script(),
            "SCENE": _pack(json.dumps(scene).encode()),
            # three.js stores a matrix column by column; 16 little-endian floats a pose
            "POSES": _pack(self.poses.swapaxes(-1, -2).astype("<f4").tobytes()),
            "TITLE": html.escape(self.title),  # last: the others cannot hold an @, a title can
        }
        page = files(__package__).joinpath("viewer.html").read_text(encoding="utf-8")
        for name, text in parts.items():
            page = page.replace(f"@{name}@", text)
        return page

    def save(self, path: str | Path) -> Path:
        """Write the page to a file, and return where."""
        path = Path(path)
        path.write_text(self.html(), encoding="utf-8", newline="\n")
        return path

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        # lazy: a browser keeps about 16 WebGL pictures alive, so only those in view may start
        title, page = html.escape(self.title), html.escape(self.html())
        bundle = {
            "text/html": '<iframe data-ptae-embed="scene" sandbox="allow-scripts" loading="lazy" '
            f'title="{title}" aria-label="{title}" width="100%" height="{self.height_px}" '
            f'style="border:1px solid #ccd;border-radius:6px" srcdoc="{page}"></iframe>',
            "text/plain": repr(self),
        }
        if self.still_png is not None:
            bundle["image/png"] = base64.b64encode(self.still_png).decode("ascii")
        return bundle

    def __repr__(self) -> str:
        return f"Viewer({self.title!r}, {len(self.poses)} frames, {self.frames_per_s:g} per second)"


def _pack(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


@cache
def _viewer_script() -> str:
    """meshcat's viewer, three.js in it, and the licences they come with; packed."""
    folder = files("meshcat") / "viewer"
    licence = (folder / "LICENSE").read_bytes()
    notices = (folder / "dist" / "main.min.js.LICENSE.txt").read_bytes()  # all of it is comments
    script = (folder / "dist" / "main.min.js").read_bytes()
    return _pack(b"/*!\n" + licence + b"*/\n" + notices + b"\n" + script)

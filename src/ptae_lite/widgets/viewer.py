"""A recorded 3-D scene as one HTML page that needs no server, no kernel and no network.

The page has three compressed parts: meshcat's viewer script, the commands that build the scene, and
the movement. A short script gives the movement to the viewer, frame by frame. The viewer script is
by far the largest part. On the book's site it is one file that all scenes share.
"""

from __future__ import annotations

import base64
import html
import importlib.util
import io
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image

from ptae_lite.errors import PTAEError
from ptae_lite.run_mode import for_site

SHARED_SCRIPT = "_static/scene.js"  # from the site's root
UNIT = 2.0**-14  # rounding of a pose's entries: 0.03 mm, or 0.002 degrees
# A scene of the site loads its script: a careful server forbids scripts that stand in a scene, for
# it knows only those that stand in pages. The way to the site's root is filled in with the page.
ROOT = "@ROOT@"
_SHARED_PLAYER = f'<script src="{ROOT}{SHARED_SCRIPT}"></script>'
COLUMNS = 5  # of the sheet of camera pictures
BACKGROUNDS = {  # top and bottom, red, green and blue from 0 to 1
    "light": ((0.90, 0.93, 0.97), (1.0, 1.0, 1.0)),
    "dark": ((0.22, 0.24, 0.28), (0.13, 0.14, 0.17)),
}


@dataclass(frozen=True, eq=False)
class Viewer:
    """A recorded scene that a notebook, a static page or a file can show.

    Attributes:
        commands: they build the scene at frame 0.
        moving: the M links that move.
        poses: their world transforms, in metres.
        frames_per_s: speed of the movement.
        look_at_m: the mouse turns the scene about this point.
        title: said to screen readers.
        caption: text below the scene.
        still_png: a picture, shown where no script runs.
        eye: camera's pictures (H, W, 3); each is shown from its frame on.
        autoplay: play again and again until it is stopped.
        height_px: height of the frame in a page.
    """

    commands: list[dict]
    moving: tuple[str, ...]
    poses: Float[np.ndarray, "T M 4 4"]
    frames_per_s: float
    look_at_m: tuple[float, float, float]
    title: str
    caption: str = ""
    still_png: bytes | None = None
    eye: Mapping[int, np.ndarray] | None = None
    autoplay: bool = False
    height_px: int = 440

    def html(self, *, shared: bool = False) -> str:
        """The page. The same scene gives the same text.

        Args:
            shared: use the site's shared script; else the page is complete in itself.
        """
        parts = {
            "SCENE": _pack(json.dumps(self.described(), separators=(",", ":")).encode()),
            "MOVES": _pack(_steps(self.poses).astype("<i2").tobytes()),
            # last: the others cannot hold an @, these can
            "CAPTION": html.escape(self.caption),
            "TITLE": html.escape(self.title),
        }
        library = "" if shared else _pack(_library())
        player = _SHARED_PLAYER if shared else f"<script>\n{_read('viewer.js')}</script>"
        page = template(library, player)
        for name, text in parts.items():
            page = page.replace(f"@{name}@", text)
        return page

    def described(self) -> dict:
        """The scene without its movement: what the page's script reads first."""
        return {
            "commands": self.commands,
            "moving": self.moving,
            "last": len(self.poses) - 1,
            "unit": UNIT,
            "frames_per_s": self.frames_per_s,
            "look_at_m": self.look_at_m,
            "backgrounds": BACKGROUNDS,
            "eye": self.eye and _film(self.eye),
            "autoplay": self.autoplay,
        }

    def save(self, path: str | Path) -> Path:
        """Write the complete page to a file, and return its path."""
        path = Path(path)
        path.write_text(self.html(), encoding="utf-8", newline="\n")
        return path

    def _repr_html_(self) -> str:
        """A frame with the page in it; on the site (`PTAE_STATIC=1`) also the still picture."""
        static = for_site()
        title, page = html.escape(self.title), html.escape(self.html(shared=static))
        # In a notebook the page is isolated. On the site it needs the site's script and theme.
        closed = "" if static else 'sandbox="allow-scripts" '
        # lazy: a browser keeps about 16 WebGL scenes alive, so only those in view may start
        frame = (
            f'<iframe data-ptae-embed="scene" {closed}loading="lazy" title="{title}" '
            f'aria-label="{title}" width="100%" height="{self.height_px}" '
            f'style="border:1px solid #8889;border-radius:6px" srcdoc="{page}"></iframe>'
        )
        if not static or self.still_png is None:
            return frame
        small = io.BytesIO()
        still = Image.open(io.BytesIO(self.still_png)).convert("RGB")
        still.save(small, "WEBP", quality=70, method=6)
        picture = f'<img alt="{title}" src="{_data_uri(small.getvalue(), "webp")}">'
        return (
            f'<div class="ptae-scene">{frame}<div class="ptae-still">{picture}'
            f"<p>{html.escape(self.caption)}</p></div></div>"
        )

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        bundle = {"text/html": self._repr_html_(), "text/plain": repr(self)}
        if self.still_png is not None:
            bundle["image/png"] = base64.b64encode(self.still_png).decode("ascii")
        return bundle

    def __repr__(self) -> str:
        return f"Viewer({self.title!r}, {len(self.poses)} frames, {self.frames_per_s:g} per second)"


def template(library: str, player: str) -> str:
    """The page with its scripts; @SCENE@, @MOVES@, @CAPTION@ and @TITLE@ are still to fill.

    Args:
        library: meshcat's viewer, packed, where the player does not bring it.
        player: the element with the script that plays the scene.
    """
    page = _read("viewer.html").replace("@FILE@", SHARED_SCRIPT)
    return page.replace("@VIEWER@", library).replace("@PLAYER@", player)


def _steps(poses: Float[np.ndarray, "T M 4 4"]) -> np.ndarray:
    """Changes from frame to frame in whole units: (M, 12, T). Small numbers compress well.

    They are differences of rounded poses, not rounded differences, so errors do not add up.
    """
    units = np.round(poses[:, :, :3] / UNIT).astype(int)
    steps = np.diff(units, axis=0, prepend=0)
    if np.abs(steps).max(initial=0) >= 2**15:
        raise PTAEError("a link is more than 2 m away, or goes so far in a frame")
    return np.moveaxis(steps.reshape(len(steps), -1, 12), 0, -1)


def _film(pictures: Mapping[int, np.ndarray]) -> dict:
    """The camera's pictures in one WebP sheet, with their frame numbers."""
    shots = [pictures[frame] for frame in sorted(pictures)]
    height, width, _ = shots[0].shape
    rows = -(-len(shots) // COLUMNS)
    sheet = np.zeros((rows * height, COLUMNS * width, 3), np.uint8)
    for i, shot in enumerate(shots):
        y, x = height * (i // COLUMNS), width * (i % COLUMNS)
        sheet[y : y + height, x : x + width] = shot
    small = io.BytesIO()
    Image.fromarray(sheet).save(small, "WEBP", quality=40, method=6)
    return {
        "frames": sorted(map(int, pictures)),
        "size": (width, height),
        "columns": COLUMNS,
        "sheet": _data_uri(small.getvalue(), "webp"),
    }


def _data_uri(data: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _pack(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def _read(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def shared_script() -> bytes:
    """The script that all scenes of the site share: meshcat's viewer and our player."""
    return _library() + b"\n" + _read("viewer.js").encode()


@cache
def _library() -> bytes:
    """meshcat's viewer, which contains three.js, with their licences."""
    # found and not imported: meshcat would import its server, which warns of an outdated name
    folder = Path(importlib.util.find_spec("meshcat").origin).parent / "viewer"
    licence = (folder / "LICENSE").read_bytes()
    notices = (folder / "dist" / "main.min.js.LICENSE.txt").read_bytes()  # all of it is comments
    script = (folder / "dist" / "main.min.js").read_bytes()
    return b"/*!\n" + licence + b"*/\n" + notices + b"\n" + script

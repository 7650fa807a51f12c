"""A choice of recorded frames as small PNGs in one zip file, for the live parts of the book.

The whole recording has 64,800 frames; a reader who has no simulator gets some two thousand: first,
middle and last frames of the samples, and one video of each of the 12 actions.
"""

from __future__ import annotations

import io
import re
import zipfile
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image

from ptae_lite import artefacts
from ptae_lite.errors import RecordingError
from ptae_lite.files import atomic_write
from ptae_lite.language import patterns
from ptae_lite.robot.motions import VARIATIONS

STORED = "recording/frames.zip"
MAKE = "python -m ptae_lite record"
_NAME = re.compile(r"p(\d{3})_v(\d)_t(\d{2,3})\.png")


def video_patterns() -> tuple[int, ...]:
    """One training pattern for each of the 12 actions, arrangements taken in turn."""
    chosen: dict[int, int] = {}
    for p in patterns():
        used = {(patterns()[i].left, patterns()[i].right) for i in chosen.values()}
        if p.split == "train" and p.action_index not in chosen and (p.left, p.right) not in used:
            chosen[p.action_index] = p.index
    return tuple(chosen[a] for a in sorted(chosen))


def choice() -> list[tuple[int, int, int]]:
    """Which frames are stored: (pattern, variation, frame)."""
    keep = set()
    videos = video_patterns()
    for p in patterns():
        for variation in range(VARIATIONS):
            keep.add((p.index, variation, 0))
            # a moment during the action, another in each variation
            moment = (0.25 + 0.1 * variation) * p.frames
            keep.add((p.index, variation, int(moment)))
        if p.index in videos:
            keep |= {(p.index, 0, t) for t in range(0, p.frames, p.frames // 25)}
            keep.add((p.index, 0, p.frames - 1))
    return sorted(keep)


def write(folder) -> Path:
    """Write `frames.zip` into a recording's folder, the same bytes each time."""
    from ptae_lite.robot.recorder import load_sequence

    path, last, images = Path(folder) / "frames.zip", None, None
    with (
        atomic_write(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as file,
    ):
        for index, variation, t in choice():
            if (index, variation) != last:
                images, last = load_sequence(folder, index, variation).images, (index, variation)
            png = io.BytesIO()
            Image.fromarray(images[t]).save(png, "PNG", optimize=True)
            name = zipfile.ZipInfo(f"p{index:03d}_v{variation}_t{t:02d}.png")
            file.writestr(name, png.getvalue())
    return path


@lru_cache(maxsize=2)
def _open(path: Path) -> dict[tuple[int, int, int], bytes]:
    try:
        with zipfile.ZipFile(path) as file:
            return {
                tuple(int(part) for part in _NAME.fullmatch(name).groups()): file.read(name)
                for name in file.namelist()
            }
    except AttributeError:  # a name that is none of ours has no groups
        raise RecordingError(f"{path} holds more than frames, so it is not of ours") from None
    except (zipfile.BadZipFile, OSError, EOFError) as error:
        raise RecordingError(f"{path} is damaged ({error}); make it again: {MAKE}") from None


def stored_keys() -> list[tuple[int, int, int]]:
    """All stored frames as (pattern, variation, frame)."""
    return sorted(_open(artefacts.stored(STORED)))


def frame(pattern: int, variation: int, t: int) -> np.ndarray:
    """One stored frame (120, 160, 3). Raises `RecordingError` where it is not stored."""
    frames = _open(artefacts.stored(STORED))
    if (pattern, variation, t) not in frames:
        there = [key[2] for key in frames if key[:2] == (pattern, variation)]
        raise RecordingError(
            f"frame {t} of pattern {pattern}, variation {variation} is not stored; "
            f"stored of it: {', '.join(map(str, sorted(there))) or 'none'}"
        )
    try:
        return np.array(Image.open(io.BytesIO(frames[pattern, variation, t])).convert("RGB"))
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:  # of a picture's file
        raise RecordingError(
            f"frame {t} of pattern {pattern} is damaged ({error}); {MAKE}"
        ) from None


def images(keys) -> np.ndarray:
    """Several stored frames (M, 120, 160, 3)."""
    from ptae_lite.robot.recorder import IMAGE

    found = np.empty((len(keys), *IMAGE), np.uint8)  # there is no need to have them twice
    for place, key in zip(found, keys, strict=True):
        place[:] = frame(*key)
    return found


class Images:
    """Stored frames that stay compressed until they are asked for; decoded, all take 114 MB.

    They are indexed as an array (M, 120, 160, 3) is along its first axis.
    """

    def __init__(self, keys):
        self.keys = np.asarray(keys)  # (M, 3): pattern, variation, frame

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, rows) -> np.ndarray:
        keys = self.keys[rows]
        return images(keys) if keys.ndim == 2 else frame(*keys)


def training_images(folder, every: int = 3) -> np.ndarray:
    """Images of the training patterns in a recording, each `every`-th frame, first ones included.

    Neighbouring frames are nearly alike: a third of them (0.9 GB) trains as well as all.
    """
    from ptae_lite.robot.recorder import IMAGE, check_ours, load_sequence

    check_ours(folder, same_scene=False)
    chosen = [(p, v) for p in patterns() if p.split == "train" for v in range(VARIATIONS)]
    ends = np.cumsum([len(range(0, p.frames, every)) for p, _ in chosen])
    images = np.empty((ends[-1], *IMAGE), np.uint8)  # there is no room for them twice
    for (p, variation), part in zip(chosen, np.split(images, ends[:-1]), strict=True):
        part[:] = load_sequence(folder, p.index, variation).images[::every]
    return images

"""A selection of recorded frames, stored as small PNGs in one zip file.

The whole recording has 64,800 frames. The book stores about two thousand of them, for readers
without a simulator: two frames of each sample, and 26 frames of one video for each of the 12
actions.
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
    """One training pattern for each of the 12 actions, each in another arrangement."""
    chosen: dict[int, int] = {}
    for p in patterns():
        used = {(patterns()[i].left, patterns()[i].right) for i in chosen.values()}
        if p.split == "train" and p.action_index not in chosen and (p.left, p.right) not in used:
            chosen[p.action_index] = p.index
    return tuple(chosen[a] for a in sorted(chosen))


def choice() -> list[tuple[int, int, int]]:
    """Which frames are stored: (pattern, variation, frame), sorted."""
    keep = set()
    videos = video_patterns()
    for p in patterns():
        for variation in range(VARIATIONS):
            keep.add((p.index, variation, 0))
            # a frame during the action; each variation has another one
            moment = (0.25 + 0.1 * variation) * p.frames
            keep.add((p.index, variation, int(moment)))
        if p.index in videos:
            keep |= {(p.index, 0, t) for t in range(0, p.frames, p.frames // 25)}
            keep.add((p.index, 0, p.frames - 1))
    return sorted(keep)


def write(folder) -> Path:
    """Write `frames.zip` into a recording's folder. The same recording gives the same bytes.

    Raises:
        RecordingError: a sequence is missing or damaged.
        FileError: the file cannot be written.
    """
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
    except AttributeError:  # another name does not match
        raise RecordingError(f"{path} holds more than frames, so it is not of ours") from None
    except (zipfile.BadZipFile, OSError, EOFError) as error:
        raise RecordingError(f"{path} is damaged ({error}); make it again: {MAKE}") from None


def stored_keys() -> list[tuple[int, int, int]]:
    """All stored frames as (pattern, variation, frame), sorted."""
    return sorted(_open(artefacts.stored(STORED)))


def frame(pattern: int, variation: int, t: int) -> np.ndarray:
    """One stored frame (120, 160, 3) of bytes.

    Raises:
        RecordingError: the frame is not stored, or is damaged.
    """
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
    """Several stored frames (M, 120, 160, 3) of bytes; `keys` are (pattern, variation, frame).

    Raises:
        RecordingError: a frame is not stored, or is damaged.
    """
    from ptae_lite.robot.recorder import IMAGE

    found = np.empty((len(keys), *IMAGE), np.uint8)  # filled in place: a stack would copy them
    for place, key in zip(found, keys, strict=True):
        place[:] = frame(*key)
    return found


class Images:
    """Stored frames that are decoded when they are asked for. Decoded, all of them take 114 MB.

    Index them like an array (M, 120, 160, 3) along its first axis.

    Args:
        keys: M rows of pattern, variation, frame.
    """

    def __init__(self, keys):
        self.keys = np.asarray(keys)

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, rows) -> np.ndarray:
        keys = self.keys[rows]
        return images(keys.tolist()) if keys.ndim == 2 else frame(*keys.tolist())


def training_images(folder, every: int = 3) -> np.ndarray:
    """Images (M, 120, 160, 3) of the training patterns of a recording.

    Args:
        every: take each `every`-th frame, the first one included. Neighbouring frames are nearly
            the same: a third of them (0.9 GB) trains as well as all.

    Raises:
        RecordingError: the folder is not a recording of ours, or a sequence is missing or damaged.
    """
    from ptae_lite.robot.recorder import IMAGE, check_ours, load_sequence

    check_ours(folder, same_scene=False)
    chosen = [(p, v) for p in patterns() if p.split == "train" for v in range(VARIATIONS)]
    ends = np.cumsum([len(range(0, p.frames, every)) for p, _ in chosen])
    images = np.empty((ends[-1], *IMAGE), np.uint8)  # filled in place: a copy takes another 0.9 GB
    for (p, variation), part in zip(chosen, np.split(images, ends[:-1]), strict=True):
        part[:] = load_sequence(folder, p.index, variation).images[::every]
    return images

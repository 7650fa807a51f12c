"""The clips that the page offers: one of each of the 144 patterns, and what the language knows."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt16

from ptae_lite import language
from ptae_lite.data.samples import Samples
from ptae_lite.data.scaling import Scaling
from ptae_lite.data.signals import WIRING
from ptae_lite.experiments.answer_source import Motions

VARIATION = 0
LEVELS = 2**16 - 1


def chosen(samples: Samples) -> list[int]:
    """The sample numbers of the 144 clips, by pattern."""
    number = {int(p): i for i, p in enumerate(samples.pattern)
              if samples.variation[i] == VARIATION}  # fmt: skip
    return [number[p.index] for p in language.patterns()]


def quantised(
    rows: Float[np.ndarray, "R C"],
) -> tuple[UInt16[np.ndarray, "C R"], Float[np.ndarray, "2 C"]]:
    """Columns as whole numbers, each from its lowest to its highest value, as differences from row
    to row: they are small, so they pack well. An error is at most 8 millionths of the range.

    Returns:
        the differences, and the lowest value and the size of a level of each column.
    """
    low, high = rows.min(0), rows.max(0)
    step = np.where(high > low, high - low, 1) / LEVELS
    levels = np.rint((rows - low) / step).astype(np.int64)
    return np.diff(levels, axis=0, prepend=0).T.astype(np.uint16), np.stack([low, step])


def parts(samples: Samples, indices: list[int]) -> tuple[dict[str, bytes], dict]:
    """Features and joints of some clips, and what the page is told of them."""
    made, frames = {}, [int(samples.frames[i]) for i in indices]
    for name in ("features", "joints"):
        rows = np.concatenate([getattr(samples, name)[i, :n].astype(float)
                               for i, n in zip(indices, frames, strict=True)])  # fmt: skip
        levels, range_ = quantised(rows)
        made[name] = levels.astype("<u2").tobytes()
        made[f"{name}_range"] = range_.astype("<f8").tobytes()
    patterns = [language.pattern(int(samples.pattern[i])) for i in indices]
    about = [{"sample": i, "frames": n, "action": p.action, "side": p.side, "speed": p.speed,
             "colours": [p.left, p.right], "split": p.split}
            for i, n, p in zip(indices, frames, patterns, strict=True)]  # fmt: skip
    return made, {"clips": about}


def of_language() -> dict:
    """The words, and the table of the tasks, as JSON."""
    classes = {kind: language.words_of(kind) for kind in language.Meaning._fields}
    return {
        "tokens": language.TOKENS, "words": len(language.VOCABULARY), "classes": classes,
        "first_word": {other: word for word, other in language.SYNONYMS.items()},
        "wiring": {signal: vars(row) for signal, row in WIRING.items()},
    }  # fmt: skip


def of_motions(samples: Samples, scaling: Scaling) -> tuple[dict[str, bytes], dict]:
    """The mean motions of the 12 actions, by which a motion is read, and how far clips lie off."""
    motions = Motions(samples, scaling)
    tracks = np.stack(list(motions.tracks.values())).astype("<f4")
    about = {"motions": [list(name) for name in motions.tracks], "reach": motions.reach}
    return {"motions": tracks.tobytes()}, about

"""What the pages show of the policy that watches: film strips of corrected clips, and episodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ptae_lite.experiments import corrections
from ptae_lite.experiments.corrections import Acted
from ptae_lite.files import write_arrays
from ptae_lite.language import pattern, sentence
from ptae_lite.robot import motions

STRIPS = "corrected_strips.npz"
IMAGES = 5  # of a strip
LAST = 0.72  # of a clip: the stroke is over, and the hand goes home
FAR_M = 0.030  # a move that is seen in a small picture
KINDS = ("the named cube is moved", "both cubes are moved", "the hand is pushed")


def kind_of(sample: int, round_: int) -> str | None:
    """What a corrected clip is an example of; None if it is not shown."""
    which, what = corrections.disturbance_of(sample, round_)
    if what.places_m is None:
        return KINDS[2] if what.push_m is not None else None
    far = np.hypot(*(what.places_m - motions.draw(corrections.seed_of(sample, round_)).places_m).T)
    if what.push_m is not None or far[far > 0].min() < FAR_M:
        return None
    return {"named": KINDS[0], "both": KINDS[1]}.get(which)


def frames_shown(acted: Acted) -> np.ndarray:
    """Numbers of the frames of a strip: before and after what happened, then evenly spaced."""
    event, last = acted.episode.event, round(LAST * len(acted.planner.images))
    first = [] if event < 1 else [event - 1]
    rest = np.linspace(max(event + acted.disturbance.push_frames, 0), last, IMAGES - len(first))
    return np.array([*first, *rest.round().astype(int)])


def write_strips(path) -> None:
    """Store images of the first corrected clip of each kind, with a line of text each."""
    found = {}
    for sample, round_ in corrections.jobs_in("train"):
        kind = kind_of(sample, round_)
        if kind and kind not in found:
            acted = corrections.act_clip(sample, round_)
            shown = np.stack([acted.planner.images[t] for t in frames_shown(acted)])
            asked = pattern(sample // motions.VARIATIONS).meaning
            found[kind] = (shown, f"{sentence(asked)}: {kind}")
        if len(found) == len(KINDS):
            break
    videos, texts = zip(*(found[kind] for kind in KINDS), strict=True)
    write_arrays(path, strips=np.stack(videos), texts=np.array(texts))


def keep(folder) -> None:
    """Write the files that are missing in a folder."""
    strips = Path(folder) / STRIPS
    if not strips.exists():
        write_strips(strips)

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


def kind_of(acted: Acted) -> str | None:
    """What a clip is an example of; None if it is not shown."""
    pushed, far = acted.disturbance.push_m is not None, np.hypot(*acted.episode.shift_m.T)
    if acted.moved == "none":
        return KINDS[2] if pushed else None
    if pushed or far[far > 0].min(initial=1) < FAR_M:
        return None
    return {"named": KINDS[0], "both": KINDS[1]}.get(acted.moved)


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
        acted = corrections.act_clip(sample, round_)
        kind = kind_of(acted)
        if kind and kind not in found:
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

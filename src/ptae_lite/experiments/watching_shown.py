"""What the pages show of the policy that watches: film strips of corrected clips, and episodes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pandas as pd
from torch import nn

from ptae_lite import artefacts, vision
from ptae_lite.data.samples import Samples
from ptae_lite.experiments import corrections, disturbances, episodes, runner, watching
from ptae_lite.experiments.corrections import Acted
from ptae_lite.experiments.episodes import StoredEpisode
from ptae_lite.files import write_arrays
from ptae_lite.language import (
    ACTIONS,
    SIDES,
    SPEEDS,
    Meaning,
    Pattern,
    parse,
    pattern,
    sentence,
)
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import motions
from ptae_lite.robot.closed_loop import Setting
from ptae_lite.robot.disturbances import Disturbance

STRIPS, EPISODES = "corrected_strips.npz", "watching_episodes.npz"
ACTING = ("watching", "one_look_policy")
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


class Shown(NamedTuple):
    """A stored episode: who acted, and whether a cube was moved meanwhile."""

    model: str
    moved: bool
    kept: StoredEpisode


def move_of(
    stage: Setting, meaning: Meaning, number: int = 0, most: int = disturbances.DRAWS
) -> Disturbance | None:
    """How cubes are moved in a scene of `episodes.stages`: by a hard move if one is drawn.

    It is None if they cannot be moved, for lack of room.

    Args:
        meaning: of the sentence; it names the colour of a cube that is there.
        number: of the scene. Another number draws another move.
        most: draws; with one, the move is a random one.
    """
    side = SIDES[stage.colours.index(meaning.colour)]
    asked = Pattern(-1, meaning.action, side, meaning.speed, *stage.colours, "")
    scene = disturbances.Scene(number, asked, motions.middle(stage.places_m))
    row = disturbances.draw(scene, "moved", most)
    if row["reason"] == disturbances.NOT_FREE:
        return None
    return disturbances.disturbance_of(SimpleNamespace(condition="moved", **row))


def all_of(models: Mapping[str, Trained], encoder: nn.Module) -> list[Shown]:
    """What each model does in the first scene of `episodes.stages` with each sentence.

    The cubes stay in one episode, and are moved in another.
    """
    stage = next(iter(episodes.stages().values()))
    meanings = [Meaning(*one) for one in product(ACTIONS, stage.colours, SPEEDS)]
    moves = {meaning: move_of(stage, meaning) for meaning in meanings}
    return [
        Shown(model, moved, episodes.perform(
            trained, encoder, stage, sentence(meaning), meaning, moves[meaning] if moved else None))
        for model, trained in models.items() for moved in (True, False) for meaning in meanings
    ]  # fmt: skip


def write(path, shown: list[Shown]) -> None:
    """Store episodes in one file."""
    episodes.write(
        path, [one.kept for one in shown],
        model=np.array([one.model for one in shown]), moved=np.array([one.moved for one in shown]),
    )  # fmt: skip


def load(path=None) -> list[Shown]:
    """The episodes of a file; the stored ones if None is given."""
    path = path or artefacts.stored(f"results/{EPISODES}")
    with np.load(path, allow_pickle=False) as file:
        about = file["model"].tolist(), file["moved"].tolist()
    return [Shown(*one) for one in zip(*about, episodes.load(path), strict=True)]


def find(shown: list[Shown], model: str, moved: bool, instruction: str) -> StoredEpisode:
    """The episode of a model with this sentence or one of the same meaning."""
    return next(
        one.kept for one in shown
        if (one.model, one.moved) == (model, moved)
        and parse(one.kept.instruction) == parse(instruction)
    )  # fmt: skip


def told_rightly(table: pd.DataFrame) -> pd.Series:
    """Whether a model said of its own episode what it had been told to do.

    Args:
        table: a row an episode, with `sentence` and `described`.
    """
    pairs = zip(table["described"].fillna(""), table["sentence"], strict=True)
    return pd.Series(
        [len(said.split()) == 3 and parse(said) == parse(asked) for said, asked in pairs],
        index=table.index,
    )


def keep(folder, samples: Samples, weights, clips) -> None:
    """Write the files that are missing in a folder, each if it can be made.

    The episodes are those of `ACTING` with seed 0. Their models must be in the folder `weights`.

    Args:
        clips: the folder of corrected clips that they learned from.
    """
    strips, acted = Path(folder) / STRIPS, Path(folder) / EPISODES
    if not strips.exists():
        write_strips(strips)
    if acted.exists():
        return
    known = {
        name: runner.found(watching.experiment_of(samples, name, 0, "test", clips=clips), weights)
        for name in ACTING
    }
    if all(one is not None for one in known.values()):
        encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
        write(acted, all_of(known, encoder))

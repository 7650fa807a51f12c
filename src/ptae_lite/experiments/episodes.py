"""Episodes of the closed loop, stored for pages without a simulator.

Two files have an episode for each sentence about each of a few scenes: what the one-look policy
did, and what the paper's PTAE did. The third has rows of images of episodes in the table, three
that succeeded and three that failed.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from torch import nn

from ptae_lite import artefacts, vision
from ptae_lite.acting import Actor
from ptae_lite.data.samples import Samples
from ptae_lite.experiments import closed_loop as study
from ptae_lite.experiments import runner
from ptae_lite.files import write_arrays
from ptae_lite.language import ACTIONS, SIDES, SPEEDS, Meaning, parse, pattern, sentence
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import closed_loop, motions
from ptae_lite.robot.closed_loop import Episode, Setting, Verdict
from ptae_lite.robot.disturbances import Disturbance
from ptae_lite.watching_actor import actor_of

EPISODES, STRIPS = "closed_loop_episodes.npz", "closed_loop_strips.npz"
OF_PAPER = "closed_loop_ptae_episodes.npz"  # the same scenes and sentences, acted by "ptae"
FIRST_SEED = 10_000  # the seeds of the recording are smaller
CHOSEN = "one_look_policy"  # the simplest model that works in the loop
FRAMES_SHOWN = 5  # images of an episode
# Two arrangements of the data set, and one in which the colour families meet.
SCENES = (("red", "green"), ("cyan", "violet"), ("green", "yellow"))


class StoredEpisode(NamedTuple):
    """An episode with its instruction and its scene."""

    stage: Setting
    instruction: str
    episode: Episode
    verdict: Verdict


def stages() -> dict[str, Setting]:
    """The scenes by name. Places of the cubes are drawn as in a recording, from other seeds."""
    drawn = [motions.draw(FIRST_SEED + i) for i in range(len(SCENES))]
    return {
        f"{left} and {right}": Setting((left, right), place.places_m, place.yaws_rad)
        for (left, right), place in zip(SCENES, drawn, strict=True)
    }


def side_of(stage: Setting, meaning: Meaning) -> str | None:
    """The side of the named cube; None if no cube has its colour."""
    at = dict(zip(stage.colours, SIDES, strict=True))
    return at.get(meaning.colour)


def perform(
    trained: Trained, encoder: nn.Module, stage: Setting, instruction: str, meaning: Meaning,
    disturbance: Disturbance | None = None,
) -> StoredEpisode:  # fmt: skip
    """Act a sentence. If no cube has the named colour, it is not a success."""
    actor = actor_of(trained, encoder, instruction)
    episode = closed_loop.perform(stage, actor, disturbance=disturbance)
    side = side_of(stage, meaning)
    verdict = closed_loop.judge(episode, meaning.action, side or "left", meaning.speed)
    if side is None:
        verdict = verdict._replace(success=False, reason=study.NOT_THERE)
    return StoredEpisode(stage, instruction, episode, verdict)


def all_of(trained: Trained, encoder: nn.Module, progress=lambda jobs: jobs) -> list[StoredEpisode]:
    """Episodes of every action, cube and speed in each of the scenes."""
    jobs = [
        (stage, Meaning(action, colour, speed))
        for stage in stages().values()
        for action, colour, speed in product(ACTIONS, stage.colours, SPEEDS)
    ]
    return [perform(trained, encoder, stage, sentence(m), m) for stage, m in progress(jobs)]


def write(path, kept: list[StoredEpisode], **columns) -> None:
    """Store episodes in one file: joints in radians and cubes in metres, as float32.

    Args:
        columns: further arrays, with one value an episode.
    """
    write_arrays(
        path,
        instruction=np.array([one.instruction for one in kept]),
        scene=np.array([" and ".join(one.stage.colours) for one in kept]),
        stopped=np.array([one.episode.stopped for one in kept]),
        frames=np.array([len(one.episode.joints_rad) for one in kept]),
        joints_rad=np.concatenate([one.episode.joints_rad for one in kept]).astype(np.float32),
        cubes=np.concatenate([one.episode.cubes for one in kept]).astype(np.float32),
        event=np.array([one.episode.event for one in kept]),
        shift_m=np.array([one.episode.shift_m for one in kept]), **columns,
    )  # fmt: skip


def load(path=None) -> list[StoredEpisode]:
    """The episodes of a file; of the one-look policy if None is given."""
    path, scenes, kept = path or artefacts.stored(f"results/{EPISODES}"), stages(), []
    with np.load(path, allow_pickle=False) as file:
        found = {name: file[name] for name in file.files}
    ends = found["frames"].cumsum()[:-1]
    parts = (np.split(found[name].astype(float), ends) for name in ("joints_rad", "cubes"))
    texts = (found[name].tolist() for name in ("instruction", "scene", "stopped"))
    count = len(found["frames"])
    happened = found.get("event", [-1] * count), found.get("shift_m", np.zeros((count, 2, 2)))
    for instruction, scene, *acted in zip(*texts, *parts, *happened, strict=True):
        stage, meaning = scenes[scene], parse(instruction)
        stopped, joints, cubes, event, shift_m = acted
        episode = Episode(joints, cubes, stopped, int(event), shift_m)
        verdict = closed_loop.judge(episode, meaning.action, side_of(stage, meaning), meaning.speed)
        kept.append(StoredEpisode(stage, instruction, episode, verdict))
    return kept


def strips_of(table: pd.DataFrame, successes: str) -> pd.DataFrame:
    """Six rows of the table: a success of each action, and three failures.

    The successes are the first ones of the model `successes`. The failures are the first of each of
    the three most frequent reasons, over all models. There are fewer rows if the table lacks some.
    """
    own = table[table["condition"] == "test"]
    good = own[(own["model"] == successes) & (own["success"] == 1)]
    bad = own[own["success"] == 0]
    reasons = bad["reason"].value_counts().index[:3]
    rows = [good[good["action"] == action].head(1) for action in ACTIONS]
    rows += [bad[bad["reason"] == reason].head(1) for reason in reasons]
    return pd.concat(rows, ignore_index=True)


def video(trained: Trained, encoder: nn.Module, row) -> np.ndarray:
    """Act an episode of the table again with the camera on: a few images, evenly spaced in time."""
    images = []
    actor = Actor(trained, encoder, row.sentence)

    def watched(look, joints_rad):
        images.append(look())
        return actor(lambda: images[-1], joints_rad)

    closed_loop.perform(closed_loop.stage_of(pattern(row.pattern), row.variation), watched)
    return np.stack([images[i] for i in np.linspace(0, len(images) - 1, FRAMES_SHOWN).astype(int)])


def write_strips(path, rows: pd.DataFrame, models: list[Trained], encoder: nn.Module) -> None:
    """Store rows of images of episodes, with a line of text each.

    Args:
        rows: rows of the table.
        models: the model of each row.
    """
    videos = [video(one, encoder, row) for one, row in zip(models, rows.itertuples(), strict=True)]
    texts = [f"{row.model}: {row.sentence} ({row.reason})" for row in rows.itertuples()]
    write_arrays(path, strips=np.stack(videos), texts=np.array(texts))


def keep(folder, table: pd.DataFrame, samples: Samples, weights) -> None:
    """Write the three files into a folder, each if it is missing and can be made.

    The episodes are those of the models `CHOSEN` and "ptae" with seed 0. The rows of images are
    six rows of the table. Their models must be in the folder `weights`.
    """

    def model(name: str, seed: int) -> Trained | None:
        return runner.found(study.experiment_of(samples, name, int(seed)), weights)

    encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
    for file, name in ((EPISODES, CHOSEN), (OF_PAPER, "ptae")):
        acted = Path(folder) / file
        if not acted.exists() and (mine := model(name, 0)) is not None:
            write(acted, all_of(mine, encoder))
    strips = Path(folder) / STRIPS
    rows = strips_of(table, CHOSEN)
    if len(rows) == 6 and not strips.exists():
        models = [model(*one) for one in zip(rows["model"], rows["seed"], strict=True)]
        if all(one is not None for one in models):
            write_strips(strips, rows, models, encoder)

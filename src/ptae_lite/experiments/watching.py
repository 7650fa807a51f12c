"""Open eyes: a policy that corrects itself, beside those that do not. A row is one episode.

`MODELS` lists who acts: the policy that watches, its controls, the one-look policy, and two
planners. The conditions are those of the closed loop, and those in which something happens
meanwhile (`disturbances`).
"""

from __future__ import annotations

from argparse import ArgumentParser
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from torch import nn

from ptae_lite import artefacts, vision
from ptae_lite.acting import Actor
from ptae_lite.data import samples as data
from ptae_lite.data.samples import Samples
from ptae_lite.data.splits import SPLITS
from ptae_lite.experiments import disturbances, options, watching_scores
from ptae_lite.experiments.closed_loop import row_of
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.experiments.tasks import Task, tasks_of
from ptae_lite.experiments.watching_training import BASE, watching_training
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import arm, closed_loop, motions
from ptae_lite.robot.closed_loop import Episode
from ptae_lite.robot.corrections import Planner, UnawarePlanner
from ptae_lite.robot.disturbances import LOW_M
from ptae_lite.robot.scene import TABLE_TOP_M, pybullet
from ptae_lite.watching_actor import WatchingActor

KEY = ["model", "seed", "split", "condition"]
CLIPS = {"all": "", "without noise": "_no_noise", "without disturbances": "_no_disturbances"}
MODELS: dict[str, dict] = {
    "watching": {},
    "frozen": {},  # the same, and it is shown its first image at every frame
    "blind_on_clips": {"blind": True},
    "recorded_only": {"clips": None},
    "half": {"amount": 1 / 2},
    "quarter": {"amount": 1 / 4},
    "eighth": {"amount": 1 / 8},
    "moves_only": {"clips": "without noise"},
    "noise_only": {"clips": "without disturbances"},
    BASE: {},
}
PLANNERS = {"planner": Planner, "unaware": UnawarePlanner}  # nothing is learned
NOT_SCORED = (BASE, "frozen", *PLANNERS)
OF_LOOP = ("test", "displaced", "new_family", "swapped_speed", "synonyms")
CONDITIONS = (*OF_LOOP, *disturbances.CONDITIONS)
SHOWN = dict.fromkeys(MODELS, ("moved",)) | dict.fromkeys(("watching", BASE, *PLANNERS), CONDITIONS)


class Acted(NamedTuple):
    """An episode of this study.

    Args:
        described: what the model said of it afterwards; empty if it says nothing.
    """

    task: Task
    episode: Episode
    described: str = ""


def motion_of(task: Task) -> motions.Variation:
    """The planner's motion for a task: the recorded one in its own scene, else the middle one."""
    drawn = motions.draw(task.sample)
    own = np.array_equal(drawn.places_m, task.stage.places_m)
    return drawn if own else motions.middle(task.stage.places_m)


def act(model: str, trained: Trained | None, encoder: nn.Module, task: Task) -> Acted:
    """Act one episode."""
    if trained is None:
        policy = PLANNERS[model](task.asked, motion_of(task))
    elif model == BASE:
        policy = Actor(trained, encoder, task.instruction)
    else:
        policy = WatchingActor(trained, encoder, task.instruction, frozen=model == "frozen")
    episode = closed_loop.perform(task.stage, policy, disturbance=task.disturbance)
    tells = isinstance(policy, WatchingActor) and len(policy.looks) == len(policy.poses)
    return Acted(task, episode, policy.describe() if tells else "")


def row(acted: Acted) -> dict:
    """What the table says of an episode.

    `move` is how far the named cube was moved meanwhile. `hand` is where the hand came down, from
    where it would have come down for the cube where it was at first. Both are x and y.
    """
    task, episode = acted.task, acted.episode
    asked = task.asked
    verdict = closed_loop.judge(episode, asked.action, asked.side, asked.speed)
    move = 1000 * episode.shift_m[("left", "right").index(asked.side)]
    tips = arm.fingertip(episode.joints_rad)
    low = np.flatnonzero(tips[:, 2] < TABLE_TOP_M + LOW_M)
    low = low[low >= episode.event]
    start, _ = motions.stroke_start_m(asked, motion_of(task))
    hand = 1000 * (tips[low[0], :2] - start) if len(low) else (np.nan, np.nan)
    return row_of(task, episode, verdict) | {
        "move_mm_x": round(float(move[0]), 1), "move_mm_y": round(float(move[1]), 1),
        "hand_mm_x": round(float(hand[0]), 1), "hand_mm_y": round(float(hand[1]), 1),
        "described": acted.described,
    }  # fmt: skip


def score(trained: Trained | None, samples: Samples, model: str, seed: int, split: str,
          condition: str, *, table: Path) -> pd.DataFrame:  # fmt: skip
    """All episodes of one model under one condition, a row each.

    Args:
        table: the file `disturbances.csv`.
    """
    encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
    rows = []
    for task in tasks_of(samples, condition, split, table):
        head = {
            "model": model, "seed": seed, "split": split, "condition": condition,
            "pattern": task.asked.index, "variation": task.sample % motions.VARIATIONS,
        }  # fmt: skip
        rows.append(head | row(act(model, trained, encoder, task)))
    return pd.DataFrame(rows)


def experiment_of(samples: Samples, model: str, seed: int, split: str, *_,
                  clips: str) -> Experiment | None:  # fmt: skip
    """The training of a model; None for a planner. Held-out scenes are for models of `fit`."""
    if model in PLANNERS:
        return None
    own = dict(MODELS[model])
    kind = own.pop("clips", "all")
    folder = "" if kind is None else f"{clips}{CLIPS[kind]}"
    learned = "train" if split == "test" else "fit"
    if model == BASE:
        return watching_training(samples, model, seed, learned).base
    name = "watching" if model == "frozen" else f"watching_{model}"
    return watching_training(
        samples, "watching" if model == "watching" else name, seed, learned, folder, **own
    )


def study(samples: Samples, folder, weights, clips: str, models=tuple(MODELS), seeds=(0, 1, 2),
          conditions=None, split: str = "held_out", **where) -> pd.DataFrame:  # fmt: skip
    """Act the episodes that are missing in `watching.csv`; see `runner.run`.

    Scores of the trainings go to `watching_models.csv`, and the disturbances, which the planners
    choose before anyone else acts, to `disturbances.csv`.

    Args:
        clips: the folder of corrected clips. Those without noise and without disturbances are in
            folders beside it, see `CLIPS`.
        conditions: for all models; None for those in `SHOWN`.
        split: `held_out` for models that are trained on `fit`; `test` for the final ones.

    Raises:
        ConfigError: there is no such model, condition or split.
        RecordingError: there are no corrected clips.
        RobotError: PyBullet is not installed.
    """
    check_names(models, (*MODELS, *PLANNERS), "model")
    check_names(conditions or (), CONDITIONS, "condition")
    check_names([split], SPLITS, "split")
    pybullet()  # fail here, not after the trainings
    jobs = [
        (model, seed, split, condition)
        for seed in seeds for model in models for condition in conditions or SHOWN[model]
        if model not in PLANNERS or seed == seeds[0]
    ]  # fmt: skip
    wanted = [one for one in disturbances.CONDITIONS if one in {job[3] for job in jobs}]
    disturbances.study(folder, (split,), wanted, where.get("workers", 1))
    table = Path(folder).absolute() / disturbances.FILE
    known = partial(experiment_of, clips=str(Path(clips).absolute()))
    acting = Study("watching.csv", KEY, known, partial(score, table=table))
    made = run(acting, samples, jobs, folder, weights, **where)
    scored = [job for job in dict.fromkeys(job[:3] for job in jobs) if job[0] not in NOT_SCORED]
    scores = Study("watching_models.csv", KEY[:3], known, watching_scores.score)
    run(scores, samples, scored, folder, weights, **where)
    return made


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    options.trainings(parser)
    options.weights(parser, "build/weights")
    parser.add_argument("--clips", metavar="FOLDER", default="build/corrections",
                        help="of corrected clips")  # fmt: skip
    parser.add_argument("--models", nargs="+", metavar="NAME", default=(*MODELS, *PLANNERS),
                        help="who acts")  # fmt: skip
    parser.add_argument("--conditions", nargs="+", metavar="NAME",
                        help="which, of every model; else those that chapter 06 shows")  # fmt: skip
    parser.add_argument("--split", default="held_out", choices=("held_out", "test"),
                        help="whose scenes; settings are chosen on held_out")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    samples = data.load_samples()
    table = study(samples, given.out, given.weights, given.clips, given.models, given.seeds,
                  given.conditions, given.split, **options.where(given, "jobs"))  # fmt: skip
    if given.split == "test":
        from ptae_lite.experiments import watching_shown  # here, because it imports this module

        watching_shown.keep(given.out, samples, given.weights, given.clips)
    mine = table[table["split"] == given.split]
    rates = mine.groupby(["condition", "model", "seed"])["success"].agg(["mean", "size"])
    made = options.result(given, "watching.csv", table)
    for (condition, model, seed), rate in rates.iterrows():
        made[f"{condition}, {model}, seed {seed}"] = (
            f"{100 * rate['mean']:.1f} % of {rate['size']:.0f}"
        )
    return made

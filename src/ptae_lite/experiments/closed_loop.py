"""The closed loop: given a sentence, does the arm do it? A row of the table is one episode.

`MODELS` lists the models that act and how they differ, `tasks` the scenes and the sentences. Models
are trained on recorded training samples; two of them on other videos, too (`videos`).
"""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import replace

import numpy as np
import pandas as pd

from ptae_lite import artefacts, vision
from ptae_lite.acting import Actor
from ptae_lite.data import samples as data
from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.signals import Source
from ptae_lite.evaluation import evaluate, respond, sentences
from ptae_lite.experiments import options
from ptae_lite.experiments.experiment import Experiment, experiment
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.experiments.tasks import CONDITIONS, Task, tasks_of
from ptae_lite.models import ADAM
from ptae_lite.models.checkpoint import Trained
from ptae_lite.robot import closed_loop
from ptae_lite.robot.closed_loop import Episode, Verdict
from ptae_lite.robot.scene import pybullet

KEY = ["model", "seed", "condition"]
LOOP = {
    "pad_still_frame": False,
    "condition_on_code": True,
}  # the speed must come from the sentence, and the decoder gets the code at every step
MODELS: dict[str, dict] = {
    "ptae": {},  # as the paper trains it
    "ptae_first_frame": {"freeze_video": True},
    "ptae_no_padding": {"freeze_video": True, "pad_still_frame": False},
    "one_look_policy": LOOP | {"freeze_video": True},
    "watching_policy": LOOP,
    "noisy_video": LOOP,
    "dagger": LOOP,
}
VIDEOS = {
    "noisy_video": ("noisy", None),
    "dagger": ("own episodes", "watching_policy"),
}  # and the model that acts in them
NAMES = {"ptae": "PTAE, Adam"}  # of files of weights, as in the family
SHOWN = dict.fromkeys(MODELS, ("test", "displaced"))  # the conditions that chapter 06 shows
SHOWN |= {"ptae_first_frame": ("test",), "one_look_policy": tuple(CONDITIONS)}
FAST_FRAMES = MAX_FRAMES // 2  # of a recorded fast clip


REPLAY = "recorded joints"  # no model
BACK = "there_and_back"
NOT_THERE = "no such cube"  # whatever the arm did


def score(trained: Trained | None, samples: Samples, model: str, seed: int, condition: str,
          split: str = "test") -> pd.DataFrame:  # fmt: skip
    """All episodes of one model under one condition, a row each.

    Without a model, the recorded joints are replayed. Under `there_and_back`, the model then
    describes what it saw in its own episode.
    """
    tasks = tasks_of(samples, condition, split)
    encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
    rows, clips = [], []
    for task in tasks:
        asked = task.asked
        if trained is None:
            joints = samples.joints[task.sample, : samples.frames[task.sample]]
            replay = closed_loop.replay(joints)
            episode = closed_loop.perform(task.stage, replay, disturbance=task.disturbance)
        else:
            actor = Actor(trained, encoder, task.instruction, watch=condition == BACK)
            episode = closed_loop.perform(task.stage, actor, disturbance=task.disturbance)
            clips.append((task, actor.looks, episode.joints_rad))
        verdict = closed_loop.judge(episode, asked.action, asked.side, asked.speed)
        if condition == "absent_colour":
            verdict = verdict._replace(success=False, reason=NOT_THERE)
        head = {"model": model, "seed": seed, "condition": condition, "pattern": asked.index,
                "variation": int(samples.variation[task.sample])}  # fmt: skip
        rows.append(head | row_of(task, episode, verdict))
    table = pd.DataFrame(rows)
    if condition == BACK:
        table["described"] = describe(trained, samples, clips)
        table["described_held"] = describe(trained, samples, clips, with_rest=True)
    return table


def row_of(task: Task, episode: Episode, verdict: Verdict) -> dict:
    """What the table says of an episode. Distances are in millimetres, durations in frames."""
    moved = np.linalg.norm(episode.moved_mm, axis=1)
    return {
        "colours": " ".join(task.stage.colours), "sentence": task.instruction or "",
        "action": task.asked.action, "side": task.asked.side, "speed": task.asked.speed,
        "named_mm": round(verdict.named_mm, 1), "left_mm": round(float(moved[0]), 1),
        "right_mm": round(float(moved[1]), 1), "duration": verdict.frames,
        "success": int(verdict.success), "reason": verdict.reason,
    }  # fmt: skip


def describe(trained: Trained, samples: Samples, clips: list, with_rest: bool = False) -> list[str]:
    """What a model says of its own episodes: a sentence for each.

    Args:
        clips: task, features of each frame, and joints of each episode.
        with_rest: continue each clip with its last frame, up to the 50 or 100 frames of a recorded
            one.
    """
    frames = np.array([min(len(looks), MAX_FRAMES) for _, looks, _ in clips])
    features = np.zeros((len(clips), MAX_FRAMES, samples.features.shape[2]), dtype=np.float32)
    joints = np.zeros((len(clips), MAX_FRAMES, samples.joints.shape[2]), dtype=np.float32)
    for i, (_, looks, moved) in enumerate(clips):
        seen = frames[i]
        if with_rest:
            frames[i] = MAX_FRAMES if seen >= closed_loop.SLOW_FROM else max(seen, FAST_FRAMES)
        at = np.minimum(np.arange(frames[i]), seen - 1)
        features[i, : frames[i]], joints[i, : frames[i]] = np.array(looks)[at], moved[at]
    acted = replace(
        samples, features=features, joints=joints, frames=frames, cubes=None, touched=None,
        pattern=np.array([task.asked.index for task, *_ in clips]),
        variation=np.zeros(len(clips), dtype=int),
    )  # fmt: skip
    source = Source(trained.dataset(acted))
    return sentences(respond(trained, source, np.arange(len(clips)), "describe"))


def experiment_of(samples: Samples, model: str, seed: int, *_) -> Experiment | None:
    """The training of a model; None for the recorded joints, which are not learned."""
    if model == REPLAY:
        return None
    videos, base = VIDEOS.get(model, ("", None))
    return experiment(
        samples, "ptae", MODELS[model], ADAM["ptae"], seed, videos=videos,
        base=experiment_of(samples, base, seed) if base else None,
        name=NAMES.get(model, model),
    )  # fmt: skip


def score_model(trained: Trained, samples: Samples, model: str, seed: int) -> pd.DataFrame:
    """The scores of chapter 03 for a model of this study: a row of `closed_loop_models.csv`."""
    row = {"model": model, "seed": seed, "steps": trained.about["steps"]}
    scores = {name: round(value, 3) for name, value in evaluate(trained, samples).items()}
    return pd.DataFrame([row | scores])


EPISODES = Study("closed_loop.csv", KEY, experiment_of, score)
SCORES = Study("closed_loop_models.csv", KEY[:2], experiment_of, score_model)


def study(samples: Samples, folder, weights, models=tuple(MODELS), seeds=(0, 1, 2),
          conditions=None, **where) -> pd.DataFrame:  # fmt: skip
    """Act the episodes that are missing in `closed_loop.csv`; see `runner.run`.

    The scores of the models go to `closed_loop_models.csv`.

    Args:
        conditions: for all models; None for those in `SHOWN`.

    Raises:
        ConfigError: there is no such model or condition.
        RobotError: PyBullet is not installed.
    """
    check_names(models, MODELS, "model")
    check_names(conditions or (), CONDITIONS, "condition")
    pybullet()  # fail here, not after the trainings
    jobs = [
        (model, seed, condition)
        for seed in seeds for model in models for condition in conditions or SHOWN[model]
        if condition != "replay"
    ]  # fmt: skip
    replay = [(REPLAY, 0, "replay")] if "replay" in (conditions or CONDITIONS) else []
    table = run(EPISODES, samples, replay + jobs, folder, weights, **where)
    run(SCORES, samples, list(dict.fromkeys(job[:2] for job in jobs)), folder, weights, **where)
    return table


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    options.trainings(parser)
    options.weights(parser, "build/weights")
    parser.add_argument("--models", "--variants", nargs="+", metavar="NAME",
                        default=tuple(MODELS), help="which models")  # fmt: skip
    parser.add_argument("--conditions", nargs="+", metavar="NAME",
                        help="which, of every model; else those that chapter 06 shows")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    from ptae_lite.experiments import episodes  # here, because it imports this module

    samples = data.load_samples()
    table = study(samples, given.out, given.weights, given.models, given.seeds, given.conditions,
                  **options.where(given, "jobs"))  # fmt: skip
    episodes.keep(given.out, table, samples, given.weights)
    return options.result(given, EPISODES.file, table)

"""The closed loop: told a sentence, does the arm do it? An episode in, a row of a table out.

`MODELS` says who acts and how it was trained, `told` where and on what word. Models are
trained on recorded training samples. `aggregated` was trained on what it saw in its own episodes,
too, in scenes of the training samples, held against the recorded motion of that scene (data
aggregation, Ross et al. 2011, arXiv:1011.0686).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from ptae_lite import artefacts, vision
from ptae_lite.acting import Actor
from ptae_lite.data.samples import MAX_FRAMES, Samples
from ptae_lite.data.signals import STEPS, Source
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import evaluate, respond, sentences
from ptae_lite.experiments import family, tables
from ptae_lite.experiments.tasks import CONDITIONS, Task, tasks_of, told_in
from ptae_lite.models import checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.ptae import PTAEConfig
from ptae_lite.robot import closed_loop
from ptae_lite.robot.closed_loop import Episode, Verdict
from ptae_lite.robot.scene import pybullet
from ptae_lite.training import RECIPES, train

KEY = ["model", "seed", "condition"]
LOOP = {"padded": False, "reminded": True}  # the sentence must tell the speed, and is not forgotten
MODELS: dict[str, dict] = {
    "ptae": {},  # as the paper trains it
    "first frame": {"film": "first"},
    "no padding": {"film": "first", "padded": False},
    "blind": LOOP | {"film": "first"},
    "open eyes": LOOP,
    "noise": LOOP,  # on the features of the film
    "aggregated": LOOP,
}
OF_FAMILY = {"ptae": "PTAE", "first frame": "PTAE, first frame only"}  # the same trainings
SHOWN = dict.fromkeys(MODELS, ("test", "displaced"))  # what chapter 06 tells of a model
SHOWN |= {"first frame": ("test",), "blind": tuple(CONDITIONS)}
NOISE = 0.3  # spread of the noise, as a share of each feature's own over the training samples
FILMS = 2  # noisy ones for each sample
FAST_FRAMES = MAX_FRAMES // 2  # of a recorded fast clip


REPLAY = "recorded joints"  # the model that is none
BACK = "there_and_back"
NOT_THERE = "no such cube"  # whatever the arm did


def run_one(samples: Samples, weights: Path | None, model: str, seed: int, condition: str,
            split: str = "test") -> pd.DataFrame:  # fmt: skip
    """All episodes of one model under one condition: a row each.

    Without `weights` the recorded joints are replayed. There and back, the model then describes
    what it saw of its own act.
    """
    tasks = tasks_of(samples, condition, split)
    trained = None if weights is None else checkpoint.load(weights)
    eye = vision.load_eye(artefacts.stored("weights/cae.safetensors"))
    rows, clips = [], []
    for task in tasks:
        asked = task.asked
        if trained is None:
            joints = samples.joints[task.sample, : samples.frames[task.sample]]
            episode = closed_loop.perform(task.stage, closed_loop.replay(joints))
        else:
            actor = Actor(trained, eye, task.told, watch=condition == BACK)
            episode = closed_loop.perform(task.stage, actor)
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
        table["described_held"] = describe(trained, samples, clips, hold=True)
    return table


def row_of(task: Task, episode: Episode, verdict: Verdict) -> dict:
    """What the table says of an episode; ways in mm, durations in frames."""
    moved = 1000 * np.linalg.norm(episode.cubes[-1, :, :2] - episode.cubes[0, :, :2], axis=1)
    return {
        "colours": " ".join(task.stage.colours), "sentence": task.told or "",
        "action": task.asked.action, "side": task.asked.side, "speed": task.asked.speed,
        "named_mm": round(verdict.named_mm, 1), "left_mm": round(float(moved[0]), 1),
        "right_mm": round(float(moved[1]), 1), "duration": verdict.frames,
        "success": int(verdict.success), "reason": verdict.reason,
    }  # fmt: skip


def describe(trained: Trained, samples: Samples, clips: list, hold: bool = False) -> list[str]:
    """What a model says of its own acts: of (task, features of each frame, joints) a sentence.

    Args:
        hold: the camera goes on, while the arm rests, up to the 50 or 100 frames of a recorded
            clip.
    """
    frames = np.array([min(len(looks), MAX_FRAMES) for _, looks, _ in clips])
    features = np.zeros((len(clips), MAX_FRAMES, samples.features.shape[2]), dtype=np.float32)
    joints = np.zeros((len(clips), MAX_FRAMES, samples.joints.shape[2]), dtype=np.float32)
    for i, (_, looks, moved) in enumerate(clips):
        seen = frames[i]
        if hold:
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


def seen_in_own_episodes(trained: Trained, samples: Samples, indices) -> dict[int, np.ndarray]:
    """What the model's camera saw in its own episodes with samples: features (99, F) of each."""
    eye = vision.load_eye(artefacts.stored("weights/cae.safetensors"))
    films = {}
    for task in told_in(samples, indices):
        actor = Actor(trained, eye, task.told)
        closed_loop.perform(task.stage, actor, limit=int(samples.frames[task.sample]) + 1)
        seen = np.stack(actor.looks)[:STEPS]
        rest = np.repeat(seen[-1:], STEPS - len(seen), axis=0)
        films[task.sample] = np.concatenate([seen, rest])
    return films


def noisy_films(samples: Samples, indices, seed: int) -> dict[int, list[np.ndarray]]:
    """Recorded films with noise on the features, `FILMS` for each sample."""
    rng, films = np.random.default_rng([46, seed]), samples.features[:, :STEPS]
    spread = films[indices].std((0, 1))
    return {
        i: [films[i] + NOISE * spread * rng.standard_normal(films[i].shape) for _ in range(FILMS)]
        for i in map(int, indices)
    }


def make(samples: Samples, model: str, seed: int, split: str = "train",
         base: Trained | None = None) -> Trained:  # fmt: skip
    """Train one of `MODELS`. `base` is the `open eyes` model whose episodes `aggregated` takes."""
    if model not in MODELS:
        raise ConfigError(f"no model {model!r}; there are {', '.join(MODELS)}")
    indices = samples.split(split)
    films = None
    if model == "noise":
        films = noisy_films(samples, indices, seed)
    elif model == "aggregated":
        base = base or make(samples, "open eyes", seed, split)
        seen = seen_in_own_episodes(base, samples, indices[seed % 2 :: 2])
        films = {i: [film] for i, film in seen.items()}
    config = PTAEConfig(features=samples.features.shape[2], **MODELS[model])
    recipe = replace(RECIPES["ptae"], seed=seed)
    return train(samples, recipe, config=config, split=split, films=films)


def weights_of(folder, model: str, seed: int) -> Path:
    """Where a model of this study lies; one that the family has, too, where that leaves it."""
    return family.weights_of(folder, OF_FAMILY.get(model, f"PTAE, {model}"), seed)


def make_one(samples: Samples, folder, model: str, seed: int) -> None:
    base = None
    if model == "aggregated":
        base = checkpoint.load(weights_of(folder, "open eyes", seed))
    checkpoint.save(weights_of(folder, model, seed), make(samples, model, seed, base=base))


def score_one(samples: Samples, folder, model: str, seed: int) -> dict:
    """What chapter 03 measures, of a model of this study: the row of `closed_loop_models.csv`."""
    trained = checkpoint.load(weights_of(folder, model, seed))
    row = {"model": model, "seed": seed, "steps": trained.about["steps"]}
    return row | {name: round(value, 3) for name, value in evaluate(trained, samples).items()}


def study(samples: Samples, folder, weights, models=tuple(MODELS), seeds=(0, 1, 2),
          conditions=None, workers: int = 1,
          progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Train what is missing in the folder `weights`, then act out what is missing in
    `closed_loop.csv`; the episodes of a model under a condition are written when they are done.
    The joint errors of the models go to `closed_loop_models.csv`.

    Without `conditions`, which are for all models, each goes through those in `SHOWN`.
    """
    asked = ((models, MODELS, "model"), (conditions or (), CONDITIONS, "condition"))
    for names, there, what in asked:
        for name in names:
            if name not in there:
                raise ConfigError(f"no {what} {name!r}; there are {'; '.join(there)}")
    pybullet()  # fail here, not after the trainings
    table, scores = Path(folder) / "closed_loop.csv", Path(folder) / "closed_loop_models.csv"
    done, scored = tables.there(table, KEY), tables.there(scores, KEY[:2])
    wanted = [
        (model, seed, condition)
        for seed in seeds for model in models for condition in conditions or SHOWN[model]
        if condition != "replay" and (model, seed, condition) not in done
    ]  # fmt: skip
    actors = list(dict.fromkeys(job[:2] for job in wanted))
    later = [actor for actor in actors if actor[0] == "aggregated"]
    soon = [actor for actor in actors if actor not in later]

    def trainings(group) -> list[tuple]:
        missing = [actor for actor in group if not weights_of(weights, *actor).exists()]
        return [(make_one, samples, weights, *actor) for actor in missing]

    def trials(group) -> list[tuple]:
        unscored = [(score_one, samples, weights, *actor) for actor in group if actor not in scored]
        return unscored + [
            (run_one, samples, weights_of(weights, *job[:2]), *job)
            for job in wanted if job[:2] in group
        ]  # fmt: skip

    def keep(made) -> None:
        if isinstance(made, dict):
            tables.add(scores, pd.DataFrame([made]), KEY[:2])
        elif made is not None:
            tables.add(table, made, KEY)

    replay = "replay" in (conditions or CONDITIONS) and (REPLAY, 0, "replay") not in done
    replayed = [(run_one, samples, None, REPLAY, 0, "replay")] if replay else []
    bases = [("open eyes", seed) for _, seed in later]  # whose episodes `aggregated` takes
    for jobs in (
        trainings(dict.fromkeys([*soon, *bases])),
        [*trainings(later), *replayed, *trials(soon)],
        trials(later),
    ):
        tables.run(_do, jobs, keep, workers, progress)
    return pd.read_csv(table)


def _do(work, *arguments):
    return work(*arguments)

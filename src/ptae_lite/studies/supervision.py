"""Limited supervision: how good is a model when only a share of the samples has a label?

The labelled samples are a fixed list, drawn once; they alone serve describe and execute. The
others serve the repeat signals. (In the published script the list is of batch positions, and the
order is shuffled every epoch, so in the end every sample is used with its label.)
"""

from __future__ import annotations

import time
from pathlib import Path

import pandas as pd

from ptae_lite.dataset import Samples
from ptae_lite.evaluation import evaluate
from ptae_lite.training import Recipe, label, train

SHARES = (2, 10, 50, 100)  # percent of the 648 training samples


def run_one(samples: Samples, share: float, seed: int, recipe: Recipe, split=("train", "test")):
    """Train with a share of labels and score: (row of the table, trained model)."""
    begun = time.perf_counter()
    labelled = label(samples.split(split[0]), share, seed)
    trained = train(samples, recipe, split=split[0], labelled=labelled)
    steps = trained.about["steps"]
    supervised = recipe.supervised if share == 100 else 0.5
    row = {
        "model": "ptae", "data": "recording", "mode": "samples", "variant": "balanced",
        "share": share, "seed": seed, "labelled": len(labelled),
    } | {name: round(value, 3) for name, value in evaluate(trained, samples, split[1]).items()} | {
        "supervised_presentations": round(steps * recipe.batch * supervised), "steps": steps,
        "seconds": round(time.perf_counter() - begun),
    }  # fmt: skip
    return row, trained


def study(samples: Samples, path, shares=SHARES, seeds=(0,), recipe: Recipe | None = None,
          progress=lambda jobs: jobs) -> pd.DataFrame:  # fmt: skip
    """Run what is missing in the table at `path`, writing each row as it ends."""
    path = Path(path)
    table = pd.read_csv(path) if path.exists() else pd.DataFrame(columns=["share", "seed"])
    done = set(zip(table["share"], table["seed"], strict=True))
    jobs = [(share, seed) for seed in seeds for share in shares if (share, seed) not in done]
    for share, seed in progress(jobs):
        made = recipe or Recipe(seed=seed)
        row, _ = run_one(samples, share, seed, made)
        table = pd.concat([table, pd.DataFrame([row])], ignore_index=True)
        write(table, path)
    return table


def write(table: pd.DataFrame, path: Path) -> None:
    """Write a table whole or not at all, rows in order."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    table.sort_values(["share", "seed"]).to_csv(beside, index=False)
    beside.replace(path)

"""What PTAE reaches with each eye: the features of `experiments.encoders` in, its scores out.

Every training is the regular one, on the CPU; only the features differ. `device` is the eye's.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pandas as pd

from ptae_lite import artefacts
from ptae_lite.data.samples import Samples, with_features
from ptae_lite.errors import RecordingError
from ptae_lite.evaluation import evaluate
from ptae_lite.experiments import tables
from ptae_lite.experiments.encoders import CAES, PCAS, folder_of
from ptae_lite.training import RECIPES, train

KEY = ["eye", "seed", "presentations"]
NAME = "results/eyes_ptae.csv"


def jobs_in(work, seeds) -> list[tuple[str, int, int, Path]]:
    """Eye, seed, presentations and features of every training, a seed after the other.

    A CAE of a seed goes with a PTAE of that seed; a PCA, which knows no chance, with each.
    """
    found = []
    for seed in seeds:
        for name in (*CAES, *PCAS):
            folder = Path(work) / folder_of(name, seed if name in CAES else 0)
            paths = {int(p.stem.split("_")[1]): p for p in folder.glob("features_*.npz")}
            found += [(name, seed, length, paths[length]) for length in sorted(paths)]
    if not found:
        raise RecordingError(
            f"{work} holds no features of an eye; make them: python -m ptae_lite study eyes"
        )
    return found


def run_one(samples: Samples, eye: str, seed: int, presentations: int, features: Path) -> dict:
    """Train PTAE on what an eye sees and score it on the test samples."""
    weights = features.with_name(f"eye_{presentations}.safetensors")
    device = artefacts.load_weights(weights)[1].get("device", "cpu")
    begun, seen = time.perf_counter(), with_features(samples, features)
    trained = train(seen, replace(RECIPES["ptae"], seed=seed))
    row = {"eye": eye, "seed": seed, "presentations": presentations, "device": device,
           "steps": trained.about["steps"],
           "seconds": round(time.perf_counter() - begun)}  # fmt: skip
    return row | {name: round(v, 3) for name, v in evaluate(trained, seen).items()}


def stored() -> pd.DataFrame:
    """The stored table; one without rows as long as `data/` has none."""
    if NAME in artefacts.manifest():
        return pd.read_csv(artefacts.stored(NAME))
    return pd.DataFrame(columns=[*KEY, "describe_accuracy", "execute_nrmse"])


def study(samples: Samples, folder, work, seeds=(0, 1, 2), workers: int = 1,
          progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Run what is missing in `eyes_ptae.csv`, writing each row as its training ends.

    Args:
        folder: of the table.
        work: the folder of the eyes' features, as `experiments.encoders` leaves it.
        workers: trainings side by side.
    """
    jobs, table = jobs_in(work, seeds), Path(folder) / "eyes_ptae.csv"
    done = tables.there(table, KEY)
    todo = [(samples, *job) for job in jobs if job[:3] not in done]

    def keep(row: dict) -> None:
        tables.add(table, pd.DataFrame([row]), KEY)

    tables.run(run_one, todo, keep, workers, progress)
    return pd.read_csv(table)

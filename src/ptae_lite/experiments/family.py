"""The family: PTAE, the models before it, and what each of PTAE's choices is worth.

Every row of `family.csv` is one training on all training samples, scored on the test samples.
`CLAIMS` says which rows test which sentence of the paper. Curves of describe accuracy by updates
and by seconds of computing go to `family_curves.csv`.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.baselines import references
from ptae_lite.controls import execute_errors
from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Source
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import correct, evaluate, new_scenes, respond
from ptae_lite.experiments import tables
from ptae_lite.models import MODELS, checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.training import RECIPES, Recipe, train


class Variant(NamedTuple):
    """What is trained: a model, and how its configuration and recipe differ from the regular."""

    model: str
    choices: dict = {}
    recipe: dict = {}


VARIANTS = {
    "PTAE": Variant("ptae"),
    "PGAE": Variant("pgae"),
    "PVAE": Variant("pvae"),
    "PTAE, action asks": Variant("ptae", {"queries": "action"}),
    "PTAE, repeat both": Variant("ptae", {"repeat_both": True}),
    "PGAE, no repeat both": Variant("pgae", {"repeat_both": False}),
    "PTAE, words weighed": Variant("ptae", {"weigh_words": True}),
    "PTAE, LSTM encoders": Variant("ptae", {"language_encoder": "lstm", "action_encoder": "lstm"}),
    "PTAE, first frame only": Variant("ptae", {"film": "first"}),
    "PTAE, clock": Variant("ptae", {"clock": True}),
    "PTAE, no blends": Variant("ptae", recipe={"mixup": False}),
    "PRAE": Variant("prae"),
    "PTAE, long": Variant("ptae", recipe={"epochs": 8 * RECIPES["ptae"].epochs}),
    "PGAE, long": Variant("pgae", recipe={"epochs": 8 * RECIPES["pgae"].epochs}),
}
REGULAR = tuple(name for name in VARIANTS if "long" not in name)  # those take half an hour each
# Sentences of the paper, and the two rows that each is about: what it says is better, and worse.
CLAIMS = {
    "language as query is better than action": ("PTAE", "PTAE, action asks"),
    "repeat both helps PGAE": ("PGAE", "PGAE, no repeat both"),
    "repeat both does not help PTAE": ("PTAE", "PTAE, repeat both"),
    "word weights are unnecessary for PTAE": ("PTAE", "PTAE, words weighed"),
    "LSTM encoders change nothing": ("PTAE", "PTAE, LSTM encoders"),
}  # that PTAE converges in less than half of PGAE's updates is a matter of `updates_to`
KEY = ["data", "variant", "seed"]
SEEDS = 3  # of each variant, before two are compared
EVERY = 5  # epochs between two points of a curve


def run_one(samples: Samples, variant: str, seed: int, recipe: Recipe | None = None, weights=None):
    """Train one variant: its row and its curve. `weights` is a folder for the model, or None."""
    model, choices, changes = VARIANTS[variant]
    config = MODELS[model].config(features=samples.features.shape[2], **choices)
    recipe = replace(recipe or RECIPES[model], seed=seed, **changes)
    test, points, looking = samples.split("test"), [], 0.0
    begun = time.process_time()

    def look(epoch: int, trained: Trained) -> None:
        nonlocal looking
        if epoch % EVERY and epoch != recipe.epochs:
            return
        stopped = time.process_time()
        right = correct(respond(trained, source_of(trained), test, "describe"), samples, test)
        points.append({
            "variant": variant, "seed": seed, "epoch": epoch,
            "updates": epoch * trained.about["steps"] // recipe.epochs,
            "seconds": round(stopped - begun - looking, 1),
            "describe_accuracy": round(100 * float(right.mean()), 3),
        })  # fmt: skip
        looking += time.process_time() - stopped

    sources: list[Source] = []

    def source_of(trained: Trained) -> Source:
        if not sources:
            sources.append(Source(trained.dataset(samples)))
        return sources[0]

    trained = train(samples, recipe, model=model, config=config, on_epoch=look)
    seconds = time.process_time() - begun - looking
    row = {
        "data": samples.name, "variant": variant, "model": model, "seed": seed,
        "parameters": sum(p.numel() for p in trained.model.parameters()),
        "steps": trained.about["steps"], "batch": recipe.batch, "seconds": round(seconds, 1),
    }  # fmt: skip
    scored = evaluate(trained, samples)
    scored |= {
        f"execute_{name.replace(' ', '_')}": paper
        for name, (paper, _) in execute_errors(trained, samples).items() if name != "as trained"
    }  # fmt: skip
    scored |= {  # what little knowledge gives, on these data
        f"reference_{name.replace(' ', '_')}": paper
        for name, (paper, _) in references(samples, trained.scaling).items()
    }
    new = new_scenes(samples)
    right = correct(respond(trained, source_of(trained), test, "describe"), samples, test)
    for name, part in {"new": right[new], "known": right[~new]}.items():
        if len(part):
            scored[f"describe_accuracy_{name}_scenes"] = 100 * float(part.mean())
    row |= {name: round(value, 3) for name, value in scored.items()}
    if weights is not None:
        checkpoint.save(weights_of(weights, variant, seed), trained)
    return row, pd.DataFrame(points).assign(data=row["data"])


def weights_of(folder, variant: str, seed: int) -> Path:
    """Where a model of this study lies."""
    name = variant.lower().replace(", ", "_").replace(" ", "_")
    return Path(folder) / f"{name}_seed{seed}.safetensors"


def study(samples: Samples, folder, variants=REGULAR, seeds=(0, 1, 2), weights=None,
          workers: int = 1, progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Run what is missing in `family.csv`, seed by seed, writing each row as its training ends.

    Args:
        folder: of the tables.
        weights: a folder for the trained models, NAME_seedN.safetensors; none are kept if None.
        workers: trainings side by side.
    """
    for variant in variants:
        if variant not in VARIANTS:
            raise ConfigError(f"no variant {variant!r}; there are {'; '.join(VARIANTS)}")
    table, curves = Path(folder) / "family.csv", Path(folder) / "family_curves.csv"
    done, name = tables.there(table, KEY), samples.name
    wanted = [(variant, seed) for seed in seeds for variant in variants]
    jobs = [(samples, v, s, None, weights) for v, s in wanted if (name, v, s) not in done]

    def keep(result) -> None:
        row, points = result
        tables.add(curves, points, KEY, [*KEY, "epoch"])
        tables.add(table, pd.DataFrame([row]), KEY)

    tables.run(run_one, jobs, keep, workers, progress)
    return pd.read_csv(table)


def summary(table: pd.DataFrame, columns) -> pd.DataFrame:
    """Each variant's median of some columns over the seeds, with the smallest and the largest."""

    def written(values: pd.Series) -> str:
        if len(values) == 1:
            return f"{values.iloc[0]:.1f} (one seed)"
        return f"{values.median():.1f} ({values.min():.1f} to {values.max():.1f})"

    return table.groupby("variant", sort=False)[list(columns)].agg(written)


def clearly_better(table: pd.DataFrame, one: str, other: str, column: str) -> str:
    """The variant that is better in `column` with every seed than the other with any; or `neither`.

    Of two equal variants with three seeds each, one comes out better by chance once in ten times;
    with fewer than `SEEDS` for either, the answer is `too few trainings`.
    """
    sign = 1 if column.endswith("accuracy") else -1
    scores = [sign * table[table["variant"] == name][column] for name in (one, other)]
    if min(map(len, scores)) < SEEDS:
        return "too few trainings"
    if scores[0].min() > scores[1].max():
        return one
    return other if scores[1].min() > scores[0].max() else "neither"


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """For each of `CLAIMS`, which of its two variants is clearly better, in four measures."""
    columns = ("describe_accuracy", "repeat_language_accuracy", "execute_nrmse",
               "repeat_action_nrmse")  # fmt: skip
    rows = [
        {"claim": claim, "rows": " / ".join(pair)}
        | {column: clearly_better(table, *pair, column) for column in columns}
        for claim, pair in CLAIMS.items()
    ]
    return pd.DataFrame(rows)


def updates_to(curves: pd.DataFrame, percent: float) -> pd.DataFrame:
    """Updates and seconds after which a training first described `percent` right, and stayed."""
    rows = []
    for (variant, seed), curve in curves.groupby(["variant", "seed"], sort=False):
        below = np.flatnonzero(curve["describe_accuracy"].to_numpy() < percent)
        first = 0 if not len(below) else below[-1] + 1
        at = curve.iloc[first] if first < len(curve) else None
        rows.append({
            "variant": variant, "seed": seed,
            "updates": np.nan if at is None else at["updates"],
            "seconds": np.nan if at is None else at["seconds"],
        })  # fmt: skip
    return pd.DataFrame(rows)

"""The study of incongruence as a table: each model under each condition, and who is followed.

Three models are compared, each with several seeds:

- `ptae`: the regular one;
- `ptae_two_way`: words ask the frames and frames ask the words, which the paper's discussion
  proposes as a remedy of the asymmetry; twice the epochs, or it repeats no language reliably;
- `ptae_congruent`: the regular one, but half of its training samples, of all signals, have a true
  extra input. So the format of a conflict is nothing new to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Source
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.evaluation import correct, nrmse, poses
from ptae_lite.experiments import answer_source, tables
from ptae_lite.experiments.incongruence import (
    ANSWERS_WORDS,
    EXTRA_INPUT,
    Condition,
    conditions,
    extra_inputs,
    respond_under,
)  # fmt: skip
from ptae_lite.models import checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.models.ptae import PTAEConfig
from ptae_lite.training import RECIPES, Recipe, train

FILE = "incongruence.csv"
ALL = [condition for signal in EXTRA_INPUT for condition in conditions(signal)]
TRAINING = ["data", "model", "seed"]
KEY = [*TRAINING, "signal", "conflict_in", "conflicts", "aspects"]


class Variant(NamedTuple):
    """How a model and its training differ from the regular ones."""

    choices: dict = {}
    recipe: dict = {}


MODELS = {
    "ptae": Variant(),
    "ptae_two_way": Variant({"queries": "both"}, {"epochs": 160}),
    "ptae_congruent": Variant(recipe={"extra": 0.5}),
}


def score(
    trained: Trained, source: Source, indices, condition: Condition, seed: int,
    motions: answer_source.Motions,
) -> dict:  # fmt: skip
    """Accuracy, or NRMSE by the paper's definition and over valid frames; and who is followed.

    `nearest_truth` is the share of motions that are nearest to the true mean, at any distance.
    """
    samples, signal = source.dataset.samples, condition.signal
    extra = extra_inputs(samples, indices, condition, seed)
    answer = respond_under(trained, source, indices, condition, extra=extra)
    truth = [answer_source.truth_of(samples, i, signal) for i in indices.tolist()]
    distractor = [
        answer_source.distractor_of(samples, i, one, condition)
        for i, one in zip(indices.tolist(), extra, strict=True)
    ]
    told = answer_source.told_by(answer, samples, indices, signal, motions)
    columns = dict.fromkeys(("accuracy", "nrmse", "nrmse_valid", "nearest_truth"), float("nan"))
    if signal in ANSWERS_WORDS:
        columns["accuracy"] = 100 * float(correct(answer, samples, indices).mean())
    else:
        error = nrmse(poses(answer, trained.scaling), samples, indices, trained.scaling)
        columns["nrmse"], columns["nrmse_valid"] = error
        nearest = [what == true for (what, _), true in zip(told, truth, strict=True)]
        columns["nearest_truth"] = 100 * float(np.mean(nearest))
    return columns | answer_source.shares(
        answer_source.within(told, motions.reach), truth, distractor
    )


def run(
    trained: Trained, samples: Samples, seed: int = 0, split: str = "test",
    wanted: Sequence[Condition] = ALL,
) -> pd.DataFrame:  # fmt: skip
    """One model under all conditions, or some; `seed` is that of the draws."""
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    motions = answer_source.Motions(samples, trained.scaling)
    rows = []
    for condition in wanted:
        signal, place, aspects = condition
        row = {"signal": signal, "conflict_in": place, "conflicts": len(aspects),
               "aspects": " ".join(aspects)}  # fmt: skip
        rows.append(row | score(trained, source, indices, condition, seed, motions))
    return pd.DataFrame(rows)


def model_of(samples: Samples, name: str, seed: int, weights=None, recipe: Recipe | None = None):
    """A trained model: that of the folder `weights`, if it is there; else trained, and kept there.

    Raises `ArtefactError` where the file is another training than the one asked for.
    """
    choices, changes = MODELS[name]
    config = PTAEConfig(features=samples.features.shape[2], **choices)
    recipe = replace(recipe or RECIPES["ptae"], seed=seed, **changes)
    path = None if weights is None else Path(weights) / f"{name}_seed{seed}.safetensors"
    if path is None or not path.exists():
        trained = train(samples, recipe, config=config)
        if path is not None:
            checkpoint.save(path, trained)
        return trained
    trained = checkpoint.load(path)
    was = trained.about["recipe"]
    found = {"queries": trained.about["config"].get("queries", "language"),
             "extra": was.get("extra", 0.0), "epochs": was["epochs"],
             "seed": was["seed"]}  # fmt: skip
    asked = {"queries": config.queries, "extra": recipe.extra, "epochs": recipe.epochs,
             "seed": seed}  # fmt: skip
    if found != asked:
        raise ArtefactError(f"{path} was trained with {found}, not with {asked}; move it away")
    return trained


def run_one(samples: Samples, name: str, seed: int, weights=None) -> pd.DataFrame:
    """The rows of one model, which is trained first if it is not there; see `study`."""
    rows = run(model_of(samples, name, seed, weights), samples, seed)
    which = pd.DataFrame({"data": samples.name, "model": name, "seed": seed}, index=rows.index)
    return pd.concat([which, rows.round(3)], axis=1)


def study(samples: Samples, folder, models=tuple(MODELS), seeds=(0, 1, 2), weights=None,
          workers: int = 1, progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Run what is missing in `incongruence.csv`, writing the rows of a model when all are there.

    Args:
        folder: of the table.
        weights: a folder of trained models, NAME_seedN.safetensors: what is there is not trained
            again, what is missing is put there; none are looked for or kept if None.
        workers: models side by side.
    """
    for name in models:
        if name not in MODELS:
            raise ConfigError(f"no model {name!r} in this study; there are {', '.join(MODELS)}")
    table = Path(folder) / FILE
    done = tables.there(table, TRAINING)
    jobs = [(samples, name, seed, weights) for seed in seeds for name in models
            if (samples.name, name, seed) not in done]  # fmt: skip
    tables.run(run_one, jobs, lambda rows: tables.add(table, rows, KEY), workers, progress)
    return read(table)


def read(path) -> pd.DataFrame:
    """The table; an empty text in its file would read as a gap."""
    return pd.read_csv(path).fillna({"aspects": ""})


def costs(table: pd.DataFrame) -> pd.DataFrame:
    """For each model, seed and signal what the conflict's format costs, and what three conflicts.

    `format`: from the regular input to the congruent one; `conflict`: from there to three
    conflicts. In points of accuracy lost, or of NRMSE added.
    """
    rows = []
    for (model, seed, signal), part in table.groupby(["model", "seed", "signal"], sort=False):
        words = signal in ANSWERS_WORDS
        score = part.set_index(["conflict_in", "conflicts"])["accuracy" if words else "nrmse"]
        sign = -1 if words else 1
        calm, own = score["none", 0].item(), score["congruent", 0].item()
        full = score[EXTRA_INPUT[signal], 3].item()
        rows.append({"model": model, "seed": seed, "signal": signal,
                     "format": sign * (own - calm), "conflict": sign * (full - own)})  # fmt: skip
    return pd.DataFrame(rows)

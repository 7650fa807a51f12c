"""The study of incongruence as a table: each model under each condition, and who is followed.

Three models are compared, each with several seeds:

- `ptae`: the regular one;
- `ptae_two_way`: words ask the frames and frames ask the words, which the paper's discussion
  proposes as a remedy of the asymmetry; twice the epochs, or it repeats no language reliably;
- `ptae_congruent`: the regular one, but half of its training samples, of all signals, have a true
  extra input. So the format of a conflict is nothing new to it.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.cli import data_options
from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Source
from ptae_lite.evaluation import correct, nrmse, poses
from ptae_lite.experiments import answer_source, options
from ptae_lite.experiments.experiment import Experiment, experiment
from ptae_lite.experiments.incongruence import (
    ANSWERS_WORDS,
    EXTRA_INPUT,
    Condition,
    conditions,
    extra_inputs,
    respond_under,
)  # fmt: skip
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.models.checkpoint import Trained

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
    "ptae_congruent": Variant(recipe={"p_congruent_input": 0.5}),
}


def asked_under(
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
    decoded = answer_source.decoded_answers(answer, samples, indices, signal, motions)
    columns = dict.fromkeys(("accuracy", "nrmse", "nrmse_valid", "nearest_truth"), float("nan"))
    if signal in ANSWERS_WORDS:
        columns["accuracy"] = 100 * float(correct(answer, samples, indices).mean())
    else:
        error = nrmse(poses(answer, trained.scaling), samples, indices, trained.scaling)
        columns["nrmse"], columns["nrmse_valid"] = error
        nearest = [what == true for (what, _), true in zip(decoded, truth, strict=True)]
        columns["nearest_truth"] = 100 * float(np.mean(nearest))
    return columns | answer_source.shares(
        answer_source.within(decoded, motions.reach), truth, distractor
    )


def rows_of(
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
        rows.append(row | asked_under(trained, source, indices, condition, seed, motions))
    return pd.DataFrame(rows)


def experiment_of(samples: Samples, data: str, model: str, seed: int) -> Experiment:
    """The training of a model."""
    return experiment(samples, "ptae", *MODELS[model], seed, name=model)


def score(trained: Trained, samples: Samples, data: str, model: str, seed: int) -> pd.DataFrame:
    """The rows of one model."""
    rows = rows_of(trained, samples, seed)
    which = pd.DataFrame({"data": data, "model": model, "seed": seed}, index=rows.index)
    return pd.concat([which, rows.round(3)], axis=1)


STUDY = Study(FILE, TRAINING, experiment_of, score, order=KEY)


def study(samples: Samples, folder, models=tuple(MODELS), seeds=(0, 1, 2), weights=None,
          **where) -> pd.DataFrame:  # fmt: skip
    """Every model of a seed before the next seed; see `runner.run`."""
    check_names(models, MODELS, "model")
    jobs = [(samples.name, name, seed) for seed in seeds for name in models]
    run(STUDY, samples, jobs, folder, weights, **where)
    return read(Path(folder) / FILE)


def read(path) -> pd.DataFrame:
    """The table; an empty text in its file would read as a gap."""
    return pd.read_csv(path).fillna({"aspects": ""})


def damage(table: pd.DataFrame) -> pd.DataFrame:
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


def add_options(parser: ArgumentParser) -> None:
    data_options(parser)
    options.trainings(parser)
    options.weights(parser)
    parser.add_argument("--models", "--variants", nargs="+", metavar="NAME",
                        default=tuple(MODELS), help="which models")  # fmt: skip


def command(given) -> dict:
    samples = options.samples(given)
    table = study(samples, given.out, given.models, given.seeds, given.weights,
                  **options.where(given, "models"))  # fmt: skip
    return options.result(given, FILE, table, samples)

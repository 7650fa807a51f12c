"""The study of incongruence: each model under each condition, and what its answers follow.

Three models are compared, each with several seeds:

- `ptae`: the regular one;
- `ptae_two_way`: words query the frames and frames query the words. The paper's discussion proposes
  this against the asymmetry;
- `ptae_congruent`: half of its training samples, of all signals, have a true extra input. So it
  knows the format of a conflict.

Those that end in `_adam` are the same, trained with Adam alone. The two-way one then has twice the
epochs: with fewer it repeats no language reliably.
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
from ptae_lite.models import ADAM
from ptae_lite.models.checkpoint import Trained

FILE = "incongruence.csv"
ALL = [condition for signal in EXTRA_INPUT for condition in conditions(signal)]
TRAINING = ["data", "model", "seed"]
KEY = [*TRAINING, "signal", "conflict_in", "conflicts", "aspects"]


class Variant(NamedTuple):
    """How a model and its training differ from the regular ones.

    Args:
        choices: settings of its configuration.
        recipe: settings of its recipe.
    """

    choices: dict = {}
    recipe: dict = {}


TWO_WAY, CONGRUENT = {"queries": "both"}, {"p_congruent_input": 0.5}
MODELS = {
    "ptae": Variant(),
    "ptae_two_way": Variant(TWO_WAY),
    "ptae_congruent": Variant(recipe=CONGRUENT),
    "ptae_adam": Variant(recipe=ADAM["ptae"]),
    "ptae_two_way_adam": Variant(TWO_WAY, ADAM["ptae"] | {"epochs": 160}),
    "ptae_congruent_adam": Variant(recipe=ADAM["ptae"] | CONGRUENT),
}
NAMES = {"ptae_adam": "ptae, Adam"}  # of files of weights, as in the family


def asked_under(
    trained: Trained, source: Source, indices, condition: Condition, seed: int,
    motions: answer_source.Motions,
) -> dict:  # fmt: skip
    """The scores of a model under one condition, and what its answers follow.

    `accuracy` is percent. `nrmse` is by the paper's definition, `nrmse_valid` over valid frames.
    `nearest_truth` is the percentage of motions whose nearest mean motion is the true one, at any
    distance. The others are those of `answer_source.shares`.
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
    """One model under the `wanted` conditions, a row each. `seed` is the seed of the draws."""
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
    return experiment(samples, "ptae", *MODELS[model], seed, name=NAMES.get(model, model))


def score(trained: Trained, samples: Samples, data: str, model: str, seed: int) -> pd.DataFrame:
    """The rows of one model."""
    rows = rows_of(trained, samples, seed)
    which = pd.DataFrame({"data": data, "model": model, "seed": seed}, index=rows.index)
    return pd.concat([which, rows.round(3)], axis=1)


STUDY = Study(FILE, TRAINING, experiment_of, score, order=KEY)


def study(samples: Samples, folder, models=tuple(MODELS), seeds=(0, 1, 2), weights=None,
          **where) -> pd.DataFrame:  # fmt: skip
    """Run every model with one seed, then with the next; see `runner.run`."""
    check_names(models, MODELS, "model")
    jobs = [(samples.name, name, seed) for seed in seeds for name in models]
    run(STUDY, samples, jobs, folder, weights, **where)
    return read(Path(folder) / FILE)


def read(path, data: str = "recording") -> pd.DataFrame:
    """The rows of one data set. Empty texts, which a file gives as missing values, are empty again.

    Args:
        data: `recording` or `authors`.
    """
    table = pd.read_csv(path).fillna({"aspects": ""})
    return table[table["data"] == data].copy()


def damage(table: pd.DataFrame) -> pd.DataFrame:
    """The harm of the conflict's format and of three conflicts, for each model, seed and signal.

    `format` is the change from the regular to the congruent input, and `conflict` from there to
    three conflicts. Both are points of accuracy lost, or points of NRMSE added.
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
    """Add the options of the study."""
    data_options(parser)
    options.trainings(parser)
    options.weights(parser)
    parser.add_argument("--models", "--variants", nargs="+", metavar="NAME",
                        default=tuple(MODELS), help="which models")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    samples = options.samples(given)
    table = study(samples, given.out, given.models, given.seeds, given.weights,
                  **options.where(given, "models"))  # fmt: skip
    return options.result(given, FILE, table, samples)

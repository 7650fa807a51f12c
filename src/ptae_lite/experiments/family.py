"""The family: PTAE, the models before it, and how much each of PTAE's choices matters.

A row of `family.csv` is one training on all training samples, scored on the test samples. `CLAIMS`
says which rows test which sentence of the paper. `family_curves.csv` has describe accuracy during
the trainings, by updates and by seconds of computing.
"""

from __future__ import annotations

from argparse import ArgumentParser
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.baselines import references
from ptae_lite.cli import data_options
from ptae_lite.controls import execute_errors
from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Source
from ptae_lite.evaluation import accuracy_by_scenes, correct, evaluate, respond
from ptae_lite.experiments import options
from ptae_lite.experiments.experiment import Experiment, experiment
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.models import ADAM
from ptae_lite.models.checkpoint import Trained


class Variant(NamedTuple):
    """What is trained: a model, and how it differs from the regular one.

    Args:
        choices: settings of its configuration.
        recipe: settings of its recipe.
    """

    model: str
    choices: dict = {}
    recipe: dict = {}


VARIANTS = {
    "PTAE": Variant("ptae"),
    "PGAE": Variant("pgae"),
    "PVAE": Variant("pvae"),
    "PTAE, action as query": Variant("ptae", {"queries": "action"}),
    "PTAE, repeat both": Variant("ptae", {"repeat_both": True}),
    "PGAE, no repeat both": Variant("pgae", {"repeat_both": False}),
    "PTAE, class-weighted words": Variant("ptae", {"weigh_words": True}),
    "PTAE, LSTM encoders": Variant("ptae", {"language_encoder": "lstm", "action_encoder": "lstm"}),
    "PTAE, frozen video": Variant("ptae", {"freeze_video": True}),
    "PTAE, frame positions": Variant("ptae", {"frame_positions": True}),
    "PTAE, no mixup": Variant("ptae", recipe={"mixup": False}),
    "PRAE": Variant("prae"),
} | {f"{name.upper()}, Adam": Variant(name, recipe=ADAM[name]) for name in ADAM}
CORE = ("PTAE", "PGAE", "PVAE", "PTAE, Adam")  # the models that chapters 03 to 07 ask
CHOICES = tuple(name for name in VARIANTS if not name.endswith("Adam"))  # all have Muon
# Sentences of the paper, and the two variants that each compares. Of the first two sentences, the
# first variant is the one that the paper calls better.
CLAIMS = {
    "language as query is better than action": ("PTAE", "PTAE, action as query"),
    "repeat both helps PGAE": ("PGAE", "PGAE, no repeat both"),
    "repeat both does not help PTAE": ("PTAE", "PTAE, repeat both"),
    "word weights are unnecessary for PTAE": ("PTAE", "PTAE, class-weighted words"),
    "LSTM encoders change nothing": ("PTAE", "PTAE, LSTM encoders"),
}  # `updates_to` is about the claim that PTAE converges in less than half of PGAE's updates
KEY = ["data", "variant", "seed"]
SEEDS = 3  # of each variant, before two are compared
EVERY = 5  # epochs between two points of a curve


def experiment_of(samples: Samples, data: str, variant: str, seed: int) -> Experiment:
    """The training of a row."""
    return experiment(samples, *VARIANTS[variant], seed, name=variant)


def watch(trained: Trained, samples: Samples, epoch: int, split: str = "test") -> dict | None:
    """A point of a curve, after every `EVERY` epochs and after the last."""
    epochs = trained.about["recipe"]["epochs"]
    if epoch % EVERY and epoch != epochs:
        return None
    return {
        "epoch": epoch, "updates": epoch * trained.about["steps"] // epochs,
        "describe_accuracy": round(100 * float(described(trained, samples, split).mean()), 3),
    }  # fmt: skip


def described(trained: Trained, samples: Samples, split: str = "test"):
    """Which samples of a split are described correctly."""
    asked = samples.split(split)
    answer = respond(trained, Source(trained.dataset(samples)), asked, "describe")
    return correct(answer, samples, asked)


def score(trained: Trained, samples: Samples, data: str, variant: str, seed: int) -> dict:
    """A row of `family.csv`, and the curve of the training."""
    model, _, _ = VARIANTS[variant]
    about = trained.about
    row = {
        "data": data, "variant": variant, "model": model, "seed": seed,
        "parameters": sum(p.numel() for p in trained.model.parameters()),
        "steps": about["steps"], "batch": about["recipe"]["batch"], "seconds": about["seconds"],
    }  # fmt: skip
    scored = evaluate(trained, samples)
    scored |= {
        f"execute_{name.replace(' ', '_')}": paper
        for name, (paper, _) in execute_errors(trained, samples).items() if name != "as trained"
    }  # fmt: skip
    scored |= {  # the references of `baselines`, on these data
        f"reference_{name.replace(' ', '_')}": paper
        for name, (paper, _) in references(samples, trained.scaling).items()
    }
    scored |= accuracy_by_scenes(described(trained, samples), samples)
    row |= {name: round(value, 3) for name, value in scored.items()}
    curve = pd.DataFrame(about["watched"], columns=POINT)
    curve = curve.assign(variant=variant, seed=seed, data=data)
    return {"family.csv": pd.DataFrame([row]), "family_curves.csv": curve[CURVE]}


POINT = ["epoch", "updates", "seconds", "describe_accuracy"]
CURVE = ["variant", "seed", *POINT, "data"]
STUDY = Study("family.csv", KEY, experiment_of, score,
              companions={"family_curves.csv": [*KEY, "epoch"]}, watch=watch)  # fmt: skip


def study(samples: Samples, folder, variants=tuple(VARIANTS), seeds=(0, 1, 2), weights=None,
          **where) -> pd.DataFrame:  # fmt: skip
    """Run every variant with one seed, then with the next; see `runner.run`."""
    check_names(variants, VARIANTS, "variant")
    jobs = [(samples.name, variant, seed) for seed in seeds for variant in variants]
    return run(STUDY, samples, jobs, folder, weights, **where)


def summary(table: pd.DataFrame, columns, digits: int = 1) -> pd.DataFrame:
    """Each variant's median of some columns over the seeds, with the lowest and the highest."""

    def written(values: pd.Series) -> str:
        if len(values) == 1:
            return f"{values.iloc[0]:.{digits}f} (one seed)"
        found = values.min(), values.median(), values.max()
        low, middle, high = (f"{value:.{digits}f}" for value in found)
        if low == high:
            return f"{middle}\u00a0(all)"
        return f"{middle}\u00a0({low}\u00a0to\u00a0{high})"  # not broken across lines

    return table.groupby("variant", sort=False)[list(columns)].agg(written)


def clearly_better(table: pd.DataFrame, one: str, other: str, column: str) -> str:
    """The variant that is better in `column`: its worst seed is better than the other's best.

    The answer is `neither` if there is none, and `too few trainings` if one variant has less than
    `SEEDS` seeds. If two variants with three seeds each are equally good, one of them looks better
    in this sense once in ten times.
    """
    sign = 1 if column.endswith("accuracy") else -1
    scores = [sign * table[table["variant"] == name][column] for name in (one, other)]
    if min(map(len, scores)) < SEEDS:
        return "too few trainings"
    if scores[0].min() > scores[1].max():
        return one
    return other if scores[1].min() > scores[0].max() else "neither"


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """For each of `CLAIMS`: which of its two variants is clearly better, in four scores."""
    columns = ("describe_accuracy", "repeat_language_accuracy", "execute_nrmse",
               "repeat_action_nrmse")  # fmt: skip
    rows = [
        {"claim": claim, "rows": " / ".join(pair)}
        | {column: clearly_better(table, *pair, column) for column in columns}
        for claim, pair in CLAIMS.items()
    ]
    return pd.DataFrame(rows)


def updates_to(curves: pd.DataFrame, percent: float) -> pd.DataFrame:
    """Updates and seconds after which a training stays at `percent` describe accuracy or more.

    NaN if it never does.
    """
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


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    data_options(parser)
    options.trainings(parser)
    options.weights(parser)
    every = tuple(VARIANTS)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--variants", nargs="+", metavar="NAME", default=every, help="which")
    which.add_argument("--core", dest="variants", action="store_const", const=CORE,
                       help="only the models that the chapters ask")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    samples = options.samples(given)
    table = study(samples, given.out, given.variants, given.seeds, given.weights,
                  **options.where(given))  # fmt: skip
    return options.result(given, STUDY.file, table, samples)

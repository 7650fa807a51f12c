"""The search for the regular recipes, scored on held-out training patterns, never on the test.

A row of `recipes.csv` is one training on the split `fit`: of a model's regular recipe, or of one
that differs from it in one choice, with all labels, with a tenth of them, or with labels in few
iterations. With the same seed and share, all choices have the same labelled samples.
"""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import pandas as pd

from ptae_lite.cli import data_options
from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import family, options, supervision
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.experiments.supervision_grid import SHARES, Job
from ptae_lite.models import ADAM, MODELS
from ptae_lite.models.checkpoint import Trained
from ptae_lite.recipe import Recipe

ALL, TENTH = 100, 10  # percent of the samples that have a label
FEW = (10, 2)  # percent of the iterations that use one


class Choice(NamedTuple):
    """A recipe to compare with the regular one.

    Args:
        says: what it changes, in words.
        changes: the settings of the recipe that it changes, by model; PTAE, or all.
        shares: with which shares of labels PTAE is tried; the other models only with all.
        iterations: with which shares of supervised iterations models that have signals are tried.
    """

    says: str
    changes: dict[str, dict]
    shares: tuple[float, ...] = (ALL, TENTH)
    iterations: tuple[float, ...] = ()


TRAINED = ("ptae", "pgae", "pvae")
RATE = Recipe().muon_lr


def _with(changes: dict, *models: str) -> dict[str, dict]:
    """The same changes for these models, or for all."""
    return dict.fromkeys(models or TRAINED, changes)


def _times(factor: float, *models: str) -> dict[str, dict]:
    """So many times the epochs."""
    return {name: {"epochs": int(factor * MODELS[name].recipe.epochs)} for name in models}


CHOICES = {
    "regular": Choice("the regular recipe", _with({}), iterations=FEW),
    "adam": Choice("Adam alone, with the rates that were best for it", ADAM, iterations=FEW),
    "no-decay": Choice("no weight decay", _with({"muon_decay": 0.0}, "ptae", "pgae"),
                       iterations=FEW),
    "slow": Choice("half of Muon's learning rate",
                   _with({"muon_lr": RATE / 2}, "ptae", "pgae"), (ALL,)),
    "fast": Choice("twice Muon's learning rate",
                   _with({"muon_lr": RATE * 2}, "ptae", "pgae"), (ALL,)),
    "short": Choice("half the epochs", _times(1 / 2, "ptae")),
    "long": Choice("twice the epochs", _times(2, "ptae", "pgae"), (ALL,)),
    "no-mixup": Choice("no mixup of clips", _with({"mixup": False}, "ptae", "pgae")),
    "one-learning-rate": Choice("the action decoder no faster than the rest",
                                _with({"action_lr_scale": 1.0}, "ptae"), (ALL,)),
    "balanced": Choice("half of each batch has a label", _with({"balanced": True}, "ptae"),
                       (TENTH,)),
}  # fmt: skip
SEEDS = (0, 1)  # of every choice; the regular recipes have five
KEY = ["data", "model", "mode", "share", "choice", "seed"]


def grid(seeds=SEEDS, models=TRAINED, choices=tuple(CHOICES), shares=(ALL, *FEW),
         modes=("samples", "iterations")) -> list[tuple]:  # fmt: skip
    """The rows to make, as values of the columns `KEY` after the first, seed by seed.

    Raises:
        ConfigError: no such model, choice or mode, or no training is of all that was asked.
    """
    check_names(models, TRAINED, "model")
    check_names(choices, CHOICES, "choice")
    check_names(modes, SHARES, "mode")
    found = [
        (model, mode, float(share), choice, seed)
        for seed in seeds for model in models for choice in choices for mode in modes
        for share in shares
        if model in CHOICES[choice].changes and share in _shares(model, mode, CHOICES[choice])
    ]  # fmt: skip
    if not found:
        asked = ", ".join(map(str, (*models, *modes, *choices, *shares)))
        raise ConfigError(f"no training is of {asked} together; leave one of them out")
    return found


def _shares(model: str, mode: str, choice: Choice) -> tuple[float, ...]:
    """The shares with which a model is tried."""
    if mode == "iterations":
        return () if model == "pvae" else choice.iterations
    return tuple(share for share in choice.shares if model == "ptae" or share == ALL)


def job_of(model: str, mode: str, share: float, seed: int) -> Job:
    """The job of the study of supervision; every choice trains it with another recipe."""
    return Job(model, mode, "paper", share, seed)


def recipe_of(model: str, choice: str) -> Recipe:
    """The recipe of a row."""
    return replace(MODELS[model].recipe, **CHOICES[choice].changes[model])


def experiment_of(samples: Samples, data: str, model: str, mode: str, share: float, choice: str,
                  seed: int) -> Experiment:  # fmt: skip
    """The training of a row."""
    job = job_of(model, mode, share, seed)
    return supervision.experiment_of(samples, job, recipe_of(model, choice), split="fit")


def score(trained: Trained, samples: Samples, data: str, model: str, mode: str, share: float,
          choice: str, seed: int) -> pd.DataFrame:  # fmt: skip
    """A row: the scores of the study of supervision, on held-out patterns.

    `seconds_to_all` are those of training until it describes all of them, and goes on doing so;
    NaN if it never does.
    """
    job = job_of(model, mode, share, seed)
    found = supervision.score(trained, samples, job, split="fit")
    row = found[supervision.FILE].iloc[:1].assign(choice=choice)
    curve = pd.DataFrame(trained.about["watched"]).assign(variant=choice, seed=seed)
    row["seconds_to_all"] = family.updates_to(curve, 100)["seconds"].item()
    dropped = (*KEY, "variant")
    return row[KEY + [column for column in row if column not in dropped]]


STUDY = Study("recipes.csv", KEY, experiment_of, score,
              watch=partial(family.watch, split="held_out"))  # fmt: skip


def study(samples: Samples, folder, jobs: list[tuple] | None = None, **where) -> pd.DataFrame:
    """Make the rows of `jobs` (all of `grid` if None); see `runner.run`."""
    rows = [(samples.name, *job) for job in (grid() if jobs is None else jobs)]
    return run(STUDY, samples, rows, folder, **where)


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    data_options(parser)
    options.trainings(parser, SEEDS)
    parser.add_argument("--models", nargs="+", metavar="NAME", default=TRAINED, help="which models")
    parser.add_argument("--variants", nargs="+", metavar="NAME", default=tuple(CHOICES),
                        help="which choices")  # fmt: skip
    parser.add_argument("--modes", nargs="+", metavar="NAME", default=("samples", "iterations"),
                        help="samples, iterations")  # fmt: skip
    parser.add_argument("--shares", type=float, nargs="+", metavar="PERCENT",
                        choices=(ALL, *FEW), default=(ALL, *FEW),
                        help="of the samples that have a label, or of the iterations that use one: "
                             "100, 10, 2")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    samples = options.samples(given)
    jobs = grid(given.seeds, given.models, given.variants, given.shares, given.modes)
    table = study(samples, given.out, jobs, **options.where(given))
    return options.result(given, STUDY.file, table, samples)

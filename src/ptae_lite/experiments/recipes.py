"""Which recipe is best with few labels? Scored on held-out training patterns, never on the test.

PTAE with a tenth of the labels is trained on the split `fit`: by the recipe of
`experiments.supervision`, and by others that differ from it in one choice. With the same seed, all
of them have the same labelled samples.
"""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import replace
from typing import NamedTuple

import pandas as pd

from ptae_lite.cli import data_options
from ptae_lite.data.samples import Samples
from ptae_lite.experiments import options, supervision
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.experiments.supervision_grid import Job
from ptae_lite.models.checkpoint import Trained

SHARE = 10  # percent of the samples that have a label: of 552, 56
REGULAR = supervision.recipe_of("ptae")


class Choice(NamedTuple):
    """A recipe to compare.

    Args:
        says: what it changes, in words.
        changes: the settings of the recipe that it changes.
    """

    says: str
    changes: dict


CHOICES = {
    "regular": Choice("the recipe of the study", {}),
    "once": Choice("each sample once an epoch, labelled or not", {"balanced": False}),
    "short": Choice("half the epochs", {"epochs": REGULAR.epochs // 2}),
    "long": Choice("twice the epochs", {"epochs": REGULAR.epochs * 2}),
    "slow": Choice("half the learning rate", {"learning_rate": REGULAR.learning_rate / 2}),
    "fast": Choice("twice the learning rate", {"learning_rate": REGULAR.learning_rate * 2}),
    "no-mixup": Choice("no mixup of clips", {"mixup": False}),
    "one-learning-rate": Choice(
        "the action decoder no faster than the rest", {"action_lr_scale": 1.0}
    ),
}
KEY = ["data", "choice", "seed"]


def job_of(seed: int) -> Job:
    """The job of the study of supervision; every choice trains it with another recipe."""
    return Job("ptae", "samples", "balanced", SHARE, seed)


def experiment_of(samples: Samples, data: str, choice: str, seed: int) -> Experiment:
    """The training of a row."""
    recipe = replace(REGULAR, **CHOICES[choice].changes)
    return supervision.experiment_of(samples, job_of(seed), recipe, split="fit")


def score(trained: Trained, samples: Samples, data: str, choice: str, seed: int) -> pd.DataFrame:
    """A row: the scores of the study of supervision, on held-out patterns."""
    row = supervision.score(trained, samples, job_of(seed), split="fit")[supervision.FILE]
    row["choice"] = choice
    dropped = (*KEY, "model", "mode", "variant", "share")
    return row[KEY + [column for column in row if column not in dropped]]


STUDY = Study("recipes.csv", KEY, experiment_of, score)


def study(samples: Samples, folder, choices=tuple(CHOICES), seeds=(0, 1),
          **where) -> pd.DataFrame:  # fmt: skip
    """Run every choice with one seed, then with the next; see `runner.run`."""
    check_names(choices, CHOICES, "choice")
    jobs = [(samples.name, choice, seed) for seed in seeds for choice in choices]
    return run(STUDY, samples, jobs, folder, **where)


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    data_options(parser)
    options.trainings(parser, seeds=(0, 1))
    parser.add_argument("--variants", nargs="+", metavar="NAME", default=tuple(CHOICES),
                        help="which choices")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    samples = options.samples(given)
    table = study(samples, given.out, given.variants, given.seeds, **options.where(given))
    return options.result(given, STUDY.file, table, samples)

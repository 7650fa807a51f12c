"""Which recipe serves few labels best? Scored on held-out training patterns, never on the test.

PTAE with a tenth of the labels is trained on the patterns of the split `fit`, by the recipe of
`experiments.supervision` and by others that differ from it in one choice. With one seed all of them
have the same labelled samples.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from ptae_lite.data.samples import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import supervision, tables
from ptae_lite.experiments.supervision import Job
from ptae_lite.training import RECIPES

SHARE = 10  # percent of the samples that have a label: of 552, 56
REGULAR = RECIPES["ptae"]


class Choice(NamedTuple):
    """What is asked of a recipe, and the numbers that it changes."""

    says: str
    changes: dict


CHOICES = {
    "regular": Choice("the recipe of the study", {}),
    "once": Choice("each sample once an epoch, labelled or not", {"balanced": False}),
    "short": Choice("half the epochs", {"epochs": REGULAR.epochs // 2}),
    "long": Choice("twice the epochs", {"epochs": REGULAR.epochs * 2}),
    "slow": Choice("half the learning rate", {"learning_rate": REGULAR.learning_rate / 2}),
    "fast": Choice("twice the learning rate", {"learning_rate": REGULAR.learning_rate * 2}),
    "unblended": Choice("no blends of clips", {"mixup": False}),
    "one-pace": Choice("the action decoder no faster than the rest", {"action_pace": 1.0}),
}
KEY = ["data", "choice", "seed"]


def run_one(samples: Samples, choice: str, seed: int) -> pd.DataFrame:
    """One training: its row."""
    job = Job("ptae", "samples", "balanced", SHARE, seed)
    recipe = replace(REGULAR, **CHOICES[choice].changes)
    row, _ = supervision.run_one(samples, job, recipe, split="fit")
    row["choice"] = choice
    dropped = (*KEY, "model", "mode", "variant", "share")
    return row[KEY + [column for column in row if column not in dropped]]


def study(samples: Samples, folder, choices=tuple(CHOICES), seeds=(0, 1), workers: int = 1,
          progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Run what is missing in `recipes.csv`, seed by seed, writing each row as its training ends.

    Args:
        folder: of the table.
        choices: which of `CHOICES`.
        workers: trainings side by side.
    """
    for choice in choices:
        if choice not in CHOICES:
            raise ConfigError(f"no choice {choice!r}; there are {', '.join(CHOICES)}")
    table = Path(folder) / "recipes.csv"
    done = tables.there(table, KEY)
    todo = [
        (samples, choice, seed) for seed in seeds for choice in choices
        if (samples.name, choice, seed) not in done
    ]  # fmt: skip
    tables.run(run_one, todo, lambda row: tables.add(table, row, KEY), workers, progress)
    return pd.read_csv(table)

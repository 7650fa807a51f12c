"""Limited supervision: how good is a model when only a share of the samples has a label?

The labelled samples are a fixed list, drawn once; they alone serve describe and execute. The
others serve the repeat signals. (In the published script the list is of batch positions, and the
order is shuffled every epoch, so in the end every sample is used with its label.)
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from ptae_lite.dataset import Samples
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import correct, evaluate, respond, sentences, word_accuracy
from ptae_lite.language import patterns, sentence
from ptae_lite.models.checkpoint import Trained
from ptae_lite.signals import Source
from ptae_lite.studies import tables
from ptae_lite.training import Recipe, label, train

SHARES = (2, 10, 50, 100)  # percent of the 648 training samples
KEY = ["share", "seed"]
SHOWN = 6  # test clips whose descriptions are kept


def run_one(samples: Samples, share: float, seed: int, recipe: Recipe, split: str = "train"):
    """Train with a share of labels: the table's row for it, without scores, and the model."""
    begun = time.perf_counter()
    labelled = label(samples.split(split), share, seed)
    trained = train(samples, recipe, split=split, labelled=labelled)
    steps = trained.about["steps"]
    everything = len(labelled) == len(samples.split(split))  # then the training is the regular one
    supervised = recipe.supervised if everything else 0.5
    row = {
        "model": "ptae", "data": samples.name, "mode": "samples", "variant": "balanced",
        "share": share, "seed": seed, "labelled": len(labelled), "steps": steps,
        "supervised_presentations": round(steps * recipe.batch * supervised),
        "seconds": round(time.perf_counter() - begun),
    }  # fmt: skip
    return row, trained


def scores(trained: Trained, samples: Samples, split: str = "test") -> dict[str, float]:
    """What the table says of a model: the numbers of `evaluate`, and describe by word class."""
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    words = word_accuracy(respond(trained, source, indices, "describe"), samples, indices)
    return {k: round(v, 3) for k, v in (evaluate(trained, samples, split) | words).items()}


def examples(trained: Trained, samples: Samples, share: float, seed: int) -> pd.DataFrame:
    """Descriptions of a few test clips, evenly spread over the test set."""
    source, test = Source(trained.dataset(samples)), samples.split("test")
    chosen = test[np.linspace(0, len(test) - 1, SHOWN).round().astype(int)]
    answer = respond(trained, source, chosen, "describe")
    meanings = [patterns()[i].meaning for i in samples.pattern[chosen]]
    return pd.DataFrame({
        "share": share, "seed": seed, "sample": chosen,
        "truth": [sentence(meaning) for meaning in meanings],
        "said": sentences(answer), "right": correct(answer, samples, chosen),
    })  # fmt: skip


def study(samples: Samples, folder, shares=SHARES, seeds=(0,), recipe: Recipe | None = None,
          progress=lambda jobs: jobs) -> pd.DataFrame:  # fmt: skip
    """Run what is missing in `supervision.csv`, writing the row and its sentences as each ends."""
    recipe = recipe or Recipe()
    for share in shares:
        label(samples.split("train"), share, 0)  # refuse a wrong one before the first training
    table, said = Path(folder) / "supervision.csv", Path(folder) / "supervision_sentences.csv"
    rows = tables.read(table, ["data", *KEY])
    if set(rows["data"]) - {samples.name}:
        raise ConfigError(f"{table} is of another data set; choose another folder with --out")
    done = tables.there(table, KEY)
    jobs = [(share, seed) for seed in seeds for share in shares if (share, seed) not in done]
    for share, seed in progress(jobs):
        row, trained = run_one(samples, share, seed, replace(recipe, seed=seed))
        tables.add(said, examples(trained, samples, share, seed), KEY)
        tables.add(table, pd.DataFrame([row | scores(trained, samples)]), KEY)
    return pd.read_csv(table)

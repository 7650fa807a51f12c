"""Limited supervision: how good is a model when few updates, or few samples, have a label?

Two experiments of the paper. *Iterations*: every sample has a label, but only a share of the
updates uses one. *Samples*: the labelled samples are a fixed list, drawn anew with each seed; they
alone serve the signals that need a label, and the others serve the repeat signals. (In the
published script the list is of batch positions, and the order is shuffled every epoch, so in the
end every sample is used with its label.)

A row of `supervision.csv` is one training, or one draw of labels for the linear baseline, scored
on the test samples. `supervision_sentences.csv` keeps what a model says of a few test clips.
"""

from __future__ import annotations

import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Source
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import correct, evaluate, respond, sentences, word_accuracy
from ptae_lite.experiments import tables
from ptae_lite.experiments.labels import cover, linear_scores
from ptae_lite.language import patterns, sentence
from ptae_lite.models.checkpoint import Trained
from ptae_lite.training import RECIPES, Recipe, label, train

SHARES = {  # percent: of the 648 training samples, and of the updates
    "samples": (1, 2, 5, 10, 20, 50, 66.6, 100),
    "iterations": (1, 2, 10, 20, 50, 66.6),
}
REGULAR = {"samples": 100, "iterations": 66.6}  # one training: chapter 03's
ORDER = (10, 2, 50, 20, 5, 1, 66.6, 100)  # a part of the grid spans all of it
DRAWS = 20  # of labels for the linear baseline, which takes no time
SEEDS = (0, 1, 2)
KEY = ["model", "data", "mode", "variant", "share", "seed"]
SHOWN = 6  # test clips whose descriptions are kept


class Variant(NamedTuple):
    """How labelled samples are chosen and shown."""

    recipe: dict = {}
    covering: bool = False  # they name every word
    times: int = 1  # as many epochs


VARIANTS = {
    # each sample once an epoch, as in the paper: the share of updates is the share of samples
    "paper": Variant({"balanced": False}),
    "balanced": Variant(),  # half of every batch has a label
    "unpaired": Variant({"unpaired": True}),  # and a sentence to repeat comes with another's scene
    "covering": Variant(covering=True),  # balanced, too
    "long": Variant({"balanced": False}, times=8),  # as `paper`
}


class Job(NamedTuple):
    """One row to be made; two of the regular training."""

    model: str
    mode: str
    variant: str
    share: float
    seed: int

    @property
    def regular(self) -> bool:
        """Are all labels used, and as often as in chapter 03? There are no variants of that."""
        return self.share == REGULAR[self.mode]


def grid(seeds=None, core: bool = False) -> list[Job]:
    """Every job of the study, in order.

    First what takes no time, with all its draws whatever the seeds; then seed by seed what the
    figures need, then the variants, which are left out of the `core`.
    """
    found = [
        Job("linear", "samples", variant, share, seed)
        for variant in ("random", "covering") for share in SHARES["samples"][:-1]
        for seed in range(DRAWS)
    ]  # fmt: skip
    found += [Job("linear", "samples", "random", 100, 0)]  # of all labels there is one draw

    def more(model, mode, variant, seed, *shares):
        found.extend(Job(model, mode, variant, s, seed) for s in ORDER if s in shares)

    seeds = seeds or SEEDS
    for seed in seeds:
        for model in ("ptae", "pgae"):
            more(model, "samples", "balanced", seed, *SHARES["samples"])
            more(model, "iterations", "paper", seed, *SHARES["iterations"])
        more("pvae", "samples", "balanced", seed, 2, 10, 20, 50, 100)
    for model in () if core else ("ptae", "pgae"):
        for seed in seeds:
            more(model, "iterations", "long", seed, 1, 2)
            more(model, "samples", "long", seed, 1, 2)
            more(model, "samples", "covering", seed, 1, 2, 5)
            more(model, "samples", "unpaired", seed, 2, 10, 50)
            more(model, "samples", "paper", seed, *SHARES["samples"])
    return list(dict.fromkeys(map(_once, found)))


def _once(job: Job) -> Job:
    """The job itself; the regular training under one name."""
    if job.model == "linear" or not job.regular:
        return job
    return job._replace(mode="samples", variant="paper", share=REGULAR["samples"])


def _names(job: Job) -> list[Job]:
    """A job as its rows are named: the regular training has two, but of PVAE."""
    if not job.regular or job.model in ("linear", "pvae"):
        return [job]
    return [job, job._replace(mode="iterations", share=REGULAR["iterations"])]


def select(jobs: list[Job], **asked) -> list[Job]:
    """The jobs that have one of the asked values (`None`: any) in each of these fields.

    Raises:
        ConfigError: no job has such a value, or none has all of them together.
    """
    named = [(job, name) for job in jobs for name in _names(job)]
    for field, values in asked.items():
        there = sorted({getattr(name, field) for _, name in named})
        for value in values or ():
            if value not in there:
                raise ConfigError(f"no {field} {value!r}; there are {', '.join(map(str, there))}")
    found = [
        job for job, name in named
        if all(values is None or getattr(name, field) in values for field, values in asked.items())
    ]  # fmt: skip
    if not found:
        chosen = ", ".join(f"{field} {' '.join(map(str, v))}" for field, v in asked.items() if v)
        raise ConfigError(f"no training is of {chosen} together; leave one of them out")
    return list(dict.fromkeys(found))


def run_one(samples: Samples, job: Job, recipe: Recipe | None = None, split: str = "train"):
    """Train and score one job: its rows, and its sentences (none of the linear baseline).

    Args:
        recipe: the model's own if None.
        split: `fit` while settings are chosen; the scores are then of `held_out`.
    """
    scored, begun = "test" if split == "train" else "held_out", time.process_time()
    row = job._asdict() | {"data": samples.name, "share": float(job.share)}
    versions = f"torch {version('torch')}, numpy {version('numpy')}"
    if job.model == "linear":
        chosen = labelled(samples, job, split)
        row |= {"labelled": len(chosen)} | linear_scores(samples, chosen, scored)
        row |= {"seconds": round(time.process_time() - begun, 1), "versions": versions}
        return pd.DataFrame([row]), pd.DataFrame()
    trained = fit(samples, job, recipe, split)
    seconds = round(time.process_time() - begun, 1)
    row |= {"labelled": trained.about["labelled"]} | scores(trained, samples, scored)
    row |= {name: trained.about[name] for name in ("supervised_presentations", "steps")}
    row |= {"seconds": seconds, "versions": versions}
    rows, said = pd.DataFrame([row]), examples(trained, samples).assign(**{k: row[k] for k in KEY})
    named = [{"mode": name.mode, "share": float(name.share)} for name in _names(job)]
    rows, said = (pd.concat([t.assign(**one) for one in named]) for t in (rows, said))
    return rows[KEY + [c for c in rows if c not in KEY]], said


def labelled(samples: Samples, job: Job, split: str = "train") -> np.ndarray:
    """The samples that have a label in a job of the mode `samples`."""
    if job.variant == "covering":
        return cover(samples, samples.split(split), job.share, job.seed)
    return label(samples.split(split), job.share, job.seed)


def fit(samples: Samples, job: Job, recipe: Recipe | None = None, split: str = "train",
        progress=lambda epochs: epochs) -> Trained:  # fmt: skip
    """Train the model of a job; see `run_one`."""
    recipe = replace(recipe or RECIPES[job.model], seed=job.seed)
    options = {"model": job.model, "split": split, "progress": progress}
    if (job.mode, job.model) == ("iterations", "pvae"):
        raise ConfigError("PVAE has no signals, so no share of its updates can be supervised")
    if job.regular:
        return train(samples, recipe, **options)
    variant = VARIANTS[job.variant]
    recipe = replace(recipe, **variant.recipe, epochs=recipe.epochs * variant.times)
    if job.mode == "iterations":
        recipe = replace(recipe, supervised=job.share / 100)
        return train(samples, recipe, limited=True, **options)
    return train(samples, recipe, labelled=labelled(samples, job, split), **options)


def scores(trained: Trained, samples: Samples, split: str = "test") -> dict[str, float]:
    """What the table says of a model: the numbers of `evaluate`, and describe by word class."""
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    words = word_accuracy(respond(trained, source, indices, "describe"), samples, indices)
    return {k: round(v, 3) for k, v in (evaluate(trained, samples, split) | words).items()}


def examples(trained: Trained, samples: Samples) -> pd.DataFrame:
    """Descriptions of a few test clips, evenly spread over the test set."""
    source, test = Source(trained.dataset(samples)), samples.split("test")
    chosen = test[np.linspace(0, len(test) - 1, SHOWN).round().astype(int)]
    answer = respond(trained, source, chosen, "describe")
    meanings = [patterns()[i].meaning for i in samples.pattern[chosen]]
    return pd.DataFrame({
        "sample": chosen, "truth": [sentence(meaning) for meaning in meanings],
        "said": sentences(answer), "right": correct(answer, samples, chosen),
    })  # fmt: skip


def study(samples: Samples, folder, jobs: list[Job] | None = None, recipe: Recipe | None = None,
          progress=lambda results, total: results, **where) -> pd.DataFrame:  # fmt: skip
    """Run the jobs (all of `grid` if None) whose rows `supervision.csv` does not have yet.

    Each row, and its sentences, are written as its training ends; so a stopped study goes on.

    Args:
        folder: of the tables.
        where: where the work is done, see `tables.run`.
    """
    table, said = Path(folder) / "supervision.csv", Path(folder) / "supervision_sentences.csv"
    done = tables.there(table, KEY)
    todo = [
        (samples, job, recipe) for job in (grid() if jobs is None else jobs)
        if (job.model, samples.name, *job[1:]) not in done
    ]  # fmt: skip

    def keep(result) -> None:
        rows, sentences_said = result
        if len(sentences_said):
            tables.add(said, sentences_said, KEY)
        tables.add(table, rows, KEY)

    tables.run(run_one, todo, keep, progress=progress, **where)
    return pd.read_csv(table)

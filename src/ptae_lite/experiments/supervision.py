"""Limited supervision: how good is a model when few updates, or few samples, have a label?

These are two experiments of the paper. *Iterations*: every sample has a label, but only a share of
the updates uses one. *Samples*: the labelled samples are a fixed list, drawn anew with each seed.
Only they take part in signals that need a label; the others take the repeat signals. (The published
script lists positions of batches instead of samples, and shuffles the samples every epoch. So in
the end it uses every sample with its label.)

A row of `supervision.csv` is one training, or one draw of labels for the linear baseline, scored on
the test samples. `supervision_sentences.csv` has what a model says of a few test clips.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser
from dataclasses import asdict
from functools import partial
from importlib.metadata import version

import numpy as np
import pandas as pd

from ptae_lite.cli import data_options
from ptae_lite.data.samples import Samples
from ptae_lite.data.signals import Source
from ptae_lite.errors import ConfigError
from ptae_lite.evaluation import correct, evaluate, respond, sentences, word_accuracy
from ptae_lite.experiments import options, runner
from ptae_lite.experiments.experiment import Experiment, Labels, experiment
from ptae_lite.experiments.labels import chosen, linear_scores
from ptae_lite.experiments.pseudo_labels import pseudo_labelled
from ptae_lite.experiments.runner import Study
from ptae_lite.experiments.supervision_grid import (
    DRAWN,
    SEEDS,
    VARIANTS,
    Job,
    as_rows,
    grid,
    select,
)
from ptae_lite.language import patterns, sentence
from ptae_lite.models import MODELS
from ptae_lite.models.checkpoint import Trained
from ptae_lite.recipe import Recipe

KEY = ["model", "data", "mode", "variant", "share", "seed"]
FILE, SENTENCES = "supervision.csv", "supervision_sentences.csv"
SHOWN = 6  # test clips whose descriptions are kept


def experiment_of(samples: Samples, job: Job, recipe: Recipe | None = None,
                  split: str = "train") -> Experiment | None:  # fmt: skip
    """The training of a job; None for the linear baseline, which is not trained.

    Args:
        recipe: None for the model's own.
        split: `fit` if settings are chosen.

    Raises:
        ConfigError: the job is PVAE with few iterations; it has no signals.
    """
    if job.model == "linear":
        return None
    if (job.mode, job.model) == ("iterations", "pvae"):
        raise ConfigError("PVAE has no signals, so no share of its updates can be supervised")
    own, labels = asdict(recipe or MODELS[job.model].recipe), Labels()
    if not job.regular:
        variant = VARIANTS[job.variant]
        own |= variant.recipe | {"epochs": own["epochs"] * variant.times}
        if job.mode == "iterations":
            labels, own["supervised"] = Labels("few updates"), job.share / 100
        else:
            labels = labels_of(job)
    return experiment(samples, job.model, {}, own, job.seed, split=split, labels=labels,
                      name=_weights_of(job))  # fmt: skip


def _weights_of(job: Job) -> str:
    """The name of a job's file of weights, such as `ptae, labelled 5`."""
    if job.regular:
        return job.model
    if (job.mode, job.variant) == ("samples", "paper"):
        return f"{job.model}, labelled {job.share:g}"
    return f"{job.model}, {job.mode} {job.variant} {job.share:g}"


def score(trained: Trained | None, samples: Samples, job: Job, split: str = "train") -> dict:
    """The rows of a job and its sentences (none for the linear baseline), by table.

    Args:
        split: what was trained on. Scores are on `test` for `train`, and on `held_out` for `fit`.
    """
    begun, scored = time.process_time(), "test" if split == "train" else "held_out"
    row = job._asdict() | {"data": samples.name, "share": float(job.share)}
    versions = f"torch {version('torch')}, numpy {version('numpy')}"
    if trained is None:
        own = labelled(samples, job, split)
        row |= {"labelled": len(own)}
        if job.variant == "pseudo-labels":
            samples, own = pseudo_labelled(samples, split, own), samples.split(split)
        row |= linear_scores(samples, own, scored)
        row |= {"seconds": round(time.process_time() - begun, 1), "versions": versions}
        return {FILE: pd.DataFrame([row])}
    about = trained.about
    row |= {"labelled": about["labelled"]} | scores(trained, samples, scored)
    row |= {name: about[name] for name in ("supervised_samples_seen", "steps")}
    row |= {"seconds": about.get("seconds")}  # weights that `train` wrote do not say them
    row |= {"versions": versions}
    rows, said = pd.DataFrame([row]), examples(trained, samples).assign(**{k: row[k] for k in KEY})
    named = [{"mode": name.mode, "share": float(name.share)} for name in as_rows(job)]
    rows, said = (pd.concat([t.assign(**one) for one in named]) for t in (rows, said))
    return {FILE: rows[KEY + [c for c in rows if c not in KEY]], SENTENCES: said}


def labelled(samples: Samples, job: Job, split: str = "train") -> np.ndarray:
    """The samples that have a label in a job of the mode `samples`."""
    return chosen(samples, split, labels_of(job), job.seed)


def labels_of(job: Job) -> Labels:
    """How the labelled samples of a job are chosen."""
    return Labels(DRAWN.get(job.variant, "random"), job.share)


def fit(samples: Samples, job: Job, recipe: Recipe | None = None, split: str = "train",
        progress=lambda epochs: epochs) -> Trained:  # fmt: skip
    """Train the model of a job; see `experiment_of`."""
    return experiment_of(samples, job, recipe, split).fit(samples, progress=progress)


def scores(trained: Trained, samples: Samples, split: str = "test") -> dict[str, float]:
    """What the table says of a model: the scores of `evaluate`, and describe accuracy by word."""
    source, indices = Source(trained.dataset(samples)), samples.split(split)
    words = word_accuracy(respond(trained, source, indices, "describe"), samples, indices)
    return {k: round(v, 3) for k, v in (evaluate(trained, samples, split) | words).items()}


def examples(trained: Trained, samples: Samples) -> pd.DataFrame:
    """Descriptions of a few test clips, evenly spaced in the test set."""
    source, test = Source(trained.dataset(samples)), samples.split("test")
    chosen = test[np.linspace(0, len(test) - 1, SHOWN).round().astype(int)]
    answer = respond(trained, source, chosen, "describe")
    meanings = [patterns()[i].meaning for i in samples.pattern[chosen]]
    return pd.DataFrame({
        "sample": chosen, "truth": [sentence(meaning) for meaning in meanings],
        "said": sentences(answer), "right": correct(answer, samples, chosen),
    })  # fmt: skip


def study(samples: Samples, folder, jobs: list[Job] | None = None, recipe: Recipe | None = None,
          weights=None, **where) -> pd.DataFrame:  # fmt: skip
    """Run jobs (all of `grid` if None); see `runner.run`.

    Args:
        recipe: for all trainings; None for each model's own.
        weights: a folder of trained models.
    """
    rows = [named(samples, job) for job in (grid() if jobs is None else jobs)]
    made = Study(FILE, KEY, partial(_experiment, recipe), _score, companions={SENTENCES: KEY})
    return runner.run(made, samples, rows, folder, weights, **where)


def named(samples: Samples, job: Job) -> tuple:
    """A job as the values of the columns `KEY`."""
    return (job.model, samples.name, *job[1:])


def _experiment(recipe: Recipe | None, samples: Samples, model: str, data: str, *rest):
    return experiment_of(samples, Job(model, *rest), recipe)


def _score(trained: Trained | None, samples: Samples, model: str, data: str, *rest):
    return score(trained, samples, Job(model, *rest))


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    data_options(parser)
    options.trainings(parser, SEEDS)
    options.weights(parser)
    parser.add_argument("--models", nargs="+", metavar="NAME", help="which models")
    parser.add_argument("--modes", nargs="+", metavar="NAME", help="samples, iterations")
    parser.add_argument("--variants", nargs="+", metavar="NAME", help="which variants")
    parser.add_argument("--shares", type=float, nargs="+", metavar="PERCENT",
                        help="which shares of labels")  # fmt: skip
    parser.add_argument("--core", action="store_true",
                        help="only what the curves of chapter 04 need")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    samples = options.samples(given)
    jobs = select(grid(given.seeds, given.core), model=given.models, mode=given.modes,
                  variant=given.variants, share=given.shares)  # fmt: skip
    table = study(samples, given.out, jobs, weights=given.weights, **options.where(given))
    return options.result(given, FILE, table, samples)

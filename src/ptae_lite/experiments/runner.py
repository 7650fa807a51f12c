"""Experiments are run here, whichever study asks: trained once, scored, written down as they come.

A `Study` is a list of experiments and a function that scores one. `run` makes the rows that its
table lacks; so a study that was stopped goes on, and rows that are there are not made again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from ptae_lite.data.samples import Samples
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.experiments import tables
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.experiments.labels import chosen
from ptae_lite.models import checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.training import train

UNFINISHED = "unfinished"  # beside the tables: states of trainings that are under way


@dataclass(frozen=True)
class Study:
    """What is trained for each row of a table, and what the row says.

    Attributes:
        file: the table; its rows say what is done.
        key: the columns that name one job. A job is a tuple of their values.
        experiment: gives, of `(samples, *job)`, what is trained; None where nothing is.
        score: gives, of `(trained, samples, *job)`, the rows: a DataFrame, or several by file.
        order: columns that the rows of the table are sorted by, where these are more than `key`.
        companions: the same of further files that `score` has rows for.
        see: gives, of `(samples, *job)`, what the job's training sees, where that is not `samples`.
        watch: looks, as `watch(trained, samples, epoch)`, at a training from outside; what it gives
            (but None) is kept in `about["watched"]`, with the seconds of training until then.
    """

    file: str
    key: list[str]
    experiment: Callable[..., Experiment | None]
    score: Callable[..., pd.DataFrame | dict[str, pd.DataFrame]]
    order: list[str] | None = None
    companions: dict[str, list[str]] = field(default_factory=dict)
    see: Callable[..., Samples] | None = None
    watch: Callable[..., dict | None] | None = None


def run(study: Study, samples: Samples, jobs: Iterable[tuple], folder, weights=None,
        **where) -> pd.DataFrame:  # fmt: skip
    """Make the rows of `jobs` that the study's table in `folder` lacks; the whole table.

    Args:
        weights: a folder of trained models. What is there is not trained again, what is missing is
            put there; none are looked for or kept if None.
        where: the work is done, see `tables.run`.
    """
    table = Path(folder) / study.file
    done = tables.there(table, study.key)
    todo = [job for job in jobs if tuple(job) not in done]

    def keep(rows) -> None:
        found = rows if isinstance(rows, dict) else {study.file: rows}
        for name, order in {
            **study.companions,
            study.file: study.order,
        }.items():  # what is done: last
            if len(found.get(name, ())):
                tables.add(Path(folder) / name, found[name], study.key, order)

    unfinished = Path(folder) / UNFINISHED
    for group in [] if weights is None else shared(study, samples, todo, weights):
        trainings = [(one, samples, weights, unfinished) for one in group]
        tables.run(_train, trainings, lambda _: None, **where)
    tables.run(work, [(study, samples, weights, unfinished, job) for job in todo], keep, **where)
    return tables.read(table, study.key)


def work(study: Study, samples: Samples, weights, unfinished, job: tuple):
    """The rows of one job."""
    seen = samples if study.see is None else study.see(samples, *job)
    asked = study.experiment(seen, *job)
    trained = None if asked is None else obtain(asked, seen, weights, study.watch, unfinished)
    rows = study.score(trained, seen, *job)
    if asked is not None:  # only now: a training whose rows are lost would have to be made again
        state_of(asked, unfinished).unlink(missing_ok=True)
    return rows


def shared(study: Study, samples: Samples, jobs, weights) -> list[list[Experiment]]:
    """What is trained before the jobs, since several need it: first that on which others build."""
    asked = [one for job in jobs if (one := study.experiment(samples, *job)) is not None]
    times = Counter(one.hash for one in asked)
    groups, some = [[one for one in asked if times[one.hash] > 1]], asked
    while some := [one.base for one in some if one.base]:
        groups.insert(0, some)
    known, left = set(), []
    for group in groups:
        own = {one.hash: one for one in group if one.hash not in known}
        known |= set(own)
        left.append([one for one in own.values() if not (Path(weights) / one.file).exists()])
    return [group for group in left if group]


def _train(asked: Experiment, samples: Samples, weights, unfinished) -> None:
    obtain(asked, samples, weights, unfinished=unfinished)
    state_of(asked, unfinished).unlink(missing_ok=True)


def obtain(
    asked: Experiment, samples: Samples, weights=None, watch=None, unfinished=None
) -> Trained:
    """The trained model of an experiment: of the folder `weights`, else trained and kept there.

    Args:
        unfinished: a folder for the state of the training while it runs, see `training.train`.
    """
    trained = found(asked, weights)
    if trained is None or (watch is not None and not trained.about.get("watched")):
        trained = fit(asked, samples, weights, watch, unfinished=state_of(asked, unfinished))
        if weights is not None:
            checkpoint.save(Path(weights) / asked.file, trained)
    return trained


def state_of(asked: Experiment, folder) -> Path | None:
    """Where the state of a training is kept while it runs."""
    return folder and Path(folder) / f"{asked.hash[:16]}.safetensors"


def found(asked: Experiment, weights) -> Trained | None:
    """The trained model of an experiment, if it lies in the folder `weights`.

    Raises:
        ArtefactError: a file of that name holds another training.
    """
    path = None if weights is None else Path(weights) / asked.file
    if path is None or not path.exists():
        return None
    trained = checkpoint.load(path)
    if trained.about.get("experiment") != asked.hash:
        raise ArtefactError(
            f"{path} holds another training than the one asked for "
            f"({differences(trained, asked)}); move it away, or name another folder of weights"
        )
    return trained


def differences(trained: Trained, asked: Experiment) -> str:
    """In what a training differs from the one asked for, as far as its file tells."""
    was = trained.about.get("recipe", {}) | vars(trained.model.config)
    wanted = vars(asked.recipe) | vars(asked.config)
    found = [
        f"{k} {was[k]!r} for {wanted[k]!r}" for k in wanted if k in was and was[k] != wanted[k]
    ]
    if "experiment" not in trained.about:
        found.append("it does not say of which experiment it is")
    return "; ".join(found) or "other data, labels or videos, or another version of the recipe"


def fit(asked: Experiment, samples: Samples, weights=None, watch=None, **options) -> Trained:
    """Train an experiment. The model says in `about` which `experiment` it is, and the `seconds`
    of computing that its training took.

    Args:
        weights: where the experiment's base may lie.
        watch: see `Study`.
        options: `device`, `progress` and `unfinished`, see `training.train`.
    """
    if samples.fingerprint != asked.data:
        raise ConfigError(f"the experiment is of {asked.data}, not of {samples.fingerprint}")
    videos = None
    if asked.videos:
        from ptae_lite.experiments.videos import make

        base = obtain(asked.base, samples, weights) if asked.base else None
        videos = make(asked, samples, base)

    def look(epoch: int, trained: Trained) -> dict | None:
        return None if watch is None else watch(trained, samples, epoch)

    own = chosen(samples, asked.split, asked.labels, asked.seed)
    trained = train(
        samples, asked.recipe, model=asked.model, config=asked.config, split=asked.split,
        labelled=own, limited=asked.labels.chosen == "few updates", videos=videos,
        on_epoch=look, **options,
    )  # fmt: skip
    trained.about["experiment"] = asked.hash
    return trained


def check_names(asked: Sequence[str], there: Iterable[str], what: str) -> None:
    """Refuse names that do not exist, with those that do."""
    for name in asked:
        if name not in there:
            raise ConfigError(f"no {what} {name!r}; there are {'; '.join(there)}")

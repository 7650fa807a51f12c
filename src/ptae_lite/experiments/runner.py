"""Runs the experiments of all studies: train each once, score it, and write the rows as they come.

A `Study` is a list of experiments and a function that scores one. `run` makes the rows that its
table lacks. So a study that was stopped goes on with the missing rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import pandas as pd

from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.experiments import tables
from ptae_lite.experiments.experiment import Experiment

UNFINISHED = "unfinished"  # a folder beside the tables, for states of trainings under way


@dataclass(frozen=True)
class Study:
    """What is trained for each row of a table, and what the row says.

    Attributes:
        file: the table.
        key: the columns that name one job. A job is a tuple of their values.
        experiment: called as `experiment(samples, *job)`; returns what to train, or None for
            nothing.
        score: called as `score(trained, samples, *job)`; returns the rows: a DataFrame, or several
            by file name.
        order: columns by which the table is sorted; None for `key`.
        companions: further files for which `score` has rows, and the columns by which they are
            sorted.
        see: called as `see(samples, *job)`; returns the samples for the training of a job. None for
            the samples themselves.
        watch: called as `watch(trained, samples, epoch)` after each epoch. Results other than None
            are kept in `about["watched"]`, with the seconds of training so far.
    """

    file: str
    key: list[str]
    experiment: Callable[..., Experiment | None]
    score: Callable[..., pd.DataFrame | dict[str, pd.DataFrame]]
    order: list[str] | None = None
    companions: dict[str, list[str]] = field(default_factory=dict)
    see: Callable | None = None
    watch: Callable[..., dict | None] | None = None


def run(study: Study, samples, jobs: Iterable[tuple], folder, weights=None,
        **where) -> pd.DataFrame:  # fmt: skip
    """Make the rows of `jobs` that the study's table in `folder` lacks; return the whole table.

    Args:
        samples: what is trained on and scored: `Samples`, or what a study has in their place.
        weights: a folder of trained models. A model that is there is not trained again, and a new
            one is stored there. None: models are neither looked for nor stored.
        where: where the work is done, see `tables.run`.

    Raises:
        ArtefactError: the table, or a file of weights, belongs to something else.
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
    tables.run(work, [(study, samples, weights, job, unfinished) for job in todo], keep, **where)
    return tables.read(table, study.key)


def work(study: Study, samples, weights, job: tuple, unfinished=None):
    """The rows of one job."""
    seen = samples if study.see is None else study.see(samples, *job)
    asked = study.experiment(seen, *job)
    trained = None if asked is None else obtain(asked, seen, weights, study.watch, unfinished)
    rows = study.score(trained, seen, *job)
    if asked is not None and unfinished is not None:
        state_of(asked, unfinished).unlink(missing_ok=True)
    return rows


def shared(study: Study, samples, jobs, weights) -> list[list[Experiment]]:
    """What to train before the jobs, because several of them need it.

    It is a list of groups of experiments. A group needs the models of the groups before it.
    """
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


def _train(asked: Experiment, samples, weights, unfinished) -> None:
    obtain(asked, samples, weights, unfinished=unfinished)
    state_of(asked, unfinished).unlink(missing_ok=True)


def obtain(asked: Experiment, samples, weights=None, watch=None, unfinished=None):
    """The trained model of an experiment: read from the folder `weights`, or trained and stored.

    Args:
        unfinished: a folder for the state of a training that is under way, see `training.train`.
    """
    trained = found(asked, weights)
    if trained is None or (watch is not None and not trained.about.get("watched")):
        base = obtain(asked.base, samples, weights) if asked.base else None
        trained = asked.fit(samples, base, watch, state_of(asked, unfinished))
        if weights is not None:
            asked.save(Path(weights) / asked.file, trained)
    return trained


def state_of(asked: Experiment, folder) -> Path | None:
    """The file of the state of a training that is under way."""
    return folder and Path(folder) / f"{asked.hash[:16]}.safetensors"


def found(asked: Experiment, weights):
    """The trained model of an experiment, if it is in the folder `weights`, else None.

    Raises:
        ArtefactError: a file of that name holds another training.
    """
    path = None if weights is None else Path(weights) / asked.file
    if path is None or not path.exists():
        return None
    trained = asked.load(path)
    if trained.about.get("experiment") != asked.hash:
        raise ArtefactError(
            f"{path} holds another training than the one asked for "
            f"({differences(trained, asked)}); move it away, or name another folder of weights"
        )
    return trained


def differences(trained, asked: Experiment) -> str:
    """How a training differs from the one asked for, as far as its file tells."""
    every, about = asdict(asked), trained.about
    was = (about.get("recipe") or {}) | about.get("config", {})
    wanted = every["recipe"] | every["config"]
    found = [
        f"{k} {was[k]!r} for {wanted[k]!r}" for k in wanted if k in was and was[k] != wanted[k]
    ]
    if "experiment" not in trained.about:
        found.append("it does not say of which experiment it is")
    return "; ".join(found) or "other data, labels or videos, or another version of the recipe"


def check_names(asked: Sequence[str], there: Iterable[str], what: str) -> None:
    """Check that names exist.

    Raises:
        ConfigError: one does not. The message lists those that do.
    """
    for name in asked:
        if name not in there:
            raise ConfigError(f"no {what} {name!r}; there are {'; '.join(there)}")

"""The tables of the studies. Rows are added one training at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd
import torch
from joblib import Parallel, delayed, parallel_config

from ptae_lite import renamed
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.files import atomic_write, file_lock

PATIENCE_S = 10  # wait so long for a scheduler's answer
TURN_S = 60  # wait so long for another process that writes to the table


def read(path: Path, key: list[str]) -> pd.DataFrame:
    """A table, or an empty one with the columns of `key` if there is no file.

    Raises:
        ArtefactError: the file is not a table with these columns.
    """
    if not Path(path).exists():
        return pd.DataFrame(columns=key)
    table = pd.DataFrame()
    try:
        table = pd.read_csv(path)
        table[key]
    except (ValueError, KeyError) as error:  # pandas' own are ValueErrors
        why = renamed.said_of(table, renamed.COLUMNS) or error
        raise ArtefactError(
            f"{path} is no table of this study ({why}); move it away, or name another --out"
        ) from None
    return table


def there(path: Path, key: list[str]) -> set[tuple]:
    """The keys of the rows that a table has."""
    return set(read(path, key)[key].itertuples(index=False, name=None))


def add(path: Path, rows: pd.DataFrame, key: list[str], order: list[str] | None = None) -> None:
    """Add rows to a table, and sort it by `order` (None: by `key`).

    The table is written whole or not at all. Rows with the same key are replaced: a training may
    have been stopped between its two tables. Several processes may add to one table.

    Raises:
        FileError: the file cannot be written, or another process holds its lock for over a minute.
    """
    with file_lock(path, TURN_S):
        old = read(path, key)
        if len(old):
            again = _index(old, key).isin(_index(rows, key))
            rows = pd.concat([old[~again], rows], ignore_index=True)
        with atomic_write(path) as temporary:
            rows.sort_values(order or key, kind="stable").to_csv(
                temporary, index=False, lineterminator="\n"
            )


def completed(rows: pd.DataFrame, old: pd.DataFrame, key: list[str]) -> pd.DataFrame:
    """The rows of `old` in their order; those of `rows` replace the ones with the same key."""
    both = pd.concat([old, rows], ignore_index=True)
    place = pd.Series(_index(both, key).factorize()[0])
    stale = place[: len(old)].isin(place[len(old) :])
    return both.loc[place.drop(stale[stale].index).sort_values(kind="stable").index]


def _index(rows: pd.DataFrame, key: list[str]) -> pd.MultiIndex:
    """The rows' keys. An empty text, which a file gives back as a missing value, equals itself."""
    keys = rows[key].astype(object)
    return pd.MultiIndex.from_frame(keys.where(keys.notna(), ""))


def run(work: Callable, jobs: list, keep: Callable, workers: int = 1,
        progress: Callable = lambda results, total: results,
        cluster: str | None = None) -> None:  # fmt: skip
    """Call `work(*job)` for each job, and `keep` each result as it comes.

    Args:
        keep: called in this process, one result after the other, so it may write to a table.
        workers: number of processes; each does one training with one thread.
        progress: wraps the results, as `tqdm` does; it is given `total`.
        cluster: address of a Dask scheduler, such as `tcp://HOST:PORT`, whose workers have this
            package. `workers` is then not used. Workers run everything that clients of the
            scheduler send, so both must be on a trusted network.

    Raises:
        ConfigError: the extra `cluster` is not installed, nothing answers at the address, or a
            worker has several threads.
    """
    if cluster is not None:
        _reach(cluster)
        with parallel_config("dask", scheduler_host=cluster):
            return _collect(_side_by_side(work, jobs, -1), jobs, keep, progress)
    one, workers = (work(*job) for job in jobs), min(workers, len(jobs))
    _collect(one if workers <= 1 else _side_by_side(work, jobs, workers), jobs, keep, progress)


def _side_by_side(work: Callable, jobs: list, workers: int) -> Iterable:
    pool = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
    return pool(delayed(_alone)(work, job) for job in jobs)


def _collect(results: Iterable, jobs: list, keep: Callable, progress: Callable) -> None:
    for result in progress(results, total=len(jobs)):
        keep(result)


def _alone(work: Callable, job: tuple):
    torch.set_num_threads(1)
    return work(*job)


def _reach(address: str) -> None:
    """Check that a scheduler answers, and that its workers have one thread each.

    PyTorch has one random generator in a process, and two trainings in it would disturb each other.
    Workers that join later are not checked.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ConfigError(
            "a cluster needs the package distributed, which is not installed; "
            "install it with: pip install -e '.[cluster]'"
        ) from None
    try:
        with Client(address, timeout=PATIENCE_S, set_as_default=False) as client:
            threads = max(client.nthreads().values(), default=1)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no Dask scheduler answers at {address!r} ({error}); start one with `dask scheduler` "
            "and give its address, such as tcp://127.0.0.1:8786"
        ) from None
    if threads > 1:
        raise ConfigError(
            f"a worker at {address!r} has {threads} threads, and two trainings in one process mix "
            "their random numbers; start the workers with: dask worker --nworkers -1 --nthreads 1"
        )

"""Options that several studies share, and what the command `study NAME` prints."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

import joblib
import pandas as pd

from ptae_lite.cli import bar, caution, whole_number
from ptae_lite.data import samples as data
from ptae_lite.data.samples import Samples


def trainings(parser: ArgumentParser, seeds=(0, 1, 2), cluster: bool = True) -> None:
    """Add the options that say which trainings are run, and where.

    Args:
        cluster: whether the study can run on a Dask cluster.
    """
    parser.add_argument("--seeds", type=whole_number(0), nargs="+", default=seeds, metavar="SEED",
                        help="one training for each")  # fmt: skip
    parser.add_argument("--workers", type=whole_number(1), default=joblib.cpu_count(),
                        help="trainings side by side; as many as there are cores")  # fmt: skip
    if cluster:
        parser.add_argument("--cluster", metavar="ADDRESS",
                            help="a Dask scheduler, on a trusted network only, whose workers do "
                                 "the trainings and reach the same folders")  # fmt: skip


def where(given, what: str = "trainings") -> dict:
    """The arguments of `runner.run` that say where the work is done, with a progress bar."""
    return {
        "workers": given.workers, "cluster": given.cluster,
        "progress": lambda results, total: bar(results, total=total, desc=what),
    }  # fmt: skip


def weights(parser: ArgumentParser, default: str | None = None) -> None:
    """Add the option for a folder of trained models."""
    parser.add_argument("--weights", metavar="FOLDER", default=default,
                        help="of trained models: those there are not trained again, and the others "
                             "are kept there")  # fmt: skip


def samples(given) -> Samples:
    """The samples that the options of `cli.data_options` name."""
    return data.load_samples(given.data, given.holdout)


def result(given, file: str, table: pd.DataFrame, of: Samples | None = None) -> dict:
    """What the command prints."""
    made = {"table": str(Path(given.out) / file), "rows": len(table)}
    return made | (caution(of) if of is not None else {})

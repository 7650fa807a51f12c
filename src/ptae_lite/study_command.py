"""The command `study`: each study has a parser of its own, with the options that it understands."""

from __future__ import annotations

import argparse
from pathlib import Path

import torch

from ptae_lite.console import refuse_data, whole_number
from ptae_lite.experiments.registry import STUDIES
from ptae_lite.files import alone


def run(options) -> dict:
    torch.set_num_threads(options.threads)
    refuse_data(options.out, "build/results")
    with alone(Path(options.out) / options.name):  # two would lose each other's rows
        return STUDIES[options.name].command(options)


def add_studies(parser: argparse.ArgumentParser) -> None:
    """A parser for each of `STUDIES`."""
    studies = parser.add_subparsers(dest="name", required=True, metavar="NAME")
    for name, study in STUDIES.items():
        text = study.__doc__.strip().splitlines()[0]
        made = studies.add_parser(
            name, help=text, description=text,
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )  # fmt: skip
        made.add_argument("--json", action="store_true", help="print one line of JSON")
        study.add_options(made)
        made.add_argument(
            "--threads", type=whole_number(1), default=1, help="threads inside one training"
        )
        made.add_argument("--out", default="build/results", help="folder of the tables")

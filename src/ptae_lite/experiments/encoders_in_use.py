"""How well does PTAE do with the features of each encoder in the study `encoders`?

Every PTAE is trained on the CPU; only the features differ. `device` is the one on which the encoder
was trained. Behind encoders that were trained four times as long, and longer, the stored table has
PTAE with Adam alone only (`ptae_adam`).
"""

from __future__ import annotations

from argparse import ArgumentParser
from functools import partial
from pathlib import Path

import pandas as pd

from ptae_lite import artefacts
from ptae_lite.data import samples as data
from ptae_lite.data.samples import Samples
from ptae_lite.errors import RecordingError
from ptae_lite.evaluation import evaluate
from ptae_lite.experiments import options
from ptae_lite.experiments.encoder_training import folder_of
from ptae_lite.experiments.encoders import CAES, PCAS
from ptae_lite.experiments.experiment import Experiment, experiment
from ptae_lite.experiments.runner import Study, check_names, run
from ptae_lite.models import ADAM
from ptae_lite.models.checkpoint import Trained

RECIPES = {"ptae": {}, "ptae_adam": ADAM["ptae"]}  # how they differ from the regular recipe
KEY = ["model", "encoder", "seed", "samples_seen"]
FILE = "encoders_in_use.csv"
NAME = f"results/{FILE}"


def jobs_in(work, seeds) -> list[tuple[str, int, int]]:
    """Encoder, seed and images seen of every training, one seed after the other.

    A CAE of a seed goes with the PTAE of that seed. A PCA has no seed and goes with each.

    Raises:
        RecordingError: the folder holds no features.
    """
    found = []
    for seed in seeds:
        for name in (*CAES, *PCAS):
            folder = Path(work) / folder_of(name, seed if name in CAES else 0)
            lengths = sorted(int(p.stem.split("_")[1]) for p in folder.glob("features_*.npz"))
            found += [(name, seed, length) for length in lengths]
    if not found:
        raise RecordingError(
            f"{work} holds no features of an encoder; make them: python -m ptae_lite study encoders"
        )
    return found


def features_of(work, encoder: str, seed: int, samples_seen: int) -> Path:
    """The file of an encoder's features, in the folder `work` of the study `encoders`."""
    folder = Path(work) / folder_of(encoder, seed if encoder in CAES else 0)
    return folder / f"features_{samples_seen}.npz"


def see(work, samples: Samples, model: str, *encoder) -> Samples:
    """The samples with the features of an encoder."""
    return data.with_features(samples, features_of(work, *encoder))


def experiment_of(
    samples: Samples, model: str, encoder: str, seed: int, samples_seen: int
) -> Experiment:
    """The training of a row."""
    return experiment(samples, recipe=RECIPES[model], seed=seed)


def score(work, trained: Trained, samples: Samples, *job) -> pd.DataFrame:
    """A row: the scores of PTAE on the test samples, with the features of that encoder."""
    weights = features_of(work, *job[1:]).with_name(f"encoder_{job[-1]}.safetensors")
    device = artefacts.load_weights(weights)[1].get("device", "cpu")
    row = dict(zip(KEY, job, strict=True)) | {"device": device}
    row |= {"steps": trained.about["steps"], "seconds": round(trained.about["seconds"])}
    row |= {name: round(value, 3) for name, value in evaluate(trained, samples).items()}
    return pd.DataFrame([row])


def stored() -> pd.DataFrame:
    """The stored table; without rows if `data/` has none."""
    if NAME in artefacts.manifest():
        return pd.read_csv(artefacts.stored(NAME))
    return pd.DataFrame(columns=[*KEY, "describe_accuracy", "execute_nrmse"])


def study(
    samples: Samples, folder, work, seeds=(0, 1, 2), models=("ptae",), **where
) -> pd.DataFrame:
    """Train a PTAE for every encoder, one seed after the other; see `runner.run`.

    Args:
        work: the folder of the encoders' features, which the study `encoders` writes.
        models: names in `RECIPES`.

    Raises:
        ConfigError: there is no such model.
    """
    check_names(models, RECIPES, "model")
    made = Study(FILE, KEY, experiment_of, partial(score, work), see=partial(see, work))
    jobs = [(model, *encoder) for model in models for encoder in jobs_in(work, seeds)]
    return run(made, samples, jobs, folder, **where)


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    options.trainings(parser)
    parser.add_argument("--encoders", default="build/encoders", help="folder of the CAEs' features")
    parser.add_argument("--models", nargs="+", metavar="NAME", default=("ptae",),
                        help=", ".join(RECIPES))  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    table = study(
        data.load_samples(),
        given.out,
        given.encoders,
        given.seeds,
        given.models,
        **options.where(given),
    )
    return options.result(given, FILE, table)

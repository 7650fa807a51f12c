"""The command `study`: which experiments there are, and how each is called."""

from __future__ import annotations

import argparse
from pathlib import Path

import joblib
import torch

from ptae_lite.console import RECORDING, bar, caution, data_options, refuse_data, whole_number
from ptae_lite.errors import PTAEError
from ptae_lite.files import alone


def _supervision(options) -> dict:
    from ptae_lite.data.samples import load_samples
    from ptae_lite.experiments import supervision

    samples = load_samples(options.data, options.holdout)
    jobs = supervision.select(
        supervision.grid(options.seeds, options.core), model=options.models, mode=options.modes,
        variant=options.variants, share=options.shares,
    )  # fmt: skip
    table = supervision.study(
        samples, options.out, jobs, workers=options.workers, cluster=options.cluster,
        progress=lambda results, total: bar(results, total=total, desc="trainings"),
    )  # fmt: skip
    made = {"table": str(Path(options.out) / "supervision.csv"), "rows": len(table)}
    return made | caution(samples)


def _recipes(options) -> dict:
    from ptae_lite.data.samples import load_samples
    from ptae_lite.experiments import recipes

    samples = load_samples(options.data, options.holdout)
    table = recipes.study(
        samples, options.out, options.variants or tuple(recipes.CHOICES),
        options.seeds or (0, 1), options.workers,
        progress=lambda results, total: bar(results, total=total, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "recipes.csv"), "rows": len(table)} | caution(samples)


def _eyes(options) -> dict:
    from ptae_lite.data.samples import load_unseen
    from ptae_lite.experiments import encoders

    table = encoders.study(
        load_unseen(options.recording), options.recording, options.out, options.eyes,
        options.seeds or (0, 1, 2), workers=options.workers, device=options.device,
        long=options.long,
        progress=lambda results, total: bar(results, total=total, desc="eyes"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "eyes.csv"), "rows": len(table)}


def _eyes_ptae(options) -> dict:
    from ptae_lite.data.samples import load_samples
    from ptae_lite.experiments import encoders_in_use

    table = encoders_in_use.study(
        load_samples(), options.out, options.eyes, options.seeds or (0, 1, 2),
        workers=options.workers,
        progress=lambda results, total: bar(results, total=total, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "eyes_ptae.csv"), "rows": len(table)}


def _family(options) -> dict:
    from ptae_lite.data.samples import load_samples
    from ptae_lite.experiments import family

    samples = load_samples(options.data, options.holdout)
    table = family.study(
        samples, options.out, options.variants or family.REGULAR,
        options.seeds or (0, 1, 2), options.weights, options.workers,
        progress=lambda results, total: bar(results, total=total, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "family.csv"), "rows": len(table)} | caution(samples)


def _incongruence(options) -> dict:
    from ptae_lite.data.samples import load_samples
    from ptae_lite.experiments import incongruence_table

    samples = load_samples(options.data, options.holdout)
    table = incongruence_table.study(
        samples, options.out,
        options.variants or tuple(incongruence_table.MODELS), options.seeds or (0, 1, 2),
        options.weights, options.workers,
        progress=lambda results, total: bar(results, total=total, desc="models"),
    )  # fmt: skip
    made = {"table": str(Path(options.out) / incongruence_table.FILE), "rows": len(table)}
    return made | caution(samples)


def _closed_loop(options) -> dict:
    from ptae_lite.data.samples import load_samples
    from ptae_lite.experiments import closed_loop, episodes

    folder = Path(options.out)
    table = closed_loop.study(
        load_samples(), folder, options.weights or "build/weights",
        options.variants or tuple(closed_loop.MODELS), options.seeds or (0, 1, 2),
        options.conditions, options.workers,
        progress=lambda results, total: bar(results, total=total, desc="jobs"),
    )  # fmt: skip
    episodes.keep(folder, table, options.weights or "build/weights")
    return {"table": str(folder / "closed_loop.csv"), "rows": len(table)}


STUDIES = {
    "supervision": _supervision, "recipes": _recipes, "family": _family, "eyes": _eyes,
    "eyes-ptae": _eyes_ptae, "incongruence": _incongruence, "closed-loop": _closed_loop,
}  # fmt: skip


OF_OURS = ("eyes", "eyes-ptae", "closed-loop")  # the authors' data have no images, and no scene


def run(options) -> dict:
    torch.set_num_threads(options.threads)
    refuse_data(options.out, "build/results")
    if options.name in OF_OURS and (options.data != "recording" or options.holdout is not None):
        raise PTAEError(
            f"study {options.name} is of our own recording; leave out --data, --holdout"
        )
    with alone(Path(options.out) / options.name):  # two would lose each other's rows
        return STUDIES[options.name](options)


def add_options(study: argparse.ArgumentParser) -> None:
    """The options of all experiments; each says whose it is, where it is not everybody's."""
    study.add_argument("name", choices=tuple(STUDIES), help="which experiment")
    data_options(study)
    study.add_argument("--shares", type=float, nargs="+", metavar="PERCENT",
                       help="supervision: which shares of labels")  # fmt: skip
    study.add_argument("--models", nargs="+", metavar="NAME", help="supervision: which models")
    study.add_argument("--modes", nargs="+", metavar="NAME",
                       help="supervision: samples, iterations")  # fmt: skip
    study.add_argument("--variants", nargs="+", metavar="NAME",
                       help="family, recipes, supervision: which variants; incongruence, "
                            "closed-loop: which models")  # fmt: skip
    study.add_argument("--core", action="store_true",
                       help="supervision: only what the figures of chapter 04 need")  # fmt: skip
    study.add_argument(
        "--conditions",
        nargs="+",
        metavar="NAME",
        help="closed-loop: which, of every model (default: those that chapter 06 shows)",
    )
    study.add_argument(
        "--seeds",
        type=whole_number(0),
        nargs="+",
        help="one training for each; the weighted sums have their own draws",
    )
    study.add_argument("--workers", type=whole_number(1), default=joblib.cpu_count(),
                       help="trainings side by side (default: one a core)")  # fmt: skip
    study.add_argument("--cluster", metavar="ADDRESS",
                       help="supervision: a Dask scheduler whose workers do the trainings; on a "
                            "trusted network only")  # fmt: skip
    study.add_argument("--weights", metavar="FOLDER",
                       help="family, incongruence, closed-loop: keep the trained models here; "
                            "the last two do not train what is there")  # fmt: skip
    study.add_argument("--recording", default=RECORDING, help="eyes: a recording's folder")
    study.add_argument("--device", default="cpu",
                       help="eyes: where CAEs are trained, cpu or a GPU such as cuda")  # fmt: skip
    study.add_argument("--long", action="store_true",
                       help="eyes: train the CAEs much further, for hours on a CPU")  # fmt: skip
    study.add_argument("--eyes", default="build/eyes",
                       help="eyes: folder of the CAEs and their features")  # fmt: skip
    study.add_argument(
        "--threads", type=whole_number(1), default=1, help="threads inside one training"
    )
    study.add_argument("--out", default="build/results", help="folder of the tables")

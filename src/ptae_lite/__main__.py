"""The command line: `python -m ptae_lite record|features|train|evaluate|study`.

Every command shows its progress on the error stream, and with `--json` prints one line of results.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import torch
from tqdm import tqdm

from ptae_lite.console import guarded, refuse_data, whole_number
from ptae_lite.errors import PTAEError
from ptae_lite.files import alone, check_writable

RECORDING = "build/recording"
TRAINED = ("ptae", "pgae", "pvae", "prae", "cae", "plain-cae")
DATA_HELP = "'recording' for the stored features, a recording's folder, or the authors' data folder"
HOLDOUT_HELP = "patterns kept aside from an authors' folder without its test part"


def bar(items, **options):
    """A progress bar on the error stream."""
    return tqdm(items, file=sys.stderr, dynamic_ncols=True, **options)


def do_record(options) -> dict:
    from ptae_lite import frames
    from ptae_lite.robot import recorder

    folder = Path(options.out)
    refuse_data(folder, RECORDING)
    done = list(folder.glob("sequences/*.npz"))
    left = 864 - len(done)
    recorder.record(
        folder,
        workers=options.workers,
        progress=lambda runs: bar(runs, total=left, desc="recording", unit=" samples"),
    )
    frames.write(folder)
    return {"recording": str(folder), "samples": 864, "recorded_now": left}


def do_features(options) -> dict:
    from ptae_lite import artefacts, vision
    from ptae_lite.dataset import write_features
    from ptae_lite.robot.recorder import check_ours, load_sequence, samples_in_order

    eye_file = Path(options.eye) if options.eye else artefacts.stored("weights/cae.safetensors")
    eye = vision.load_eye(eye_file)
    check_ours(options.data, same_scene=False)
    torch.set_num_threads(options.threads)
    path = Path(options.data) / "features.npz"
    with alone(options.data):
        parts = [
            vision.encode_images(eye, load_sequence(options.data, *sample).images)
            for sample in bar(samples_in_order(), desc="features", unit=" samples")
        ]
        write_features(path, parts, eye_file)
    return {"features": str(path), "frames": sum(len(part) for part in parts)}


def do_train(options) -> dict:
    torch.set_num_threads(options.threads)
    refuse_data(options.out, "build/weights")
    check_writable(options.out)  # now, and not after the training
    if options.model in ("cae", "plain-cae"):
        return _train_eye(options)
    from ptae_lite import dataset, training
    from ptae_lite.evaluation import evaluate
    from ptae_lite.models import checkpoint

    samples = dataset.load(options.data, options.holdout)
    recipe = replace(training.RECIPES[options.model], seed=options.seed)
    if options.epochs is not None:
        recipe = replace(recipe, epochs=options.epochs)
    split = "fit" if options.held_out else "train"
    labelled = None
    if options.labelled is not None:
        labelled = training.label(samples.split(split), options.labelled, options.seed)
    config = configured(options.model, samples.features.shape[2], options.set or ())
    trained = training.train(
        samples, recipe, model=options.model, config=config, split=split, labelled=labelled,
        device=options.device,
        progress=lambda epochs: bar(epochs, desc=options.model.upper(), unit=" epochs"),
    )  # fmt: skip
    checkpoint.save(options.out, trained)
    scores = evaluate(trained, samples, "held_out") if options.held_out else {}
    made = {"weights": str(options.out), "steps": trained.about["steps"]}
    return made | _rounded(scores) | _caution(samples)


def configured(model: str, features: int, settings):
    """The model's configuration with `settings`, each NAME=VALUE, put into it."""
    from ptae_lite.models.checkpoint import MODELS

    config = MODELS[model][1](features=features)
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in vars(config):
            there = ", ".join(vars(config))
            raise PTAEError(f"{model} has no setting {name!r}; it has {there}")
        kind = type(getattr(config, name))
        try:
            value = {"true": True, "false": False}[text.lower()] if kind is bool else kind(text)
        except (KeyError, ValueError):
            wanted = {bool: "true or false", int: "a whole number", float: "a number"}[kind]
            raise PTAEError(f"{name} is {wanted}, not {text!r}") from None
        config = replace(config, **{name: value})
    return config


def do_evaluate(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.evaluation import evaluate
    from ptae_lite.models import checkpoint

    torch.set_num_threads(options.threads)
    trained = checkpoint.load(options.weights)
    samples = dataset.load(options.data, options.holdout)
    return _rounded(evaluate(trained, samples, options.split)) | _caution(samples)


def do_study(options) -> dict:
    torch.set_num_threads(options.threads)
    refuse_data(options.out, "build/results")
    with alone(Path(options.out) / options.name):  # two would lose each other's rows
        return STUDIES[options.name](options)


def _supervision(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import supervision

    samples = dataset.load(options.data, options.holdout)
    jobs = supervision.select(
        supervision.grid(options.seeds), model=options.models, mode=options.modes,
        variant=options.variants, share=options.shares,
    )  # fmt: skip
    table = supervision.study(
        samples, options.out, jobs, workers=options.workers, cluster=options.cluster,
        progress=lambda results, total: bar(results, total=total, desc="trainings"),
    )  # fmt: skip
    made = {"table": str(Path(options.out) / "supervision.csv"), "rows": len(table)}
    return made | _caution(samples)


def _eyes(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import eyes

    table = eyes.study(
        dataset.load(), options.recording, options.out, options.eyes, options.seeds or (0, 1, 2),
        progress=lambda jobs: bar(jobs, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "eyes.csv"), "rows": len(table)}


def _eyes_ptae(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import eyes_ptae

    table = eyes_ptae.study(
        dataset.load(), options.out, options.eyes, options.seeds or (0, 1, 2),
        progress=lambda jobs: bar(jobs, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "eyes_ptae.csv"), "rows": len(table)}


def _family(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import family

    samples = dataset.load(options.data, options.holdout)
    table = family.study(
        samples, options.out, options.variants or tuple(family.VARIANTS),
        options.seeds or (0, 1, 2), options.weights, options.workers,
        progress=lambda results, total: bar(results, total=total, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "family.csv"), "rows": len(table)} | _caution(samples)


def _incongruence(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import incongruence_table

    table = incongruence_table.study(
        dataset.load(options.data, options.holdout), options.out,
        options.variants or tuple(incongruence_table.MODELS), options.seeds or (0, 1, 2),
        options.weights, progress=lambda results, total: bar(results, total=total, desc="models"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / incongruence_table.FILE), "rows": len(table)}


def _closed_loop(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import closed_loop, episodes

    folder = Path(options.out)
    table = closed_loop.study(
        dataset.load(), folder, options.weights or "build/weights",
        options.variants or tuple(closed_loop.MODELS), options.seeds or (0, 1, 2),
        options.conditions or tuple(closed_loop.CONDITIONS), options.workers,
        progress=lambda results, total: bar(results, total=total, desc="jobs"),
    )  # fmt: skip
    episodes.keep(folder, table, options.weights or "build/weights")
    return {"table": str(folder / "closed_loop.csv"), "rows": len(table)}


STUDIES = {
    "supervision": _supervision, "family": _family, "eyes": _eyes, "eyes-ptae": _eyes_ptae,
    "incongruence": _incongruence, "closed-loop": _closed_loop,
}  # fmt: skip


def _caution(samples) -> dict:
    """What must stand beside scores on patterns that only stand in for the test set."""
    if samples.holdout is None:
        return {}
    return {"test_part": f"{samples.holdout} held-out training patterns, not the paper's test set"}


def _rounded(scores: dict) -> dict:
    return {name: round(value, 3) for name, value in scores.items()}


def _train_eye(options) -> dict:
    from ptae_lite import frames, vision

    recipe = vision.EyeRecipe(seed=options.seed)
    if options.epochs is not None:
        raise PTAEError("a CAE is trained by --steps, not by --epochs")
    if options.steps is not None:
        recipe = vision.EyeRecipe(seed=options.seed, steps=options.steps)
    eye = vision.make_eye("separated" if options.model == "cae" else "plain", options.code)
    images = frames.training_images(options.data)
    losses = vision.train_eye(
        eye, images, recipe, progress=lambda steps: bar(steps, desc="CAE", unit=" steps")
    )
    vision.save_eye(options.out, eye, recipe)
    return {"weights": str(options.out), "loss": round(sum(losses[-100:]) / len(losses[-100:]), 4)}


def parser() -> argparse.ArgumentParser:
    main = argparse.ArgumentParser(
        prog="python -m ptae_lite", description="Record, train and evaluate PTAE-lite's models."
    )
    commands = main.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name, run, text):
        made = commands.add_parser(
            name,
            help=text,
            description=text,
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
        made.set_defaults(run=run)
        made.add_argument("--json", action="store_true", help="print one line of JSON")
        return made

    record = command("record", do_record, "Record all 864 samples with the simulated robot.")
    record.add_argument("--out", default=RECORDING, help="folder to record into, or to go on with")
    record.add_argument("--workers", type=whole_number(1), default=2, help="processes side by side")

    features = command("features", do_features, "Turn all recorded frames into CAE features.")
    features.add_argument("--data", default=RECORDING, help="a recording's folder")
    features.add_argument("--eye", help="weights of a CAE (default: the stored one)")
    features.add_argument("--threads", type=whole_number(1), default=2, help="threads for the CAE")

    train = command("train", do_train, "Train a model and write its weights.")
    train.add_argument("model", choices=TRAINED, help="what to train")
    train.add_argument("--data", default="recording",
                       help=DATA_HELP)  # fmt: skip
    train.add_argument("--holdout", type=int, metavar="N", help=HOLDOUT_HELP)
    train.add_argument(
        "--seed", type=whole_number(0), default=0, help="seed of weights and batches"
    )
    train.add_argument("--epochs", type=int, help="epochs, but of a CAE (default: the recipe's)")
    train.add_argument("--labelled", type=float, metavar="PERCENT",
                       help="share of the training samples that have a label")  # fmt: skip
    train.add_argument("--held-out", action="store_true",
                       help="keep 18 training patterns aside and score on them")  # fmt: skip
    train.add_argument("--steps", type=int, help="steps of a CAE (default: the recipe's)")
    train.add_argument(
        "--code", type=whole_number(1), default=10, help="features of a CAE (a channel)"
    )
    train.add_argument("--set", action="append", metavar="NAME=VALUE",
                       help="a size or choice of the model, such as queries=action")  # fmt: skip
    train.add_argument(
        "--threads", type=whole_number(1), default=1, help="threads inside one training"
    )
    train.add_argument("--device", default="cpu", help="cpu, or a GPU such as cuda")
    train.add_argument("--out", required=True, help="safetensors file to write")

    test = command("evaluate", do_evaluate, "Score a trained model, in percent.")
    test.add_argument("weights", help="safetensors file that `train` wrote")
    test.add_argument("--data", default="recording",
                      help=DATA_HELP)  # fmt: skip
    test.add_argument("--holdout", type=int, metavar="N", help=HOLDOUT_HELP)
    test.add_argument("--split", default="test", choices=("test", "train", "held_out", "fit"))
    test.add_argument("--threads", type=whole_number(1), default=1, help="threads")

    study = command("study", do_study, "Run an experiment; rows that are there are not run again.")
    study.add_argument("name", choices=tuple(STUDIES), help="which experiment")
    study.add_argument("--data", default="recording",
                       help=DATA_HELP)  # fmt: skip
    study.add_argument("--holdout", type=int, metavar="N", help=HOLDOUT_HELP)
    study.add_argument("--shares", type=float, nargs="+", metavar="PERCENT",
                       help="supervision: which shares of labels")  # fmt: skip
    study.add_argument("--models", nargs="+", metavar="NAME", help="supervision: which models")
    study.add_argument("--modes", nargs="+", metavar="NAME",
                       help="supervision: samples, iterations")  # fmt: skip
    study.add_argument("--variants", nargs="+", metavar="NAME",
                       help="family, supervision: which variants; incongruence, closed-loop: "
                            "which models")  # fmt: skip
    study.add_argument("--conditions", nargs="+", metavar="NAME", help="closed-loop: which")
    study.add_argument("--seeds", type=whole_number(0), nargs="+", help="one training for each")
    study.add_argument("--workers", type=whole_number(1), default=1,
                       help="family, supervision, closed-loop: trainings side by side")  # fmt: skip
    study.add_argument("--cluster", metavar="ADDRESS",
                       help="supervision: a Dask scheduler whose workers do the trainings; on a "
                            "trusted network only")  # fmt: skip
    study.add_argument("--weights", metavar="FOLDER",
                       help="family, incongruence, closed-loop: keep the trained models here; "
                            "the last two do not train what is there")  # fmt: skip
    study.add_argument("--recording", default=RECORDING, help="eyes: a recording's folder")
    study.add_argument("--eyes", default="build/eyes",
                       help="eyes: folder of the CAEs and their features")  # fmt: skip
    study.add_argument(
        "--threads", type=whole_number(1), default=1, help="threads inside one training"
    )
    study.add_argument("--out", default="build/results", help="folder of the tables")
    return main


def main(arguments=None) -> int:
    options = parser().parse_args(arguments)
    return guarded(options.command, lambda: show(options))


def show(options) -> None:
    """Run a command and print what it found."""
    begun = time.perf_counter()
    result = options.run(options)
    result["seconds"] = round(time.perf_counter() - begun, 1)
    if options.json:
        print(json.dumps(result))
        return
    for name, value in result.items():
        print(f"{name:28} {value}")


if __name__ == "__main__":
    sys.exit(main())

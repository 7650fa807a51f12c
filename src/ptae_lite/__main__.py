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

from ptae_lite.errors import PTAEError

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
    if folder.resolve().is_relative_to(_data_folder()):
        raise PTAEError("data/ holds what the book is built on; record into build/recording/")
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
    parts = [
        vision.encode_images(eye, load_sequence(options.data, *sample).images)
        for sample in bar(samples_in_order(), desc="features", unit=" samples")
    ]
    path = Path(options.data) / "features.npz"
    write_features(path, parts, eye_file)
    return {"features": str(path), "frames": sum(len(part) for part in parts)}


def do_train(options) -> dict:
    torch.set_num_threads(options.threads)
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
    return STUDIES[options.name](options)


def _supervision(options) -> dict:
    from ptae_lite import dataset
    from ptae_lite.studies import supervision

    table = supervision.study(
        dataset.load(options.data), options.out, options.shares, options.seeds or (0,),
        progress=lambda jobs: bar(jobs, desc="trainings"),
    )  # fmt: skip
    return {"table": str(Path(options.out) / "supervision.csv"), "rows": len(table)}


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
    "closed-loop": _closed_loop,
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


def _data_folder() -> Path:
    from ptae_lite import artefacts

    return artefacts.DATA.resolve()


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
    record.add_argument("--workers", type=int, default=2, help="processes side by side")

    features = command("features", do_features, "Turn all recorded frames into CAE features.")
    features.add_argument("--data", default=RECORDING, help="a recording's folder")
    features.add_argument("--eye", help="weights of a CAE (default: the stored one)")
    features.add_argument("--threads", type=int, default=2, help="threads for the CAE")

    train = command("train", do_train, "Train a model and write its weights.")
    train.add_argument("model", choices=TRAINED, help="what to train")
    train.add_argument("--data", default="recording",
                       help=DATA_HELP)  # fmt: skip
    train.add_argument("--holdout", type=int, metavar="N", help=HOLDOUT_HELP)
    train.add_argument("--seed", type=int, default=0, help="seed of weights and batches")
    train.add_argument("--epochs", type=int, help="epochs, but of a CAE (default: the recipe's)")
    train.add_argument("--labelled", type=float, metavar="PERCENT",
                       help="share of the training samples that have a label")  # fmt: skip
    train.add_argument("--held-out", action="store_true",
                       help="keep 18 training patterns aside and score on them")  # fmt: skip
    train.add_argument("--steps", type=int, help="steps of a CAE (default: the recipe's)")
    train.add_argument("--code", type=int, default=10, help="features of a CAE (a channel)")
    train.add_argument("--set", action="append", metavar="NAME=VALUE",
                       help="a size or choice of the model, such as queries=action")  # fmt: skip
    train.add_argument("--threads", type=int, default=1, help="threads inside one training")
    train.add_argument("--device", default="cpu", help="cpu, or a GPU such as cuda")
    train.add_argument("--out", required=True, help="safetensors file to write")

    test = command("evaluate", do_evaluate, "Score a trained model, in percent.")
    test.add_argument("weights", help="safetensors file that `train` wrote")
    test.add_argument("--data", default="recording",
                      help=DATA_HELP)  # fmt: skip
    test.add_argument("--holdout", type=int, metavar="N", help=HOLDOUT_HELP)
    test.add_argument("--split", default="test", choices=("test", "train", "held_out", "fit"))
    test.add_argument("--threads", type=int, default=1, help="threads")

    study = command("study", do_study, "Run an experiment; rows that are there are not run again.")
    study.add_argument("name", choices=tuple(STUDIES), help="which experiment")
    study.add_argument("--data", default="recording",
                       help=DATA_HELP)  # fmt: skip
    study.add_argument("--holdout", type=int, metavar="N", help=HOLDOUT_HELP)
    study.add_argument("--shares", type=float, nargs="+", default=[2, 10, 50, 100],
                       help="supervision: labelled samples in percent")  # fmt: skip
    study.add_argument(
        "--variants",
        nargs="+",
        metavar="NAME",
        help="family: which rows; closed-loop: which models",
    )
    study.add_argument("--conditions", nargs="+", metavar="NAME", help="closed-loop: which")
    study.add_argument("--seeds", type=int, nargs="+", help="one training for each")
    study.add_argument(
        "--workers", type=int, default=1, help="family, closed-loop: trainings side by side"
    )
    study.add_argument(
        "--weights", metavar="FOLDER", help="family, closed-loop: keep the trained models here"
    )
    study.add_argument("--recording", default=RECORDING, help="eyes: a recording's folder")
    study.add_argument("--eyes", default="build/eyes",
                       help="eyes: folder of the CAEs and their features")  # fmt: skip
    study.add_argument("--threads", type=int, default=1, help="threads inside one training")
    study.add_argument("--out", default="build/results", help="folder of the tables")
    return main


def main(arguments=None) -> int:
    options = parser().parse_args(arguments)
    begun = time.perf_counter()
    try:
        result = options.run(options)
    except PTAEError as error:
        print(f"{options.command}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{options.command}: stopped; what was finished is kept", file=sys.stderr)
        return 130
    result["seconds"] = round(time.perf_counter() - begun, 1)
    if options.json:
        print(json.dumps(result))
    else:
        for name, value in result.items():
            print(f"{name:28} {value}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

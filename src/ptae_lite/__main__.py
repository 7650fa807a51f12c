"""The command line: `python -m ptae_lite COMMAND`. The table `COMMANDS` lists the commands.

Every command shows its progress on the error stream. With `--json` it prints its results as one
line.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from functools import partial
from pathlib import Path

import torch

from ptae_lite import renamed
from ptae_lite.cli import (
    RECORDING,
    bar,
    caution,
    data_options,
    guarded,
    refuse_data,
    whole_number,
)
from ptae_lite.errors import PTAEError
from ptae_lite.experiments import corrections
from ptae_lite.experiments.registry import STUDIES
from ptae_lite.files import check_writable, file_lock
from ptae_lite.models import MODELS
from ptae_lite.pipes import piped

CAES = {"cae": "separated", "plain-cae": "plain"}  # the kind of each
TRAINED = (*MODELS, *CAES)


def do_record(options) -> dict:
    """Run `record`; returns what it prints."""
    from ptae_lite.data import frames
    from ptae_lite.robot import recorder

    folder = Path(options.out)
    refuse_data(folder, RECORDING)
    done = list(folder.glob("sequences/*.npz"))
    samples = len(recorder.samples_in_order())
    left = samples - len(done)
    recorder.record(
        folder,
        workers=options.workers,
        progress=lambda runs: bar(runs, total=left, desc="recording", unit=" samples"),
    )
    frames.write(folder)
    return {"recording": str(folder), "samples": samples, "recorded_now": left}


def do_features(options) -> dict:
    """Run `features`; returns what it prints."""
    from ptae_lite import artefacts, vision
    from ptae_lite.data.samples import write_features
    from ptae_lite.robot.recorder import check_ours

    encoder_file = (
        Path(options.encoder) if options.encoder else artefacts.stored("weights/cae.safetensors")
    )
    encoder = vision.load_autoencoder(encoder_file)
    check_ours(options.data, same_scene=False)
    torch.set_num_threads(options.threads)
    path = Path(options.data) / "features.npz"
    with file_lock(options.data):
        progress = partial(bar, desc="features", unit=" samples")
        codes = vision.encode_recording(encoder, options.data, progress)
        write_features(path, codes, encoder_file)
    return {"features": str(path), "frames": len(codes)}


def do_train(options) -> dict:
    """Run `train`; returns what it prints."""
    torch.set_num_threads(options.threads)
    if options.out is None:
        seed = "" if options.model in CAES else f"_seed{options.seed}"  # as `Experiment.file`
        options.out = f"build/weights/{options.model.replace('-', '_')}{seed}.safetensors"
    refuse_data(options.out, "build/weights")
    check_writable(options.out)  # before the training, not after it
    if options.model in CAES:
        return _train_autoencoder(options)
    from ptae_lite.data.samples import load_samples
    from ptae_lite.evaluation import evaluate
    from ptae_lite.experiments.experiment import experiment
    from ptae_lite.experiments.labels import Labels

    samples = load_samples(options.data, options.holdout)
    asked = experiment(
        samples, options.model, settings(options.model, options.set or ()),
        {} if options.epochs is None else {"epochs": options.epochs}, options.seed,
        split="fit" if options.held_out else "train",
        labels=Labels() if options.labelled is None else Labels("random", options.labelled),
    )  # fmt: skip
    state = _state_file(options.out)
    trained = asked.fit(
        samples, unfinished=state, device=options.device,
        progress=lambda epochs: bar(epochs, desc=options.model.upper(), unit=" epochs"),
    )  # fmt: skip
    del trained.about["seconds"]  # so that the same command writes the same bytes
    asked.save(options.out, trained)
    state.unlink(missing_ok=True)
    scores = evaluate(trained, samples, "held_out") if options.held_out else {}
    made = {"weights": str(options.out), "steps": trained.about["steps"]}
    return made | _rounded(scores) | caution(samples)


def _state_file(out) -> Path:
    """The file from which a training that was stopped goes on."""
    return Path(f"{out}.unfinished")


def settings(model: str, given) -> dict:
    """What `given`, each NAME=VALUE, changes in the model's configuration.

    Raises:
        PTAEError: a name or a value that the configuration does not have.
    """
    config, found = vars(MODELS[model].config()), {}
    for setting in given:
        name, _, text = setting.partition("=")
        if name not in config:
            there = renamed.said_of([name], renamed.SETTINGS) or f"it has {', '.join(config)}"
            raise PTAEError(f"{model} has no setting {name!r}; {there}")
        kind = type(config[name])
        try:
            found[name] = (
                {"true": True, "false": False}[text.lower()] if kind is bool else kind(text)
            )
        except (KeyError, ValueError):
            wanted = {bool: "true or false", int: "a whole number", float: "a number"}[kind]
            raise PTAEError(f"{name} is {wanted}, not {text!r}") from None
    return found


def do_evaluate(options) -> dict:
    """Run `evaluate`; returns the scores in percent."""
    from ptae_lite.data.samples import load_samples
    from ptae_lite.evaluation import evaluate
    from ptae_lite.models import checkpoint

    torch.set_num_threads(options.threads)
    trained = checkpoint.load(options.weights)
    samples = load_samples(options.data, options.holdout)
    return _rounded(evaluate(trained, samples, options.split)) | caution(samples)


def _rounded(scores: dict) -> dict:
    return {name: round(value, 3) for name, value in scores.items()}


def _train_autoencoder(options) -> dict:
    from ptae_lite import vision
    from ptae_lite.data import frames

    recipe = vision.AutoencoderRecipe(seed=options.seed)
    if options.epochs is not None:
        raise PTAEError("a CAE is trained by --steps, not by --epochs")
    if options.steps is not None:
        recipe = vision.AutoencoderRecipe(seed=options.seed, steps=options.steps)
    encoder = vision.make_autoencoder(CAES[options.model], options.code)
    images = frames.training_images(options.data)
    state = _state_file(options.out)
    losses = vision.train_autoencoder(
        encoder, images, recipe, device=options.device, unfinished=state,
        progress=lambda steps: bar(steps, desc="CAE", unit=" steps"),
    )  # fmt: skip
    vision.save_autoencoder(options.out, encoder, recipe)
    state.unlink(missing_ok=True)
    return {"weights": str(options.out), "loss": round(sum(losses[-100:]) / len(losses[-100:]), 4)}


def do_study(options) -> dict:
    """Run a study; returns what it prints."""
    torch.set_num_threads(options.threads)
    refuse_data(options.out, "build/results")
    with file_lock(Path(options.out) / options.name):  # two would lose rows
        return STUDIES[options.name].command(options)


def record_options(made: argparse.ArgumentParser) -> None:
    """Add the options of `record`."""
    made.add_argument("--out", default=RECORDING, help="folder to record into, or to go on with")
    made.add_argument("--workers", type=whole_number(1), default=2, help="processes side by side")


def features_options(made: argparse.ArgumentParser) -> None:
    """Add the options of `features`."""
    made.add_argument("--data", default=RECORDING, help="a recording's folder")
    made.add_argument("--encoder", help="weights of a CAE (default: the stored one)")
    made.add_argument("--threads", type=whole_number(1), default=2, help="threads for the CAE")


def train_options(made: argparse.ArgumentParser) -> None:
    """Add the options of `train`."""
    made.add_argument("model", choices=TRAINED, help="what to train")
    data_options(made)
    made.add_argument("--seed", type=whole_number(0), default=0, help="seed of weights and batches")
    made.add_argument("--epochs", type=int, help="epochs, but of a CAE (default: the recipe's)")
    made.add_argument("--labelled", type=float, metavar="PERCENT",
                      help="share of the training samples that have a label")  # fmt: skip
    made.add_argument("--held-out", action="store_true",
                      help="keep the held-out patterns aside and score on them")  # fmt: skip
    made.add_argument("--steps", type=int, help="steps of a CAE (default: the recipe's)")
    made.add_argument(
        "--code", type=whole_number(1), default=10, help="features of a CAE (a channel)"
    )
    made.add_argument("--set", action="append", metavar="NAME=VALUE",
                      help="a size or choice of the model, such as queries=action")  # fmt: skip
    made.add_argument(
        "--threads", type=whole_number(1), default=1, help="threads inside one training"
    )
    made.add_argument("--device", default="cpu", help="cpu, or a GPU such as cuda")
    made.add_argument("--out", help="safetensors file to write (default: in build/weights)")


def evaluate_options(made: argparse.ArgumentParser) -> None:
    """Add the options of `evaluate`."""
    made.add_argument("weights", help="safetensors file that `train` wrote")
    data_options(made)
    made.add_argument("--split", default="test", choices=("test", "train", "held_out", "fit"))
    made.add_argument("--threads", type=whole_number(1), default=1, help="threads")


def study_options(made: argparse.ArgumentParser) -> None:
    """Add a parser for each of `STUDIES`, with the options that it understands."""
    studies = made.add_subparsers(dest="name", required=True, metavar="NAME")
    for name, study in STUDIES.items():
        one = subparser(studies, name, study.__doc__.strip().splitlines()[0])
        one.add_argument("--json", action="store_true", help="print one line of JSON")
        study.add_options(one)
        one.add_argument(
            "--threads", type=whole_number(1), default=1, help="threads inside one training"
        )
        one.add_argument("--out", default="build/results", help="folder of the tables")


COMMANDS = {  # the name of each, what does it, what declares its options, and its line in the help
    "record": (do_record, record_options, "Record all 864 samples with the simulated robot."),
    "features": (do_features, features_options, "Turn all recorded frames into CAE features."),
    "corrections": (
        corrections.command,
        corrections.add_options,
        "Record clips in which the planner is disturbed and corrects itself.",
    ),
    "train": (do_train, train_options, "Train a model and write its weights."),
    "evaluate": (do_evaluate, evaluate_options, "Score a trained model, in percent."),
    "study": (do_study, study_options, "Run an experiment; rows that are there are not run again."),
}


def subparser(parsers, name: str, text: str) -> argparse.ArgumentParser:
    """Add the parser of a command with one line of help."""
    shown = argparse.ArgumentDefaultsHelpFormatter
    return parsers.add_parser(name, help=text, description=text, formatter_class=shown)


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    known = argparse.ArgumentParser(
        prog="python -m ptae_lite", description="Record, train and evaluate PTAE-lite's models."
    )
    commands = known.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (run, add_options, text) in COMMANDS.items():
        made = subparser(commands, name, text)
        made.set_defaults(run=run)
        if name != "study":  # its own commands have this option
            made.add_argument("--json", action="store_true", help="print one line of JSON")
        add_options(made)
    return known


def main(arguments=None) -> int:
    """Run a command; returns its exit code."""
    known, arguments = parser(), sys.argv[1:] if arguments is None else list(arguments)
    old = renamed.said_of(
        (word.split("=")[0] for word in arguments), renamed.OPTIONS | renamed.VALUES
    )
    if old:
        known.error(old)
    options, others = known.parse_known_args(arguments)
    if others:
        command = " ".join(filter(None, (options.command, getattr(options, "name", None))))
        known.error(
            f"{command} does not understand {' '.join(others)}; "
            f"what it does: python -m ptae_lite {command} --help"
        )
    return guarded(options.command, lambda: show(options))


def show(options) -> None:
    """Run a command and print its results."""
    begun = time.perf_counter()
    result = options.run(options)
    result["seconds"] = round(time.perf_counter() - begun, 1)
    if options.json:
        print(json.dumps(result))
        return
    for name, value in result.items():
        print(f"{name:28} {value}")


if __name__ == "__main__":
    sys.exit(piped(main))

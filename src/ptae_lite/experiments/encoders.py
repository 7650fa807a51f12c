"""Encoders: does it help to separate the colour channels, with equal images seen or equal compute?

There are three CAEs with three seeds each, and three PCAs. Each CAE is one long training. At each
checkpoint, a copy of it runs through the last fifth of a training of that length
(`AutoencoderTrainer`). So a row of the table is the result of a training of exactly that length.
Linear probes on `held_out` patterns decide when a training has converged; those on `test` are for
the table.
"""

from __future__ import annotations

import copy
import time
from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch.utils.flop_counter import FlopCounterMode

from ptae_lite import artefacts, devices, vision
from ptae_lite.cli import RECORDING, bar
from ptae_lite.data import frames
from ptae_lite.data import samples as data
from ptae_lite.data.samples import Samples
from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.experiments import encoder_scores, options, tables
from ptae_lite.experiments.experiment import Experiment
from ptae_lite.files import write_arrays
from ptae_lite.vision import pca

CAES = {"separated 3x10": ("separated", 10), "plain 10": ("plain", 10), "plain 30": ("plain", 30)}
PCAS = {"PCA 3x10": ("pca-separated", 10), "PCA 10": ("pca", 10), "PCA 30": ("pca", 30)}
# In images seen; 0 is the untrained encoder. 166,960 images cost a plain CAE the arithmetic that
# 64,000 cost the separated one. The book's two encoders have seen 128,000.
CHECKPOINTS = {
    "separated 3x10": (0, 32_000, 64_000, 128_000),
    "plain 10": (0, 64_000, 128_000, 166_960),
    "plain 30": (0, 64_000, 166_960),
}
EQUAL_SAMPLES_SEEN = dict.fromkeys(CAES, 64_000)
EQUAL_COMPUTE = {"separated 3x10": 64_000, "plain 10": 166_960, "plain 30": 166_960}
LONG = {  # further ones, with `long`: a day on a CPU
    "separated 3x10": (256_000, 512_000, 1_024_000),
    "plain 10": (333_920, 667_840, 1_335_680),
    "plain 30": (333_920, 667_840, 1_335_680, 2_671_360),
}
IN_USE = {  # the lengths of the encoders that a PTAE is trained with
    "equal images seen": EQUAL_SAMPLES_SEEN,
    "equal compute": EQUAL_COMPUTE,
    "four times as long": {name: 4 * length for name, length in EQUAL_COMPUTE.items()},
    "eight times as long": {name: 8 * length for name, length in EQUAL_COMPUTE.items()},
}
FILE = "encoders.csv"
KEY = ["encoder", "seed", "samples_seen", "split", "device"]
PCA_EVERY = 8  # of the training images: 2,066 of them


def mflop_an_image(encoder) -> float:
    """Arithmetic of one training step for one image, in million floating-point operations."""
    with FlopCounterMode(display=False) as counter:
        vision.PixelCrossEntropy.apply(encoder.logits(torch.rand(2, 3, 120, 160)),
                                       torch.rand(2, 3, 120, 160)).backward()  # fmt: skip
    return counter.get_total_flops() / 2 / 1e6


class Bench:
    """What every encoder of the study is trained and scored on, and where its results go.

    Args:
        recording: folder of a recording, with its images.
        folder: gets `encoders.csv`.
        work: gets the weights of each encoder, and its features of all frames.
    """

    def __init__(self, samples: Samples, recording, folder, work):
        self.samples, self.recording = samples, recording
        self.table, self.work = Path(folder) / FILE, Path(work)
        self.images = frames.training_images(recording)
        self.looks = encoder_scores.look(recording, samples)

    def experiment_of(self, name: str, seed: int, steps: int | None = None) -> Experiment:
        """A training of `steps` steps. None: an unfinished training, before its rate falls."""
        (kind, code), recipe = CAES[name], vision.AutoencoderRecipe(seed=seed)
        recipe = replace(recipe, steps=steps or recipe.steps)
        split = "train" if steps else "train, unfinished"
        return Experiment(kind, {"code": code}, recipe, self.samples.fingerprint, split)

    def rows(self) -> pd.DataFrame:
        """The rows of the table so far."""
        return tables.read(self.table, KEY)

    def write(self, encoder, about: dict) -> None:
        """Add the two rows of an encoder, one for each split."""
        scores = encoder_scores.scores(encoder, self.looks, self.samples)
        made = [about | {"split": split} | found for split, found in scores.items()]
        tables.add(self.table, pd.DataFrame(made), KEY)

    def place(self, name: str, seed: int) -> Path:
        """The folder of an encoder's files; it is made if it does not exist."""
        folder = self.work / folder_of(name, seed)
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def weights(self, name: str, seed: int, samples_seen: int) -> Path:
        """The file of an encoder that has seen `samples_seen` images."""
        return self.place(name, seed) / f"encoder_{samples_seen}.safetensors"

    def write_features(self, name: str, seed: int, samples_seen: int) -> None:
        """Write the features of all recorded frames by that encoder, if they are missing."""
        weights = self.weights(name, seed, samples_seen)
        path = weights.with_name(f"features_{samples_seen}.npz")
        if not features_are_of(path, weights):
            codes = vision.encode_recording(vision.load_autoencoder(weights), self.recording)
            data.write_features(path, codes, weights)


def folder_of(name: str, seed: int) -> str:
    """The folder of an encoder's files, inside that of the study."""
    return f"{name.replace(' ', '_')}_seed{seed}"


def run_pca(bench: Bench, name: str) -> None:
    """Fit a PCA encoder; write its row, its weights and its features."""
    kind, code = PCAS[name]
    begun, some = time.process_time(), bench.images[::PCA_EVERY]
    encoder = pca.fit(vision.make_autoencoder(kind, code), some)
    seconds = time.process_time() - begun
    vision.save_autoencoder(bench.weights(name, 0, len(some)), encoder)
    bench.write_features(name, 0, len(some))
    bench.write(encoder, {"encoder": name, "code": code, "seed": 0, "samples_seen": len(some),
                      "gflop": np.nan, "seconds": round(seconds, 1), "device": "cpu"})  # fmt: skip


def run_cae(bench: Bench, name: str, seed: int, checkpoints, device: str = "cpu"):
    """Train a CAE to all `checkpoints` (numbers of images seen), with a row for each missing one.

    A training that was stopped goes on from the last state with a constant rate.

    Raises:
        ConfigError: the stored training is already past a missing checkpoint.
    """
    kind, code = CAES[name]
    encoder, recipe = vision.make_autoencoder(kind, code), vision.AutoencoderRecipe(seed=seed)
    training = vision.AutoencoderTrainer(encoder, recipe, device)
    trunk, asked = bench.place(name, seed) / "trunk.safetensors", bench.experiment_of(name, seed)
    spent = restore(training, trunk, asked.hash) if trunk.exists() else 0.0
    rows = bench.rows()
    done = rows[(rows["encoder"] == name) & (rows["seed"] == seed)]["samples_seen"].tolist()
    gflop = mflop_an_image(vision.make_autoencoder(kind, code)) / 1e3
    for samples_seen in sorted(set(checkpoints) - set(done)):
        steps = samples_seen // recipe.batch
        turn = round((1 - vision.DECAY) * steps)
        if turn < training.step:
            raise ConfigError(
                f"{name}, seed {seed}, has been trained past {samples_seen} presentations; "
                f"delete {trunk} to begin again"
            )
        begun = devices.clock(device)
        training.go(bench.images, turn, value=False)
        spent += devices.clock(device) - begun
        keep(training, trunk, spent, asked.hash)
        branch, begun = copy.deepcopy(training), devices.clock(device)
        branch.go(bench.images, steps, steps, value=False)
        seconds = spent + devices.clock(device) - begun
        branch.encoder.to("cpu").eval()
        if steps:
            own = bench.experiment_of(name, seed, steps)
            path = bench.weights(name, seed, samples_seen)
            vision.save_autoencoder(path, branch.encoder, own.recipe, device, experiment=own.hash)
        bench.write(branch.encoder, {
            "encoder": name, "code": code, "seed": seed, "samples_seen": samples_seen,
            "gflop": round(samples_seen * gflop, 1), "seconds": round(seconds, 1),
            "device": device,
        })  # fmt: skip


def keep(
    training: vision.AutoencoderTrainer, path: Path, spent: float, experiment: str = ""
) -> None:
    """Store the state of a training: weights, the optimiser's state, the step and the seconds."""
    tensors = {f"encoder.{name}": value for name, value in training.encoder.state_dict().items()}
    for i, memory in training.optimiser.state_dict()["state"].items():
        tensors |= {f"memory.{i}.{name}": value for name, value in memory.items()}
    about = {"kind": "training of an encoder", "step": training.step, "seconds": spent}
    about |= {"experiment": experiment}
    artefacts.save_weights(path, tensors, about)


def restore(training: vision.AutoencoderTrainer, path: Path, experiment: str = "") -> float:
    """Set a fresh training to the state that `keep` stored, and return its seconds.

    Raises:
        ArtefactError: the file is of another experiment.
    """
    tensors, about = artefacts.load_weights(path)
    if about.get("experiment") != experiment:
        raise ArtefactError(
            f"{path} is of another training than the one asked for; move it away, or name another "
            "folder of encoders"
        )
    weights, memory = {}, {}
    for name, value in tensors.items():
        part, rest = name.split(".", 1)
        if part == "encoder":
            weights[rest] = value
        else:
            i, what = rest.split(".")
            memory.setdefault(int(i), {})[what] = value
    training.encoder.load_state_dict(weights)
    state = training.optimiser.state_dict()
    training.optimiser.load_state_dict(state | {"state": memory})
    training.step = about["step"]
    return about["seconds"]


def study(samples: Samples, recording, folder, work, seeds=(0, 1, 2), checkpoints=None,
          workers: int = 1, device: str = "cpu", long: bool = False,
          progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Make what is missing in `encoders.csv`: all CAEs of one seed, then of the next, then PCAs.

    Args:
        recording: folder of a recording, with its images.
        folder: folder of the table.
        work: folder for weights, features and unfinished trainings.
        checkpoints: numbers of images seen, by name of the CAE; None for `CHECKPOINTS`.
        workers: number of processes.
        device: where CAEs are trained. They are scored on the CPU.
        long: also train to the lengths in `LONG`. The reconstructions stay those of `checkpoints`.
    """
    drawn, bench = checkpoints or CHECKPOINTS, Bench(samples, recording, folder, work)
    further = LONG if long else {}
    jobs = [
        (bench, name, seed, own, further.get(name, ()), device)
        for seed in seeds for name, own in drawn.items()
    ]  # fmt: skip
    jobs += [(bench, name) for name in PCAS if name not in set(bench.rows()["encoder"])]
    tables.run(run_one, jobs, lambda _: None, workers, progress)
    write_reconstructions(bench, seeds[0], drawn)
    return bench.rows()


def run_one(bench: Bench, name: str, seed: int = 0, checkpoints=(), further=(),
            device: str = "cpu") -> None:  # fmt: skip
    """Make an encoder's rows and weights, and the features for PTAE.

    Features are written for the lengths in `IN_USE` that it reaches.
    """
    if name in PCAS:
        return run_pca(bench, name)
    run_cae(bench, name, seed, (*checkpoints, *further), device)
    in_use = {lengths[name] for lengths in IN_USE.values()}
    for samples_seen in in_use & {*checkpoints, *further}:
        bench.write_features(name, seed, samples_seen)


def write_reconstructions(bench: Bench, seed: int, checkpoints) -> None:
    """Write `encoder_reconstructions.npz`: the images `DRAWN`, reconstructed by each encoder."""
    paths = {name: bench.weights(name, seed, max(own)) for name, own in checkpoints.items()}
    some = len(bench.images[::PCA_EVERY])
    paths |= {name: bench.weights(name, 0, some) for name in PCAS}
    shown = {
        name: encoder_scores.drawn(vision.load_autoencoder(path)) for name, path in paths.items()
    }
    write_arrays(bench.table.with_name("encoder_reconstructions.npz"), **shown)


def features_are_of(path: Path, weights: Path) -> bool:
    """Whether a file of features was made by the encoder in `weights`."""
    if not path.exists():
        return False
    with np.load(path, allow_pickle=False) as file:
        return str(file["encoder"]) == artefacts.sha256(weights)


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    options.trainings(parser, cluster=False)
    parser.add_argument("--recording", default=RECORDING, help="a recording's folder")
    parser.add_argument("--encoders", default="build/encoders",
                        help="folder of the CAEs and their features")  # fmt: skip
    parser.add_argument("--device", default="cpu",
                        help="where CAEs are trained, cpu or a GPU such as cuda")  # fmt: skip
    parser.add_argument("--long", action="store_true",
                        help="train the CAEs much further, for hours on a CPU")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    table = study(
        data.load_unseen(given.recording), given.recording, given.out, given.encoders, given.seeds,
        workers=given.workers, device=given.device, long=given.long,
        progress=lambda results, total: bar(results, total=total, desc="encoders"),
    )  # fmt: skip
    return options.result(given, FILE, table)

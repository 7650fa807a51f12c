"""Encoders: does it help to separate the colour channels, with equal images seen or equal compute?

There are three CAEs with three seeds each, and three PCAs. Each CAE is one long training. At each
checkpoint, a copy of it runs through the last fifth of a training of that length
(`encoder_training`). So a row of the table is the result of a training of exactly that length.
Linear probes on `held_out` patterns decide when a training has converged; those on `test` are for
the table.
"""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from torch.utils.flop_counter import FlopCounterMode

from ptae_lite import artefacts, vision
from ptae_lite.cli import RECORDING, bar
from ptae_lite.data import frames
from ptae_lite.data import samples as data
from ptae_lite.data.samples import Samples
from ptae_lite.experiments import encoder_scores, options, tables
from ptae_lite.experiments.encoder_training import (
    PCA_EVERY,
    CAETraining,
    EncoderTraining,
    LongTraining,
    PCARecipe,
    PCATraining,
    TrainedEncoder,
)
from ptae_lite.experiments.runner import Study, run
from ptae_lite.files import write_arrays

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
RECONSTRUCTIONS = "encoder_reconstructions.npz"
KEY = ["encoder", "seed", "samples_seen", "split", "device"]


def mflop_an_image(encoder) -> float:
    """Arithmetic of one training step for one image, in million floating-point operations."""
    with FlopCounterMode(display=False) as counter:
        vision.PixelCrossEntropy.apply(encoder.logits(torch.rand(2, 3, 120, 160)),
                                       torch.rand(2, 3, 120, 160)).backward()  # fmt: skip
    return counter.get_total_flops() / 2 / 1e6


class Bench(NamedTuple):
    """What every encoder of the study is trained and scored on.

    Args:
        samples: the samples of the recording.
        images: images of training patterns, (M, 120, 160, 3) bytes.
        looks: the images that are scored, as `encoder_scores.look` gives them.
        lengths: numbers of images seen, in order, by name of the CAE.
        device: where CAEs are trained. They are scored on the CPU.
    """

    samples: Samples
    images: np.ndarray
    looks: np.ndarray
    lengths: dict
    device: str


def experiment_of(bench: Bench, name: str, seed: int, samples_seen: int) -> EncoderTraining | None:
    """The training of an encoder; None for an untrained one."""
    kind, code = (CAES | PCAS)[name]

    def made(training, recipe, **more) -> EncoderTraining:
        return training(kind, {"code": code}, recipe, bench.samples.fingerprint, name=name, **more)

    if name in PCAS:
        return made(PCATraining, PCARecipe(samples_seen))
    base = recipe = None
    for length in sorted(n for n in bench.lengths[name] if 0 < n <= samples_seen):
        recipe = vision.AutoencoderRecipe(seed=seed)
        recipe = replace(recipe, steps=length // recipe.batch)
        until = replace(recipe, steps=round((1 - vision.DECAY) * recipe.steps))
        base = made(LongTraining, until, split="train, unfinished", base=base, device=bench.device)
    return recipe and made(CAETraining, recipe, base=base, device=bench.device)


def score(
    trained: TrainedEncoder | None, bench: Bench, name: str, seed: int, samples_seen: int
) -> pd.DataFrame:
    """The two rows of an encoder, one for each split."""
    kind, code = (CAES | PCAS)[name]
    if trained is None:
        fresh, recipe = vision.make_autoencoder(kind, code), vision.AutoencoderRecipe(seed=seed)
        encoder = vision.AutoencoderTrainer(fresh, recipe).encoder.eval()
        trained = TrainedEncoder(encoder, {"seconds": 0.0, "device": bench.device})
    gflop = np.nan
    if name in CAES:
        gflop = samples_seen * (mflop_an_image(vision.make_autoencoder(kind, code)) / 1e3)
    row = {
        "encoder": name, "code": code, "seed": seed, "samples_seen": samples_seen,
        "gflop": round(gflop, 1), "seconds": round(trained.about["seconds"], 1),
        "device": trained.about["device"],
    }  # fmt: skip
    scores = encoder_scores.scores(trained.encoder, bench.looks, bench.samples)
    return pd.DataFrame([row | {"split": split} | found for split, found in scores.items()])


STUDY = Study(FILE, KEY[:3], experiment_of, score, order=KEY)


def study(
    samples: Samples, recording, folder, work, seeds=(0, 1, 2), checkpoints=None,
    device: str = "cpu", long: bool = False, features: bool = True, **where,
) -> pd.DataFrame:  # fmt: skip
    """Make what is missing in `encoders.csv`: all CAEs of one seed, then of the next, then PCAs.

    Args:
        recording: folder of a recording, with its images.
        folder: folder of the table.
        work: folder for weights, features and unfinished trainings.
        checkpoints: numbers of images seen, by name of the CAE; None for `CHECKPOINTS`.
        device: where CAEs are trained. They are scored on the CPU.
        long: also train to the lengths in `LONG`. The reconstructions stay those of `checkpoints`.
        features: also write the features of the encoders in `IN_USE` and of the PCAs.
        where: where the work is done, see `tables.run`.
    """
    drawn, further = checkpoints or CHECKPOINTS, LONG if long else {}
    lengths = {name: sorted({*own, *further.get(name, ())}) for name, own in drawn.items()}
    images, looks = frames.training_images(recording), encoder_scores.look(recording, samples)
    bench = Bench(samples, images, looks, lengths, device)
    pcas = [(name, 0, len(images[::PCA_EVERY])) for name in PCAS]
    caes = [(name, seed, n) for seed in seeds for name, own in lengths.items() for n in own]
    table = run(STUDY, bench, caes + pcas, folder, work, **where)

    def weights(job) -> Path:
        return Path(work) / experiment_of(bench, *job).file

    used = {(name, length) for one in IN_USE.values() for name, length in one.items()}
    seen = [weights(job) for job in caes if (job[0], job[2]) in used] + [*map(weights, pcas)]
    if features:
        tables.run(write_features, [(path, recording) for path in seen], lambda _: None, **where)
    longest = [(name, seeds[0], max(own)) for name, own in drawn.items()]
    shown = {job[0]: weights(job) for job in longest + pcas}
    write_reconstructions(Path(folder) / RECONSTRUCTIONS, shown)
    return table


def write_features(weights: Path, recording) -> None:
    """Write the features of all recorded frames by an encoder beside it, if they are missing."""
    path = weights.with_name(weights.stem.replace("encoder", "features") + ".npz")
    if not features_are_of(path, weights):
        codes = vision.encode_recording(vision.load_autoencoder(weights), recording)
        data.write_features(path, codes, weights)


def write_reconstructions(path: Path, encoders: dict[str, Path]) -> None:
    """Write the images `DRAWN`, reconstructed by each encoder. `encoders` has their weights."""
    shown = {
        name: encoder_scores.drawn(vision.load_autoencoder(weights))
        for name, weights in encoders.items()
    }
    write_arrays(path, **shown)


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
    parser.add_argument("--no-features", action="store_true",
                        help="leave out the features for encoders-in-use")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    table = study(
        data.load_unseen(given.recording), given.recording, given.out, given.encoders, given.seeds,
        device=given.device, long=given.long, features=not given.no_features,
        workers=given.workers,
        progress=lambda results, total: bar(results, total=total, desc="encoders"),
    )  # fmt: skip
    return options.result(given, FILE, table)

"""Where do the features say the cubes are? Readers of places, on recorded and on moved cubes.

Readers learn from the recorded and the corrected clips of `fit` and are scored on those of
`held_out`, in the frames before the arm touches the named cube. In `moved` clips a cube was moved,
and only the frames after it count.
"""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from ptae_lite import devices
from ptae_lite.data import demonstrations
from ptae_lite.data import samples as data
from ptae_lite.data.clips import load_clips
from ptae_lite.data.demonstrations import Demonstrations
from ptae_lite.data.samples import Samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.experiments import options, tables
from ptae_lite.language import SIDES
from ptae_lite.models.ptae import PTAEConfig
from ptae_lite.models.watching import Watcher, WatcherConfig
from ptae_lite.vision import probes
from ptae_lite.watching_training import Prepared, WatchingRecipe, fit_places

FILE = "places.csv"
KEY = ["reader", "clips", "seed"]
READERS = ("guess", "linear", "network")
AXES = tuple(f"{side}_{axis}" for side in SIDES for axis in "xy")


def study(samples: Samples, folder, clips, seeds=(0,)) -> pd.DataFrame:
    """Make `places.csv` in a folder and return it.

    Raises:
        RecordingError: there are no corrected clips in the folder `clips`.
    """
    corrected = load_clips(clips)
    learn, moved = (corrected.of(samples.split(name)) for name in ("fit", "held_out"))
    scaling = fit_scaling(samples, samples.split("fit"))
    recorded = [
        demonstrations.recorded(samples, samples.split(name)) for name in ("fit", "held_out")
    ]
    known = demonstrations.joined([recorded[0], demonstrations.corrected(learn)])
    known = Prepared.of(known, scaling)
    moved = moved.where(moved.success & (moved.event >= 0))
    asked = {
        "recorded": (recorded[1], recorded[1].before_touch),
        "moved": _after_event(demonstrations.corrected(moved), moved.event),
    }
    rows = []
    for name, (shown, counted) in asked.items():
        given = Prepared.of(shown, scaling)
        for seed in seeds:
            for reader, places in _readers(known, given, seed).items():
                off = 1000 * (places - given.places_m.numpy())[counted].reshape(-1, len(AXES))
                errors = np.sqrt((off**2).mean(0))
                rows += [
                    {"reader": reader, "clips": name, "seed": seed, "axis": axis,
                     "error_mm": round(float(error), 2)}
                    for axis, error in zip(AXES, errors, strict=True)
                ]  # fmt: skip
    table = pd.DataFrame(rows)
    tables.add(Path(folder) / FILE, table, KEY)
    return table


def _after_event(shown: Demonstrations, event):
    """The clips, and which of their frames lie between the move and the touch."""
    frame = np.arange(shown.features.shape[1])
    return shown, shown.before_touch & (frame >= event[:, None])


def _readers(known: Prepared, given: Prepared, seed: int) -> dict[str, np.ndarray]:
    """What each reader says of each frame: places (C, T, 2, 2) in metres."""
    free = known.before_touch
    true = known.places_m[free].flatten(1).double().numpy()
    linear = probes.fit_regression(known.features[free].numpy(), true)
    shape = given.places_m.shape
    flat = given.features.flatten(0, 1).numpy()
    with devices.seeded(seed, "cpu"):
        model = Watcher(WatcherConfig(ptae=PTAEConfig(features=known.features.shape[2])))
        fit_places(model, known, WatchingRecipe(seed=seed))
    with torch.no_grad():
        network = model.places(given.features).numpy()
    said = (np.broadcast_to(true.mean(0), (len(flat), len(AXES))), linear.numbers(flat), network)
    return {name: np.reshape(one, shape) for name, one in zip(READERS, said, strict=True)}


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    parser.add_argument("--clips", metavar="FOLDER", default="build/corrections",
                        help="of corrected clips")  # fmt: skip
    parser.add_argument("--seeds", type=int, nargs="+", default=(0,), metavar="SEED",
                        help="of the network")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    table = study(data.load_samples(), given.out, given.clips, given.seeds)
    return options.result(given, FILE, table)

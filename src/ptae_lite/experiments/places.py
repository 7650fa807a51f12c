"""Where do the features say the cubes are? Readers of places, on recorded and on moved cubes.

Readers learn from the recorded and the corrected clips of `fit` and are scored on those of
`held_out`: on the named cube, in the frames before the arm touches it. (The other one may be hidden
by the arm, and nobody needs it.) In `moved` clips a cube was moved, and only the frames after it
count.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

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
    for seed in seeds:
        readers = _readers(known, seed)
        for name, (shown, counted) in asked.items():
            given = Prepared.of(shown, scaling)
            for reader, read in readers.items():
                off = 1000 * (read(given.features) - given.places_m.numpy())
                for number, side in enumerate(SIDES):
                    own = off[counted & (shown.side == number)[:, None], number]
                    errors = np.sqrt((own**2).mean(0))
                    rows += [
                        {"reader": reader, "clips": name, "seed": seed, "axis": f"{side}_{axis}",
                         "error_mm": round(float(error), 2)}
                        for axis, error in zip("xy", errors, strict=True)
                    ]  # fmt: skip
    table = pd.DataFrame(rows)
    tables.add(Path(folder) / FILE, table, KEY)
    return table


def _after_event(shown: Demonstrations, event):
    """The clips, and which of their frames lie between the move and the touch."""
    frame = np.arange(shown.features.shape[1])
    return shown, shown.before_touch & (frame >= event[:, None])


def _readers(known: Prepared, seed: int) -> dict[str, Callable]:
    """The readers: each makes places (C, T, 2, 2) in metres of scaled features (C, T, F)."""
    free = known.before_touch
    true = known.places_m[free].flatten(1).double().numpy()
    linear = probes.fit_regression(known.features[free].numpy(), true)
    with devices.seeded(seed, "cpu"):
        model = Watcher(WatcherConfig(ptae=PTAEConfig(features=known.features.shape[2])))
        fit_places(model, known, WatchingRecipe(seed=seed))

    def by_map(features):
        read = linear.numbers(features.flatten(0, 1).numpy())
        return read.reshape(*features.shape[:2], 2, 2)

    mean = true.mean(0).reshape(2, 2)
    return {
        "guess": lambda features: np.broadcast_to(mean, (*features.shape[:2], 2, 2)),
        "linear": by_map,
        "network": lambda features: model.places(features).detach().numpy(),
    }


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

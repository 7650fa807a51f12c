"""One test clip's answers under each conflict, kept so that a page without a model can show them.

    python -m ptae_lite.studies.stories             # into build/results, to look at
    python -m ptae_lite.studies.stories --store     # into data/results, with provenance

The command asks the stored PTAE, and has to be run again when its weights are replaced. It also
keeps the table of `incongruence.run`, from which the same pages read the scores.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float

from ptae_lite import artefacts, dataset
from ptae_lite.dataset import Samples
from ptae_lite.errors import PTAEError
from ptae_lite.language import pattern
from ptae_lite.models import checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.signals import Source
from ptae_lite.studies import incongruence

MODEL = "weights/ptae.safetensors"
TABLE, TOLD, JOINTS = "incongruence.csv", "incongruence_stories.csv", "incongruence_joints.npz"
NOTHING = {"aspects": "", "answer": "", "asked": ""}  # an empty text in a CSV file reads as a gap


@dataclass(frozen=True, eq=False)
class Stories:
    """What one clip was answered: a row of `told` for each signal and choice of conflicts.

    Motions stand in `joints` (R, 99, 5), in radians from the second frame on; the column `track`
    says which is a row's. `truth` (T, 5) is the recorded motion from there.
    """

    told: pd.DataFrame
    joints: Float[np.ndarray, "R 99 5"]
    truth: Float[np.ndarray, "T 5"]

    def of(self, signal: str, conflicts: int) -> pd.DataFrame:
        """The rows of one signal and number of conflicts; for none, the control as well."""
        told = self.told
        return told[(told["signal"] == signal) & (told["conflicts"] == conflicts)]


def tell(trained: Trained, samples: Samples, index: int) -> Stories:
    """Ask a model for all four signals of one sample, under every choice of conflicts."""
    source, rows, motions = Source(trained.dataset(samples)), [], []
    shown = pattern(int(samples.pattern[index]))
    for signal, place in incongruence.EXTRA_INPUT.items():
        choices = [None, *(a for n in range(4) for a in incongruence.conflict_sets(signal, n))]
        for aspects in choices:
            told = incongruence.story(trained, source, index, signal, aspects)
            where = "none" if aspects is None else place if aspects else "congruent"
            joints = told.pop("joints", None)
            rows.append({
                "signal": signal, "conflict_in": where, "conflicts": len(aspects or ()),
                "aspects": " ".join(aspects or ()), "sample": index,
                "shown": f"{shown.action} {shown.side} cube {shown.speed} "
                         f"(left {shown.left}, right {shown.right})",
                "extra": told["extra"], "asked": told.get("asked", ""),
                "answer": told.get("answer", ""), "right": told.get("right", False),
                "track": -1 if joints is None else len(motions),
            })  # fmt: skip
            if joints is not None:
                motions.append(joints.astype(np.float32))
    return Stories(pd.DataFrame(rows), np.stack(motions), _truth(samples, index))


def _truth(samples: Samples, index: int) -> Float[np.ndarray, "T 5"]:
    return samples.joints[index, 1 : samples.frames[index]]


def write(folder, trained: Trained, samples: Samples) -> list[Path]:
    """Write the table of all test clips, and the stories of the first one."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    stories = tell(trained, samples, int(samples.split("test")[0]))
    incongruence.run(trained, samples).round(3).to_csv(folder / TABLE, index=False)
    stories.told.to_csv(folder / TOLD, index=False)
    np.savez_compressed(folder / JOINTS, joints=stories.joints)
    return [folder / name for name in (TABLE, TOLD, JOINTS)]


def load(samples: Samples, find=lambda name: artefacts.stored(f"results/{name}")):
    """The stored table and stories, as (DataFrame, Stories); `find` gives each file's path."""
    table = pd.read_csv(find(TABLE)).fillna({"aspects": ""})
    told = pd.read_csv(find(TOLD)).fillna(NOTHING)
    with np.load(find(JOINTS)) as file:
        joints = file["joints"]
    return table, Stories(told, joints, _truth(samples, int(told["sample"].iloc[0])))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Keep the stored PTAE's answers under conflict.")
    parser.add_argument("--store", action="store_true", help="into data/results, with provenance")
    parser.add_argument("--out", default="build/results", help="folder, without --store")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    begun = time.perf_counter()
    try:
        trained, samples = checkpoint.load(artefacts.stored(MODEL)), dataset.load("recording")
        folder = artefacts.DATA / "results" if options.store else options.out
        for path in write(folder, trained, samples):
            print(f"wrote {path.name}, {path.stat().st_size / 1e3:.0f} kB")
            if options.store:
                artefacts.register(
                    f"results/{path.name}",
                    command="python -m ptae_lite.studies.stories --store",
                    seed=0,
                    minutes=(time.perf_counter() - begun) / 60,
                )
    except PTAEError as error:
        print(f"stories: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""The answers for one test clip under each condition, stored for pages without a model.

::

    python -m ptae_lite.experiments.conflict_examples           # into build/results, to look at
    python -m ptae_lite.experiments.conflict_examples --store   # into data/results, with origin

The command runs the stored PTAE of chapter 05; run it again when its weights change. It takes
pictures of the clip and its distractors from a recording's folder (`python -m ptae_lite record`).
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float, UInt8
from PIL import Image

from ptae_lite import artefacts
from ptae_lite.data.samples import Samples, load_samples
from ptae_lite.data.signals import Source
from ptae_lite.errors import PTAEError
from ptae_lite.evaluation import poses, sentences
from ptae_lite.experiments import answer_source
from ptae_lite.experiments.incongruence import (
    ANSWERS_WORDS,
    EXTRA_INPUT,
    Condition,
    conditions,
    extra_inputs,
    respond_under,
)  # fmt: skip
from ptae_lite.files import atomic_write, write_arrays
from ptae_lite.language import ACTIONS, SIDES, SPEEDS, pattern, pattern_at
from ptae_lite.models import checkpoint
from ptae_lite.models.checkpoint import Trained
from ptae_lite.pipes import piped

MODEL = "weights/ptae_adam.safetensors"
ANSWERS, KEPT = "incongruence_examples.csv", "incongruence_examples.npz"
KEY = ["sample", "signal", "conflict_in", "conflicts", "aspects"]
SHOTS, SHOT_PX = 6, (80, 60)  # pictures in a row, and their width and height
TEXTS = {"aspects": "", "sentence": "", "answer": ""}  # pandas reads empty texts as NaN


@dataclass(frozen=True, eq=False)
class ConflictExamples:
    """The answers for one clip under each condition.

    Attributes:
        index: the sample number.
        answers: a row for each condition. Its column `track` is the row of `joints`, or -1.
        joints: motions in radians, from the second frame on.
        strips: pictures of the 12 actions, by `Pattern.action_index`, in the clip's arrangement and
            of its variation number, evenly spaced from the first to the last frame.
    """

    index: int
    answers: pd.DataFrame
    joints: Float[np.ndarray, "R 99 5"]
    strips: UInt8[np.ndarray, "12 shots height width 3"]

    def of(self, condition: Condition):
        """The row of a condition."""
        answers, (signal, place, aspects) = self.answers, condition
        which = (answers["signal"] == signal) & (answers["conflict_in"] == place)
        (row,) = answers[which & (answers["aspects"] == " ".join(aspects))].itertuples()
        return row


def tell(trained: Trained, samples: Samples, index: int, strips, seed: int = 0) -> ConflictExamples:
    """A model's answers to all four signals of one sample, under every condition."""
    source, rows, motions = Source(trained.dataset(samples)), [], []
    means = answer_source.Motions(samples, trained.scaling)
    for condition in (c for signal in EXTRA_INPUT for c in conditions(signal)):
        signal, place, aspects = condition
        # draw for all test clips, as the table does; only this one is asked
        (extra,) = _drawn(samples, index, condition, seed)
        answer = respond_under(trained, source, [index], condition, extra=[extra])
        ((what, distance),) = answer_source.decoded_answers(answer, samples, [index], signal, means)
        (within,) = answer_source.within([(what, distance)], means.reach)
        truth = answer_source.truth_of(samples, index, signal)
        distractor = answer_source.distractor_of(samples, index, extra, condition)
        words = signal in ANSWERS_WORDS
        answers = (
            sentences(answer)[0] if words else f"{what.action} the {what.cube} cube {what.speed}"
        )
        rows.append({
            "sample": index, "signal": signal, "conflict_in": place, "conflicts": len(aspects),
            "aspects": " ".join(aspects),
            "sentence": extra if EXTRA_INPUT[signal] == "language" else "",
            "clip": extra if EXTRA_INPUT[signal] == "action" else -1,
            "answer": answers, "distance": round(distance, 2),
            "source": answer_source.follows(within, truth, distractor),
            "track": -1 if words else len(motions),
        })  # fmt: skip
        if not words:
            motions.append(poses(answer, trained.scaling)[0].astype(np.float32))
    return ConflictExamples(index, pd.DataFrame(rows), np.stack(motions), strips)


def _drawn(samples: Samples, index: int, condition: Condition, seed: int) -> list:
    indices = samples.split("test")
    drawn = extra_inputs(samples, indices, condition, seed)
    return [drawn[int(np.flatnonzero(indices == index)[0])]]


def picture_strips(
    folder, samples: Samples, index: int
) -> UInt8[np.ndarray, "12 shots height width 3"]:
    """Small pictures for `ConflictExamples.strips`, from a recording's folder.

    Raises:
        RecordingError: the folder is not a recording of ours, or a sequence is missing.
    """
    from ptae_lite.robot.recorder import check_ours, load_sequence

    check_ours(folder, same_scene=False)
    arrangement = pattern(int(samples.pattern[index])).arrangement
    strips = []
    for speed, side, action in product(SPEEDS, SIDES, ACTIONS):
        shown = pattern_at(arrangement, side, action, speed)
        images = load_sequence(folder, shown.index, int(samples.variation[index])).images
        at = np.linspace(0, shown.frames - 1, SHOTS).round().astype(int)
        strips.append([np.array(Image.fromarray(images[t]).resize(SHOT_PX)) for t in at])
    return np.array(strips)


def write(folder, trained: Trained, samples: Samples, strips) -> list[Path]:
    """Write the examples of the first test clip, and return the paths of the two files."""
    answers, kept = (Path(folder) / name for name in (ANSWERS, KEPT))
    examples = tell(trained, samples, int(samples.split("test")[0]), strips)
    with atomic_write(answers) as temporary:
        examples.answers.to_csv(temporary, index=False, lineterminator="\n")
    write_arrays(kept, joints=examples.joints, strips=strips)
    return [answers, kept]


def load(find=lambda name: artefacts.stored(f"results/{name}")) -> ConflictExamples:
    """The stored examples. `find` returns the path of a file."""
    answers = pd.read_csv(find(ANSWERS)).fillna(TEXTS)
    with np.load(find(KEPT)) as file:
        return ConflictExamples(
            int(answers["sample"].iloc[0]), answers, file["joints"], file["strips"]
        )


def main(arguments: list[str] | None = None) -> int:
    """Write the examples; returns the exit code."""
    parser = argparse.ArgumentParser(description="Keep the stored PTAE's answers under conflict.")
    parser.add_argument("--store", action="store_true", help="into data/results, with provenance")
    parser.add_argument("--out", default="build/results", help="folder, without --store")
    parser.add_argument("--recording", default="build/recording", help="a recording's folder")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    begun = time.perf_counter()
    try:
        trained, samples = checkpoint.load(artefacts.stored(MODEL)), load_samples("recording")
        strips = picture_strips(options.recording, samples, int(samples.split("test")[0]))
        folder = artefacts.data_folder() / "results" if options.store else options.out
        for path in write(folder, trained, samples, strips):
            print(f"wrote {path.name}, {path.stat().st_size / 1e3:.0f} kB")
            if options.store:
                artefacts.register(
                    f"results/{path.name}",
                    command="python -m ptae_lite.experiments.conflict_examples --store",
                    seed=0,
                    minutes=(time.perf_counter() - begun) / 60,
                )
    except PTAEError as error:
        print(f"stories: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(piped(main))

#!/usr/bin/env python3
"""How long the book's jobs take here, and how well the result does, beside their limits.

    python benchmarks/run.py [NAME ...] [--full] [--json] [--store]

Names: recording, cae, cae_step, features, steps, describing, ptae, elders, memory, chapters; all of
them if none is given. A job of minutes is measured on a fair part and extrapolated to the whole;
`--full` does it whole. The last column says which. `--store` writes the rows to data/results, where
a page shows them. Run it on an idle machine: beside other work, two threads may take ten times as
long.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, replace
from datetime import date
from functools import partial
from pathlib import Path

from rows import Row, clocked, laps, table
from steps import describing, steps

ROOT = Path(__file__).resolve().parents[1]
ALL_FRAMES = 64_800  # of the 864 samples
REPEATS = 3
NAME = "results/benchmarks.csv"
# Patterns whose six variations are recorded in one repeat: each action, both sides and speeds.
RECORDED = ((0, 4, 74, 75), (1, 5, 72, 76), (2, 3, 73, 77))
CAE_STEPS, WARM_UP = 12, 2  # the first steps do not count
ENCODED = 300  # images in one repeat


def stored_images(count: int):
    from ptae_lite.data import frames

    keys = frames.stored_keys()
    return frames.images(keys[:: len(keys) // count][:count])


def recording(options) -> list[Row]:
    from ptae_lite.language import patterns
    from ptae_lite.robot import recorder

    row, per_frame = Row("recording 864 sequences, 2 processes", 6), []
    with tempfile.TemporaryDirectory() as folder:
        if options.full:
            row.value = clocked(partial(recorder.record, folder, workers=2)) / 60
            return [row]

        def job(some):
            recorder.record(folder, only=some, workers=2)
            for index in some:  # in the end each sequence is read once more, to gather them
                for variation in range(6):
                    recorder.load_sequence(folder, index, variation)

        job([80])  # starts the processes
        for some in RECORDED:
            count = sum(6 * patterns()[index].frames for index in some)
            per_frame.append(clocked(partial(job, some)) / count)
    how = f"{len(RECORDED)} x {6 * len(RECORDED[0])} sequences"
    return [row.extrapolate(per_frame, ALL_FRAMES, how)]


def cae(options) -> list[Row]:
    from ptae_lite import vision
    from ptae_lite.data import frames

    row, times = Row("training the channel-separated CAE, 2 threads", 12), []
    recipe, train = (
        vision.AutoencoderRecipe(),
        partial(vision.train_autoencoder, vision.make_autoencoder("separated")),
    )
    if options.full:
        images = frames.training_images(options.data)
        row.value = clocked(partial(train, images, recipe)) / 60
        return [row]
    short = replace(recipe, steps=WARM_UP + CAE_STEPS)
    train(stored_images(ENCODED), short, progress=laps(times))
    how = f"{CAE_STEPS} of {recipe.steps} steps"
    return [row.extrapolate(times[WARM_UP:], recipe.steps, how)]


def cae_step(options) -> list[Row]:
    """A step of `AutoencoderTrainer` against one with the readable loss, channels first."""
    import torch
    from torch.nn import functional

    from ptae_lite import vision

    images, rows = stored_images(ENCODED), []
    for kind in vision.ENCODERS:
        fast = vision.AutoencoderTrainer(vision.make_autoencoder(kind), vision.AutoencoderRecipe())
        slow = vision.make_autoencoder(kind)
        optimiser = torch.optim.Adam(slow.parameters(), lr=fast.recipe.learning_rate)

        def readable(slow=slow, optimiser=optimiser, batch=fast.recipe.batch):
            x = vision.as_input(images[:batch]).contiguous()
            loss = functional.binary_cross_entropy(slow(x), x)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()

        def quick(fast=fast):
            fast.go(images, fast.step + 1, value=False)

        times = [[clocked(job) for job in (readable, quick)] for _ in range(WARM_UP + CAE_STEPS)]
        ratios = sorted(a / b for a, b in times[WARM_UP:])
        row = Row(f"{kind} CAE, readable step over fast step", 1.2, "x", at_most=False)
        row.value, row.low, row.high = statistics.median(ratios), ratios[0], ratios[-1]
        row.how = f"measured, {CAE_STEPS} steps each by turns"
        rows.append(row)
    return rows


def features(options) -> list[Row]:
    from ptae_lite import artefacts, vision
    from ptae_lite.robot.recorder import load_sequence, samples_in_order

    row, encoder = (
        Row("features of all frames, 2 threads", 3),
        vision.make_autoencoder("separated").eval(),
    )
    if options.full:
        encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
        read = (load_sequence(options.data, *sample).images for sample in samples_in_order())
        row.value = clocked(lambda: [vision.encode_images(encoder, images) for images in read]) / 60
        return [row]
    job = partial(vision.encode_images, encoder, stored_images(ENCODED))
    job()  # warms up
    seconds = [clocked(job) / ENCODED for _ in range(REPEATS)]
    how = f"{REPEATS} x {ENCODED} frames, without reading them"
    return [row.extrapolate(seconds, ALL_FRAMES, how)]


def elders(options) -> list[Row]:
    """PTAE's elders: an epoch or two of each."""
    from ptae_lite import training
    from ptae_lite.data.samples import load_samples
    from ptae_lite.models import MODELS

    samples, rows = load_samples(), []
    for model, limit in (("pgae", 6), ("pvae", 4)):
        recipe, times = MODELS[model].recipe, []
        short = recipe if options.full else replace(recipe, epochs=REPEATS)
        training.train(samples, short, model=model, progress=laps(times))
        row = Row(f"training {model.upper()}, 1 thread", limit, value=sum(times) / 60)
        how = f"{REPEATS} of {recipe.epochs} epochs"
        rows.append(row if options.full else row.extrapolate(times, recipe.epochs, how))
    return rows


def ptae(options) -> list[Row]:
    from ptae_lite import artefacts, training
    from ptae_lite.data.samples import load_samples
    from ptae_lite.errors import ArtefactError
    from ptae_lite.evaluation import evaluate
    from ptae_lite.models import MODELS, checkpoint

    samples, recipe, times = load_samples(), MODELS["ptae"].recipe, []
    row, right = Row("training PTAE, 1 thread", 3), Row("PTAE describes the test samples", 95, "%")
    right.at_most = False
    short = recipe if options.full else replace(recipe, epochs=REPEATS)
    trained = training.train(samples, short, progress=laps(times))
    if options.full:
        row.value = sum(times) / 60
    else:
        row.extrapolate(times, recipe.epochs, f"{REPEATS} of {recipe.epochs} epochs")
        right.how = "measured, stored weights"
        try:
            trained = checkpoint.load(artefacts.stored("weights/ptae.safetensors"))
        except ArtefactError as error:
            right.how = f"not measured: {error}"
            return [row, right]
    right.value = evaluate(trained, samples)["describe_accuracy"]
    return [row, right]


# A process counts what it was forked from. So a small one asks, not this one.
ASK = """import os, subprocess, sys
none = subprocess.DEVNULL
_, status, used = os.wait4(subprocess.Popen(sys.argv[1:], stdout=none, stderr=none).pid, 0)
print(used.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status))
"""


def peak_gb(command) -> float | None:
    """The largest memory that a command's process has had; None where the command fails."""
    asked = subprocess.run([sys.executable, "-c", ASK, *command], stdout=subprocess.PIPE)
    if asked.returncode:
        return None
    return int(asked.stdout) * (1 if sys.platform == "darwin" else 1024) / 1e9  # bytes, kilobytes


def memory(options) -> list[Row]:
    """Each training in a process of its own, an epoch or some steps of it."""
    kinds = {"cae": "--steps", "plain-cae": "--steps"}
    kinds |= dict.fromkeys(("ptae", "pgae", "pvae", "prae"), "--epochs")
    rows = [Row(f"memory: train {kind}", 2, "GB") for kind in kinds]
    for row, (kind, short) in zip(rows, kinds.items(), strict=True):
        if not hasattr(os, "wait4"):
            row.how = "not measured: this system does not tell"
        elif short == "--steps" and not Path(options.data).is_dir():
            row.how = "not measured: first run python -m ptae_lite record"
        else:
            data = ["--data", options.data] if short == "--steps" else []
            with tempfile.TemporaryDirectory() as folder:
                out = ["--out", Path(folder) / "x.safetensors"]
                train = ["-m", "ptae_lite", "train", kind, *data, short, "2", *out]
                row.value = peak_gb([sys.executable, *train])
            row.how = f"measured, {short} 2" if row.value else "not measured: the training fails"
    return rows


def chapters(options, root: Path = ROOT) -> list[Row]:
    record, whole = root / "build" / "chapter_times.json", Row("run.py book", 4)
    whole.how = "not measured: needs --full"
    if options.full:
        command = [sys.executable, root / "run.py", "book"]
        whole.value = clocked(partial(subprocess.run, command, check=True, stdout=sys.stderr)) / 60
        whole.how = "measured"
    if not record.is_file():
        how = "not measured: first run python3 run.py book"
        return [Row("each chapter", 60, "s", how=how), whole]
    rows = []
    for name, one in sorted(json.loads(record.read_text(encoding="utf-8")).items()):
        row = Row(f"chapter {name}", 60, "s", one["seconds"], "measured by run.py book")
        if one["traceback"]:
            row.value, row.how = None, "not measured: it failed in the last run.py book"
        rows.append(row)
    return [*rows, whole]


JOBS = {
    job.__name__: job
    for job in (
        recording, cae, cae_step, features, steps, describing, ptae, elders, memory, chapters,
    )
}  # fmt: skip
THREADS = {"cae": 2, "features": 2}
THREADS |= dict.fromkeys(("cae_step", "steps", "describing", "ptae", "elders"), 1)


def store(rows: list[Row], machine: dict, options, minutes: float) -> None:
    """Write the rows to data/results/benchmarks.csv, with machine, load and date."""
    import pandas as pd

    from ptae_lite import artefacts
    from ptae_lite.data.samples import load_samples

    table = pd.DataFrame([asdict(row) | {"holds": row.holds} for row in rows])
    table = table.assign(**machine, processor=processor(), date=str(date.today()))
    table.round(3).to_csv(artefacts.data_folder() / NAME, index=False, lineterminator="\n")
    words, inputs = ["python benchmarks/run.py", *options.names], None
    if options.authors:
        words.append("--authors FOLDER")
        inputs = {"authors": load_samples(options.authors).fingerprint.split()[-1]}
    command = " ".join([*words, "--store"])
    artefacts.register(NAME, command=command, seed=None, minutes=minutes, inputs=inputs)


def processor() -> str:
    """The name of the processor, where the system tells it."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.is_file() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor()


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(JOBS))
    parser.add_argument("--full", action="store_true", help="do each job whole")
    parser.add_argument("--json", action="store_true", help="print JSON, not a table")
    parser.add_argument("--data", default=ROOT / "build" / "recording",
                        help="recording for memory, or for cae, features with --full")  # fmt: skip
    parser.add_argument("--authors", metavar="FOLDER", help="the authors' data, for describing")
    parser.add_argument("--store", action="store_true",
                        help="write the rows to data/results/benchmarks.csv")  # fmt: skip
    options = parser.parse_args(arguments)
    for name in options.names:
        if name not in JOBS:
            parser.error(f"no measure {name!r}; there are {', '.join(JOBS)}")
    load = round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else "unknown"
    machine = {"system": platform.platform(terse=True), "cores": os.cpu_count(),
               "python": platform.python_version(), "load before": load}  # fmt: skip
    rows, begun = [], time.perf_counter()
    for name in options.names or JOBS:
        print(f"measuring {name} ...", file=sys.stderr, flush=True)
        if name in THREADS:
            import torch

            torch.set_num_threads(THREADS[name])
        rows += JOBS[name](options)
    if options.store:
        store(rows, machine, options, (time.perf_counter() - begun) / 60)
    if options.json:
        rows = [asdict(row) | {"holds": row.holds} for row in rows]
        print(json.dumps({"machine": machine, "rows": rows}))
    else:
        print(table(rows), ", ".join(f"{k}: {v}" for k, v in machine.items()), sep="\n\n")
    return 0


if __name__ == "__main__":
    from ptae_lite.pipes import piped

    sys.exit(piped(main))

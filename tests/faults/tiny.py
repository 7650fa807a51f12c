"""Jobs of seconds for the tests of this folder, run as a process: `python tiny.py JOB ARGUMENTS`.

Each is the library's own command on made-up samples or tiny sizes, and says `begun` when it has
something to lose.
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import numpy as np

FEATURES = 6
WAIT_S = 0.2  # between two steps of a job: long enough to be stopped in between


def say(text: str) -> None:
    print(text, flush=True)


def samples():
    """36 made-up samples, as `few` of the tests' conftest, without its fixtures."""
    from ptae_lite.data.samples import Samples
    from ptae_lite.language import pattern

    rng = np.random.default_rng(1)
    numbers = np.repeat([0, 7, 72, 73, 2, 78], 6)
    frames = np.array([pattern(int(i)).frames for i in numbers])
    inside = (np.arange(100) < frames[:, None])[..., None]
    joints, features = (rng.normal(size=(36, 100, k)).astype(np.float32) for k in (5, FEATURES))
    return Samples(joints * inside, features * inside, frames, numbers, np.tile(np.arange(6), 6),
                   "e" * 64)  # fmt: skip


def command(*arguments) -> int:
    """`python -m ptae_lite ARGUMENTS` on the made-up samples, with slow and tiny trainings."""
    import ptae_lite.__main__ as cli
    from ptae_lite.data import samples as stored
    from ptae_lite.experiments import options
    from ptae_lite.models import MODELS
    from ptae_lite.recipe import Recipe

    many = samples()
    for name, kind in MODELS.items():
        MODELS[name] = kind._replace(recipe=Recipe(epochs=3, batch=8))
    stored.load_samples = lambda *_: many
    cli.bar = options.bar = slow
    return cli.main([*arguments])


def slow(items, **_):
    """In place of a progress bar: says that there is something to lose, and takes its time."""
    for item in items:
        yield item
        say("begun")
        time.sleep(WAIT_S)


def record(folder, workers="1") -> int:
    from ptae_lite.cli import guarded
    from ptae_lite.robot import recorder

    def work():
        recorder.record(folder, only=[80], workers=int(workers), progress=slow)

    return guarded("record", work)


def corrections(folder) -> int:
    """Record six corrected clips of fast patterns."""
    from ptae_lite.cli import guarded
    from ptae_lite.experiments import corrections as clips

    few = [(480 + i, 0) for i in range(6)]
    clips.jobs_in = lambda *_: few

    def work():
        clips.record(folder, workers=1, progress=slow)

    return guarded("corrections", work)


def make(*paths) -> int:
    """Write small tables, one row at a time, as a stage of a re-run does."""
    from ptae_lite.files import atomic_write

    for number, path in enumerate(paths):
        rows = []
        for i in range(4):
            rows.append({"model": "a", "seed": 0, "row": i, "accuracy": 90 + i + number})
            time.sleep(WAIT_S)
        with atomic_write(path) as temporary, temporary.open("w", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            table.writeheader()
            table.writerows(rows)
        with (Path(path).parent / "times_made.txt").open("a") as file:
            file.write(f"{Path(path).name}\n")
    return 0


def counted(path) -> int:
    """Write a small table, with a progress bar beside another command's."""
    from ptae_lite.cli import bar

    for _ in bar(range(4), mininterval=0, miniters=1):
        print("here", flush=True)
        time.sleep(WAIT_S if "slow" in path else 0)
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text("model,seed,row,accuracy\na,0,0,90\n")
    return 0


def rerun(folder, stored) -> int:
    """A full re-run of tiny stages."""
    from ptae_lite.cli import guarded
    from ptae_lite.reproduce import report
    from ptae_lite.reproduce.checks import table
    from ptae_lite.reproduce.rerun import Rerun, Settings
    from ptae_lite.reproduce.stages import Stage

    check = table(("model", "seed", "row"), {"accuracy": (0.5, 0)})
    stages = tuple(
        Stage(name, f"tiny make {{out}}/results/{name}.csv", {f"results/{name}.csv": check}, 0.1)
        for name in ("one", "two", "three")
    )
    settings = Settings(Path(folder), 1, "cpu", Path(stored))

    def work() -> int:
        again = Rerun(settings, stages)
        return report.write(again, again.go(stream=sys.stderr))

    return guarded("full", work)


def naps(count) -> int:
    """What a study does side by side, with jobs that only take their time."""
    from ptae_lite.experiments import tables

    jobs = [(WAIT_S,)] * int(count)
    tables.run(time.sleep, jobs, lambda _: say("begun"), workers=2)
    return 0


def site(out, book) -> int:
    from ptae_lite.book import site as builder

    return builder.main(["--out", out, "--book", book])


def failing(*_) -> int:
    say("the last words")
    return 3


if __name__ == "__main__":
    job, *arguments = sys.argv[1:]
    sys.exit(globals()[job](*arguments))

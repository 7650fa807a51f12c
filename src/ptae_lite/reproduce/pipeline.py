"""Make everything again, from the recording to the book: `python3 run.py full`.

The stages are done in order, in a folder of their own (`rerun`). At the end each file is compared
with the stored one (`checks`), and `report.md` says which agree.
"""

from __future__ import annotations

import argparse
import sys

from ptae_lite import artefacts, devices
from ptae_lite.cli import guarded, refuse_data, whole_number
from ptae_lite.files import as_called, file_lock
from ptae_lite.pipes import piped
from ptae_lite.reproduce import report
from ptae_lite.reproduce.rerun import Rerun, Settings
from ptae_lite.reproduce.stages import STAGES, Stage
from ptae_lite.reproduce.view import duration


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py full`."""
    made = argparse.ArgumentParser(prog="run.py full", description=__doc__.split(":")[0] + ".")
    made.add_argument(
        "--out", type=as_called, default=artefacts.ROOT / "build" / "full",
        help="folder, new or to go on with (default: build/full)",
    )  # fmt: skip
    made.add_argument(
        "--seeds", type=whole_number(1), default=3, help="trainings of each kind (default: 3)"
    )
    made.add_argument("--device", default="auto", help="of the CAEs: cpu, cuda, or auto")
    made.add_argument("--plan", action="store_true", help="only show what would be done")
    return made


def main(arguments=None, stages: tuple[Stage, ...] = STAGES) -> int:
    """Run the command; returns its exit code."""
    options = parser().parse_args(arguments)

    def work() -> int:
        out = options.out
        refuse_data(out, "build/full")
        settings = Settings(out, options.seeds, devices.choose(options.device))
        if options.plan:
            return show_plan(Rerun(settings, stages))
        with file_lock(out):
            rerun = Rerun(settings, stages)
            failed = rerun.go()
            if failed:
                print(
                    f"The stage {failed.name!r} failed; its log ends:\n{rerun.last_words(failed)}\n"
                    "Mend that, and the same command goes on from there.", file=sys.stderr,
                )  # fmt: skip
            return report.write(rerun, failed)

    return guarded("full", work)


def show_plan(rerun: Rerun) -> int:
    """Print what would be done, and the time it would take."""
    left = 0.0
    for stage, state in rerun.plan():
        minutes = stage.estimate(rerun.settings.seeds)
        left += minutes if state == "to do" else 0
        print(f"{state:16} {duration(minutes):>12}  {rerun.settings.written(stage)}")
    print(f"About {duration(left)} to do, on two free cores.")
    return 0


if __name__ == "__main__":
    sys.exit(piped(main))

"""The folder of a full re-run: what is finished in it, and how to go on.

A re-run has its own folder with its own `data/`, which its later stages and its book read. If it
makes only some rows of a table, its `data/` has the stored rows for the rest. `rerun.json` lists
what is finished, with the hash of every file. So a run that was stopped at any point goes on from
there, and nothing is done twice.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from ptae_lite import artefacts, progress
from ptae_lite.errors import PTAEError
from ptae_lite.experiments import tables
from ptae_lite.files import atomic_write
from ptae_lite.reproduce.fingerprints import library
from ptae_lite.reproduce.stages import OF_A_MACHINE, STAGES, Stage
from ptae_lite.reproduce.view import View

FORMAT = "ptae-lite re-run 1"
TAIL = 8  # last lines of a failed command's log that are shown
TAKEN = "taken from data/"
PATIENCE_S = 5  # time that a command has to end after Ctrl-C


@dataclass(frozen=True)
class Settings:
    """What the commands of a re-run have in common.

    Attributes:
        out: the folder of the re-run.
        seeds: number of trainings of each kind.
        device: where CAEs are trained.
        stored: the folder of stored files.
    """

    out: Path
    seeds: int = 3
    device: str = "cpu"
    stored: Path = field(default_factory=artefacts.data_folder)

    @property
    def data(self) -> Path:
        """The re-run's own folder of stored files."""
        return self.out / "data"

    def command(self, stage: Stage) -> list[str]:
        """The words of a stage's command, after `python -m`."""
        return stage.arguments(out=self.out, seeds=range(self.seeds), device=self.device)

    def written(self, stage: Stage) -> str:
        """The command as a reader in the project's folder would type it."""
        out = self.out.relative_to(artefacts.ROOT) if self._at_home() else Path(self.out.name)
        words = stage.arguments(out=out.as_posix(), seeds=range(self.seeds), device=self.device)
        return "python -m " + " ".join(words)

    def _at_home(self) -> bool:
        return self.out.is_relative_to(artefacts.ROOT)


class Rerun:
    """The folder of a re-run.

    Args:
        stages: the stages, in order.
        simulator: whether PyBullet is there; None to look.

    Raises:
        PTAEError: the folder holds something else, or is of another version of the library.
    """

    taken = TAKEN

    def __init__(self, settings: Settings, stages: tuple[Stage, ...] = STAGES, simulator=None):
        self.settings, self.stages = settings, stages
        self.simulator = find_spec("pybullet") is not None if simulator is None else simulator
        self.state = self._open()

    def _open(self) -> dict:
        """What `rerun.json` says. Refuses a folder of something else, or of another version."""
        out, mine = self.settings.out, library()
        path = out / "rerun.json"
        if not path.exists():
            if out.exists() and (not out.is_dir() or any(out.iterdir())):
                raise PTAEError(f"{out} holds something else; name a new or an empty folder")
            return {"format": FORMAT, "library": mine, "done": {}}
        try:
            state = json.loads(path.read_text(encoding="utf-8"))
            found = (state["format"], state["library"], isinstance(state["done"], dict))
        except (ValueError, KeyError, TypeError):
            found = (None, None, False)
        if found[0] != FORMAT or not found[2]:
            raise PTAEError(f"{path} is damaged; delete the folder {out}, or name another one")
        if found[1] != mine:
            raise PTAEError(
                f"{out} was begun with another version of the library, and a re-run is of one; "
                "delete it, or name another folder"
            )
        return state

    def finished(self, stage: Stage) -> bool:
        """Whether a stage's command has ended and its files are unchanged."""
        entry = self.state["done"].get(stage.name)
        command = TAKEN if self.left_out(stage) else self.settings.written(stage)
        if entry is None or entry["command"] != command:
            return False
        wanted = entry["files"] if command == TAKEN else self._files(stage)
        try:
            return entry["files"] == self._hashes(wanted)
        except OSError:
            return False

    def _files(self, stage: Stage) -> list[str]:
        """The files that a stage leaves in the run's folder and in the run's data."""
        own = [name for name, check in stage.makes.items() if check.key]  # the checks read these
        return [*stage.leaves, *own, *(f"data/{name}" for name in stage.makes)]

    def _hashes(self, files) -> dict[str, str]:
        return {name: _sha256(self.settings.out / name) for name in files}

    def plan(self) -> list[tuple[Stage, str]]:
        """Each stage, and whether it is done, to do, or taken from data/."""
        return [
            (stage, "done" if self.finished(stage) else TAKEN if self.left_out(stage) else "to do")
            for stage in self.stages
        ]

    def left_out(self, stage: Stage) -> str:
        """Why a stage's files are the stored ones; empty if it is done."""
        if stage.simulator and not self.simulator:
            return "needs PyBullet"
        if self.settings.seeds < stage.least_seeds:
            return f"compares variants, which takes {stage.least_seeds} seeds"
        return ""

    def go(self, stream=None) -> Stage | None:
        """Do all stages that are not finished; returns the stage that failed, or None."""
        self._write()  # so the folder is known as a re-run's, even if the first stage is stopped
        self._adopt(OF_A_MACHINE)
        done = [i for i, stage in enumerate(self.stages) if self.finished(stage)]
        spent = {i: self.state["done"][self.stages[i].name]["minutes"] for i in done}
        estimates = [
            0.0 if self.left_out(stage) else stage.estimate(self.settings.seeds)
            for stage in self.stages
        ]
        view = View([stage.name for stage in self.stages], estimates, spent, stream)
        for at, stage in enumerate(self.stages):
            if at in done and self.finished(stage):
                continue
            if self.left_out(stage):
                self._take(stage)
                continue
            view.begin(at)
            if self._run(stage, view):
                return stage
            self._keep(stage, view.done())
        return None

    def _run(self, stage: Stage, view: View) -> int:
        """Run a stage's command, with its output in a log and its progress in the view.

        The output comes through a pipe. If this process is killed, the command ends when it next
        writes.
        """
        out = self.settings.out
        (out / "logs").mkdir(parents=True, exist_ok=True)
        env = os.environ | {"PTAE_DATA": str(self.settings.data), "PYTHONUTF8": "1"}
        env |= {"PYTHONUNBUFFERED": "1"}  # so that nothing is missing in the log after a kill
        env.setdefault("OMP_NUM_THREADS", "1")
        command = [sys.executable, "-m", *self.settings.command(stage)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        with (
            open(out / "logs" / f"{stage.name}.log", "wb") as log,
            TemporaryDirectory() as folder,
            subprocess.Popen(
                command, cwd=artefacts.ROOT, env=env | {progress.FILE: f"{folder}/share"}, **pipes
            ) as process,
        ):
            try:
                while said := process.stdout.read1(65536):
                    log.write(said)
                    view.tick(progress.share_in(folder))
                return process.wait()
            except KeyboardInterrupt:  # the command gets it, too, and ends by itself
                try:
                    process.wait(PATIENCE_S)
                except subprocess.TimeoutExpired:
                    process.terminate()
                raise

    def _keep(self, stage: Stage, minutes: float) -> None:
        """Put the files of a command into the run's data, and write down that it is finished."""
        command = self.settings.written(stage)
        for name, check in stage.makes.items():
            made = self.settings.out / stage.lies.get(name, name)
            kept = self.settings.data / name
            kept.parent.mkdir(parents=True, exist_ok=True)
            stored = self.settings.stored / name
            with atomic_write(kept) as temporary:
                if check.key and stored.exists():  # chapters need rows that a re-run does not make
                    both = (tables.read(path, list(check.key)) for path in (made, stored))
                    tables.completed(*both, list(check.key)).to_csv(
                        temporary, index=False, lineterminator="\n"
                    )
                else:
                    shutil.copyfile(made, temporary)
            artefacts.register(name, command=command, seed=None, minutes=minutes,
                               data=self.settings.data)  # fmt: skip
        self._finish(stage, command, minutes, self._files(stage))

    def _take(self, stage: Stage) -> None:
        """Copy the files of a stage that is left out from the stored ones, marked as taken."""
        taken = self._adopt(stage.makes)
        self._finish(stage, TAKEN, 0.0, [f"data/{name}" for name in taken])

    def _adopt(self, names) -> list[str]:
        """Copy those of the files that are stored; returns their names."""
        there = artefacts.manifest(self.settings.stored)
        taken = [name for name in names if name in there]
        for name in taken:
            artefacts.adopt(name, self.settings.stored, self.settings.data)
        return taken

    def _finish(self, stage: Stage, command: str, minutes: float, files: list[str]) -> None:
        self.state["done"][stage.name] = {
            "command": command, "minutes": round(minutes, 2), "files": self._hashes(files),
        }  # fmt: skip
        self._write()

    def _write(self) -> None:
        with atomic_write(self.settings.out / "rerun.json") as temporary:
            temporary.write_text(json.dumps(self.state, indent=1) + "\n", encoding="utf-8")

    def last_words(self, stage: Stage) -> str:
        """The last lines of a stage's log."""
        log = self.settings.out / "logs" / f"{stage.name}.log"
        text = log.read_text(encoding="utf-8", errors="replace").replace("\r", "\n")
        return "\n".join("    " + line for line in text.strip().splitlines()[-TAIL:])


def _sha256(path: Path) -> str:
    status = path.stat()
    return artefacts.sha256(path, status.st_mtime_ns, status.st_size)

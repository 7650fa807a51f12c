"""A full re-run as a folder: what is finished in it, and how to go on.

A re-run lives in a folder of its own, with its own `data/` that the later stages and the book read.
Where it makes some rows of a table only, its `data/` has the stored ones for the rest.
What is finished stands in `rerun.json` with the hash of every file, so a run that was stopped at
any point goes on where it was, and nothing finished is done twice.
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

from ptae_lite import artefacts
from ptae_lite.errors import PTAEError
from ptae_lite.experiments import tables
from ptae_lite.files import atomic_write
from ptae_lite.reproduce.fingerprints import library
from ptae_lite.reproduce.stages import STAGES, Stage
from ptae_lite.reproduce.view import View, share_in

FORMAT = "ptae-lite re-run 1"
TAIL = 8  # lines shown of what a failed command said
TAKEN = "taken from data/"
PATIENCE_S = 5  # for a command to end after Ctrl-C


@dataclass(frozen=True)
class Settings:
    """What the commands of a re-run have in common."""

    out: Path
    seeds: int = 3
    device: str = "cpu"
    stored: Path = field(default_factory=artefacts.data_folder)

    @property
    def data(self) -> Path:
        """The re-run's own folder of stored files."""
        return self.out / "data"

    def command(self, stage: Stage) -> list[str]:
        return stage.arguments(out=self.out, seeds=range(self.seeds), device=self.device)

    def written(self, stage: Stage) -> str:
        """The command as a reader of the project's folder would type it."""
        out = self.out.relative_to(artefacts.ROOT) if self._at_home() else Path(self.out.name)
        words = stage.arguments(out=out.as_posix(), seeds=range(self.seeds), device=self.device)
        return "python -m " + " ".join(words)

    def _at_home(self) -> bool:
        return self.out.is_relative_to(artefacts.ROOT)


class Rerun:
    """A re-run's folder: what is finished in it, and how to go on."""

    taken = TAKEN

    def __init__(self, settings: Settings, stages: tuple[Stage, ...] = STAGES, simulator=None):
        self.settings, self.stages = settings, stages
        self.simulator = find_spec("pybullet") is not None if simulator is None else simulator
        self.state = self._open()

    def _open(self) -> dict:
        """What `rerun.json` says; refuses another folder, or one of another version of the code."""
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
        """Whether a stage's command was done to its end and its files are still the same."""
        entry = self.state["done"].get(stage.name)
        if entry is None or entry["command"] not in (self.settings.written(stage), TAKEN):
            return False
        wanted = entry["files"] if entry["command"] == TAKEN else self._files(stage)
        try:
            return entry["files"] == self._hashes(wanted)
        except OSError:
            return False

    def _files(self, stage: Stage) -> list[str]:
        """What a stage leaves in the run's folder, and what stands for it in the run's data."""
        own = [name for name, check in stage.makes.items() if check.key]  # as it is judged
        return [*stage.leaves, *own, *(f"data/{name}" for name in stage.makes)]

    def _hashes(self, files) -> dict[str, str]:
        return {name: _sha256(self.settings.out / name) for name in files}

    def plan(self) -> list[tuple[Stage, str]]:
        """Each stage, and whether it is done, left to do, or taken from data/."""
        return [
            (stage, "done" if self.finished(stage) else TAKEN if self._lacks(stage) else "to do")
            for stage in self.stages
        ]

    def _lacks(self, stage: Stage) -> bool:
        return stage.simulator and not self.simulator

    def go(self, stream=None) -> Stage | None:
        """Do all that is not finished; the stage whose command failed, or None."""
        self._write()  # whatever stops the first stage, the folder is known as a re-run's
        done = [i for i, stage in enumerate(self.stages) if self.finished(stage)]
        spent = {i: self.state["done"][self.stages[i].name]["minutes"] for i in done}
        estimates = [
            0.0 if self._lacks(stage) else stage.estimate(self.settings.seeds)
            for stage in self.stages
        ]
        view = View([stage.name for stage in self.stages], estimates, spent, stream)
        for at, stage in enumerate(self.stages):
            if at in done and self.finished(stage):
                continue
            if self._lacks(stage):
                self._take(stage)
                continue
            view.begin(at)
            if self._run(stage, view):
                return stage
            self._keep(stage, view.done())
        return None

    def _run(self, stage: Stage, view: View) -> int:
        """Run a stage's command, its messages into a log and its progress into the view.

        What it says comes through a pipe: if this process is killed, the command ends at the
        next thing it wants to say.
        """
        out = self.settings.out
        (out / "logs").mkdir(parents=True, exist_ok=True)
        env = os.environ | {"PTAE_DATA": str(self.settings.data), "PYTHONUTF8": "1"}
        env |= {"PYTHONUNBUFFERED": "1"}  # what was said before a kill is in the log
        env.setdefault("OMP_NUM_THREADS", "1")
        command = [sys.executable, "-m", *self.settings.command(stage)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        with (
            open(out / "logs" / f"{stage.name}.log", "wb") as log,
            subprocess.Popen(command, cwd=artefacts.ROOT, env=env, **pipes) as process,
        ):
            try:
                while said := process.stdout.read1(65536):
                    log.write(said)
                    view.tick(share_in(said))
                return process.wait()
            except KeyboardInterrupt:  # reaches the command as well, which ends by itself
                try:
                    process.wait(PATIENCE_S)
                except subprocess.TimeoutExpired:
                    process.terminate()
                raise

    def _keep(self, stage: Stage, minutes: float) -> None:
        """Put what a command left into the run's data, and write down that it is finished."""
        command = self.settings.written(stage)
        for name, check in stage.makes.items():
            made = self.settings.out / stage.lies.get(name, name)
            kept = self.settings.data / name
            kept.parent.mkdir(parents=True, exist_ok=True)
            stored = self.settings.stored / name
            with atomic_write(kept) as temporary:
                if check.key and stored.exists():  # chapters ask for rows that a re-run lacks
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
        """Without a simulator, what needs one comes from the stored files, and is called so."""
        there = artefacts.manifest(self.settings.stored)
        taken = [name for name in stage.makes if name in there]
        for name in taken:
            artefacts.adopt(name, self.settings.stored, self.settings.data)
        self._finish(stage, TAKEN, 0.0, [f"data/{name}" for name in taken])

    def _finish(self, stage: Stage, command: str, minutes: float, files: list[str]) -> None:
        self.state["done"][stage.name] = {
            "command": command, "minutes": round(minutes, 2), "files": self._hashes(files),
        }  # fmt: skip
        self._write()

    def _write(self) -> None:
        with atomic_write(self.settings.out / "rerun.json") as temporary:
            temporary.write_text(json.dumps(self.state, indent=1) + "\n", encoding="utf-8")

    def last_words(self, stage: Stage) -> str:
        log = self.settings.out / "logs" / f"{stage.name}.log"
        text = log.read_text(encoding="utf-8", errors="replace").replace("\r", "\n")
        return "\n".join("    " + line for line in text.strip().splitlines()[-TAIL:])


def _sha256(path: Path) -> str:
    status = path.stat()
    return artefacts.sha256(path, status.st_mtime_ns, status.st_size)

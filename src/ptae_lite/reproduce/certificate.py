"""A certificate of a run of the book: `python3 run.py certify`; a teacher's `--check FILE ...`.

It has what ran, the versions and files, the model's scores, and the model's answers for a dozen
test clips. The reader's name chooses the clips, so whoever copies a certificate has to run the
model again. Two certificates of one run of the chapters have the same seconds in them. A
certificate is not a signature: the code that writes it is open, so it can be forged.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from ptae_lite import artefacts
from ptae_lite.cli import guarded
from ptae_lite.data.samples import load_samples
from ptae_lite.data.signals import Source
from ptae_lite.errors import ArtefactError
from ptae_lite.evaluation import evaluate, nrmse, poses, respond, sentences
from ptae_lite.files import as_called, atomic_write, check_writable
from ptae_lite.models import checkpoint
from ptae_lite.pipes import piped
from ptae_lite.reproduce import fingerprints

FORMAT = "ptae-lite certificate 1"
MODEL = "weights/ptae.safetensors"
ASKED = 12
ROOM = 1.0  # points between two machines: one sentence of 216 is half a point
NEAR = 0.05  # points, of one clip's motion
LIMIT_BYTES = 100_000
FIELDS = ("name", "versions", "environment", "library", "sources", "data", "chapters", "scores",
          "answers", "verdicts")  # fmt: skip


def asked(name: str, test: np.ndarray) -> np.ndarray:
    """The test samples that a name chooses."""
    seed = int.from_bytes(hashlib.sha256(name.strip().encode()).digest()[:8], "big")
    return np.sort(np.random.default_rng(seed).choice(test, ASKED, replace=False))


def answers(trained, samples, name: str) -> list[dict]:
    """What the model says and does for the clips of a name."""
    source, chosen = Source(trained.dataset(samples)), asked(name, samples.split("test"))
    said = sentences(respond(trained, source, chosen, "describe"))
    made = poses(respond(trained, source, chosen, "execute"), trained.scaling)
    errors = (
        nrmse(made[i : i + 1], samples, chosen[i : i + 1], trained.scaling)[0] for i in range(ASKED)
    )
    return [
        {"sample": int(sample), "said": words, "nrmse": round(error, 3)}
        for sample, words, error in zip(chosen, said, errors, strict=True)
    ]


def ask(name: str) -> dict:
    """The stored model's scores on all test clips, and its answers for those of a name."""
    trained = checkpoint.load(artefacts.stored(MODEL))
    samples = load_samples()
    scores = {score: round(value, 3) for score, value in evaluate(trained, samples).items()}
    return {"scores": scores, "answers": answers(trained, samples, name)}


def stored_hashes() -> dict[str, str]:
    """SHA-256 of the files in `data/` as they are now; the manifest may say something else."""
    there = {name: artefacts.data_folder() / name for name in artefacts.manifest()}
    return {name: artefacts.sha256(path) if path.is_file() else "" for name, path in there.items()}


def make(name: str, times: dict) -> dict:
    """The certificate of a reader.

    Args:
        name: the reader's name.
        times: seconds and traceback of each chapter.
    """
    data, expected = stored_hashes(), artefacts.manifest()
    chapters = {c: _outcome(**t) for c, t in times.items()}
    sources = fingerprints.chapters()
    whole_data = all(digest == expected[file]["sha256"] for file, digest in data.items())
    body = {
        "format": FORMAT,
        "name": name,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": fingerprints.versions(),
        "environment": fingerprints.environment(),
        "library": fingerprints.library(),
        "sources": sources,
        "data": data,
        "chapters": chapters,
        **(ask(name) if whole_data else {"scores": {}, "answers": []}),
        "verdicts": {
            "every chapter ran": not failed(sources, chapters),
            "every stored file is whole": whole_data,
        },
    }
    return body | {"seal": seal(body)}


def _outcome(seconds: float, traceback: str) -> dict:
    """How a chapter's run ended. Of an error only the name is kept: a message may have a path."""
    error = traceback.strip().rpartition("\n")[2].partition(":")[0]
    return {"seconds": seconds, "ran": not traceback} | ({"error": error} if traceback else {})


def failed(expected, chapters: dict) -> list[str]:
    """The chapters (and the front page) that did not run to the end, with the error if it is known.

    Args:
        expected: the chapters that there are.
        chapters: what a certificate says of those that ran.
    """
    ran = {name for name, one in chapters.items() if isinstance(one, dict) and one.get("ran")}
    names = sorted((set(expected) | set(chapters)) - ran)
    errors = {n: one.get("error") for n, one in chapters.items() if isinstance(one, dict)}
    return [f"{name} ({errors[name]})" if errors.get(name) else name for name in names]


def run_of(body: dict) -> str:
    """A short hash of the run behind a certificate. Another run takes other seconds."""
    return hashlib.sha256(json.dumps(body["chapters"], sort_keys=True).encode()).hexdigest()[:8]


def seal(body: dict) -> str:
    """A hash of everything but the seal. It shows whether a certificate was changed by hand."""
    rest = {key: value for key, value in body.items() if key != "seal"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def read(path) -> dict:
    """Read a certificate.

    Raises:
        ArtefactError: the file is missing, or is no certificate.
    """
    path = Path(path)
    wrong = ArtefactError(f"{path} is no certificate of ours; one is made by: run.py certify")
    try:
        if path.stat().st_size > LIMIT_BYTES:
            raise wrong
        body = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ArtefactError(f"{path} is missing; name the file that was handed in") from None
    except (ValueError, RecursionError, OSError):
        raise wrong from None
    if not isinstance(body, dict) or body.get("format") != FORMAT:
        raise wrong
    kinds = {"name": str, "environment": str, "library": str, "answers": list}
    for field in FIELDS:
        if not isinstance(body.get(field), kinds.get(field, dict)):
            raise ArtefactError(f"{path} lacks {field!r}, so it was not written by run.py certify")
    return body


class Line(NamedTuple):
    """One check and its result. A remark does not fail a certificate."""

    good: bool
    what: str
    says: str
    remark: bool = False


def check(body: dict) -> list[Line]:
    """Compare a certificate with this checkout, whose model is asked the same questions."""
    data = {name: entry["sha256"] for name, entry in artefacts.manifest().items()}
    other = sorted(n for n in data.keys() | body["data"].keys()
                   if data.get(n) != body["data"].get(n))  # fmt: skip
    sources = fingerprints.chapters()
    broken = failed(sources, body["chapters"])
    changed = sorted(c for c in sources if body["sources"].get(c) != sources[c])
    here = ask(body["name"])
    same = sum(map(_same_answer, here["answers"], body["answers"]))
    off = {score: abs(value - _number(body["scores"].get(score)))
           for score, value in here["scores"].items()}  # fmt: skip
    worst = max(off, key=off.get)
    sealed, library, pins = (
        seal(body) == body.get("seal"),
        body["library"] == fingerprints.library(),
        body["environment"] == fingerprints.environment(),
    )
    return [
        Line(sealed, "seal", "whole" if sealed else "changed after it was written"),
        Line(library, "library", "as here" if library else "another version than the one here"),
        Line(pins, "packages", "pinned as here" if pins else "another environment.txt than here"),
        Line(not other, "data", ", ".join(other) or f"{len(data)} files as here"),
        Line(not broken, "chapters", "did not run: " + ", ".join(broken) if broken
             else f"all {len(sources)} ran"),
        Line(not changed, "sources", "changed: " + ", ".join(changed) if changed
             else "the chapters of here", remark=True),
        Line(off[worst] <= ROOM, "scores", f"within {off[worst]:.2f} points ({worst})"),
        Line(same >= ASKED - 1 and len(body["answers"]) == ASKED, "answers",
             f"{same} of {ASKED} as the model here, asked for {body['name']!r}"),
    ]  # fmt: skip


def _same_answer(mine: dict, theirs) -> bool:
    """Whether two answers have the same clip, the same words, and nearly the same motion error."""
    if not isinstance(theirs, dict):
        return False
    near = abs(mine["nrmse"] - _number(theirs.get("nrmse"))) <= NEAR
    return near and all(mine[key] == theirs.get(key) for key in ("sample", "said"))


def _number(value) -> float:
    return float(value) if isinstance(value, int | float) else float("inf")


def show(body: dict, lines: list[Line]) -> int:
    """Print the checks of a certificate; returns 0 if it holds."""
    print(f"{body['name'] or 'no name'}, {body.get('made')}, run {run_of(body)}, "
          + ", ".join(f"{k} {v}" for k, v in body["versions"].items()))  # fmt: skip
    for line in lines:
        state = "good" if line.good else "remark" if line.remark else "WRONG"
        print(f"{state:<8} {line.what:<9} {line.says}")
    good = all(line.good or line.remark for line in lines)
    print("The certificate holds." if good else "The certificate does not hold.")
    return 0 if good else 1


def check_all(paths) -> int:
    """Check each file, and say which of them come from one run."""
    status, runs = 0, {}
    for path in paths:
        body = read(path)
        status |= show(body, check(body))
        runs.setdefault(run_of(body), []).append(f"{path} ({body['name'] or 'no name'})")
    for run, made in runs.items():
        if len(made) > 1:
            print(f"remark   run       {run} is the one run of {', '.join(made)}")
    return status


def run_book() -> Path:
    """Run the chapters with the stored results; returns the file with their times."""
    times = artefacts.ROOT / "build" / "chapter_times.json"
    times.unlink(missing_ok=True)  # of an earlier run
    # its exit code does not matter: the certificate says what failed
    command = [sys.executable, "-m", "ptae_lite.book.site", "--tier", "replay"]
    subprocess.run(command, cwd=artefacts.ROOT)
    return times


def parser() -> argparse.ArgumentParser:
    """The parser of `run.py certify`."""
    made = argparse.ArgumentParser(
        prog="run.py certify",
        description="Run the chapters and write what came out into one small file; or --check it.",
    )
    made.add_argument("--name", default="", help="who hands it in; picks what is asked")
    made.add_argument(
        "--out", type=as_called, default=artefacts.ROOT / "build" / "certificate.json",
        help="file to write (default: build/certificate.json)",
    )  # fmt: skip
    made.add_argument(
        "--times", type=as_called, metavar="FILE",
        help="chapter_times.json of a run that was made, instead of a new one",
    )  # fmt: skip
    made.add_argument(
        "--check", type=as_called, metavar="FILE", nargs="+", help="check certificates, in seconds"
    )
    return made


def main(arguments=None) -> int:
    """Write or check certificates; returns the exit code."""
    options = parser().parse_args(arguments)
    torch.set_num_threads(1)

    def work() -> int:
        if options.check:
            return check_all(options.check)
        check_writable(options.out)
        times = options.times or run_book()
        body = make(options.name, json.loads(times.read_text("utf-8")) if times.is_file() else {})
        with atomic_write(options.out) as temporary:
            temporary.write_text(json.dumps(body, indent=1, ensure_ascii=False) + "\n", "utf-8")
        for what, good in body["verdicts"].items():
            print(f"{'good' if good else 'WRONG':<8} {what}")
        if broken := failed(body["sources"], body["chapters"]):
            print(f"{'':<8} did not run: {', '.join(broken)}")
        print(f"Hand in {options.out}")
        return 0 if all(body["verdicts"].values()) else 1

    return guarded("certify", work)


if __name__ == "__main__":
    sys.exit(piped(main))

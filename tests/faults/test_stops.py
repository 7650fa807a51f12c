"""Ctrl-C and kill -9 in the middle: a second start completes, as if nothing had been.

The jobs are the library's own on tiny sizes (`tiny.py`), each in a process group of its own that
is stopped with all that it started.
"""

import json
import os
import signal
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import pandas as pd
import pytest
from watch import (
    ROOT,
    contents,
    ended_by_ctrl_c,
    finish,
    run,
    sockets_of,
    start,
    stop,
    unchanged,
    until,
    until_said,
)

from ptae_lite import artefacts

pytestmark = [
    pytest.mark.stops,
    pytest.mark.skipif(os.name == "nt", reason="signals to a process group are Unix's"),
]
TRAINING = ("command", "train", "ptae", "--set", "hidden=16", "--set", "heads=2",
            "--set", "feed_forward=32", "--set", "decoder_units=12", "--epochs", "4",
            "--out")  # fmt: skip
STUDY = ("command", "study", "family", "--variants", "PTAE", "--seeds", "0", "1", "2",
         "--workers", "1", "--out")  # fmt: skip


# ---------------------------------------------------------------- a training


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The weights of a training that nothing stopped."""
    path = tmp_path_factory.mktemp("training") / "w.safetensors"
    code, said = run(*TRAINING, path)
    assert code == 0, said
    return path.read_bytes()


def test_a_training_that_ctrl_c_stops(undisturbed, tmp_path):
    path = tmp_path / "w.safetensors"
    process = start(*TRAINING, path)
    until_said(process, 2)
    assert ended_by_ctrl_c(stop(process, signal.SIGINT), "train")
    assert not list(tmp_path.iterdir())
    assert run(*TRAINING, path)[0] == 0
    assert path.read_bytes() == undisturbed


def test_a_training_that_is_killed_leaves_the_weights_before_it(undisturbed, tmp_path):
    path = tmp_path / "w.safetensors"
    path.write_bytes(b"trained before")
    process = start(*TRAINING, path)
    until_said(process, 2)
    with unchanged(tmp_path):
        assert stop(process, signal.SIGKILL)[0] == -signal.SIGKILL
    assert run(*TRAINING, path)[0] == 0
    assert path.read_bytes() == undisturbed


# ---------------------------------------------------------------- a study


@pytest.fixture(scope="module")
def whole_table(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    code, said = run(*STUDY, folder)
    assert code == 0, said
    return table(folder)


def table(folder) -> pd.DataFrame:
    """The rows of the study but for the seconds they took."""
    return pd.read_csv(folder / "family.csv").drop(columns="seconds")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_study_that_is_stopped_keeps_its_rows(whole_table, tmp_path, how):
    process = start(*STUDY, tmp_path)
    until_said(process, 1)  # said when a row is there, and the next is being made
    result = stop(process, how)
    assert result[0] == -how if how == signal.SIGKILL else ended_by_ctrl_c(result, "study")
    rows = pd.read_csv(tmp_path / "family.csv")
    assert 1 <= len(rows) < 3
    code, said = run(*STUDY, tmp_path)
    assert code == 0, said
    pd.testing.assert_frame_equal(table(tmp_path), whole_table)
    again = pd.read_csv(tmp_path / "family.csv")  # seconds and all: the row was not made again
    pd.testing.assert_frame_equal(again.head(len(rows)), rows)


def workers_of(process) -> list:
    """The worker processes that a job has started."""
    import psutil

    found = []
    for child in psutil.Process(process.pid).children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # it has just ended
            said = " ".join(child.cmdline())
            if "loky" in said and "tracker" not in said:
                found.append(child)
    return found


def test_a_study_of_which_a_worker_is_killed(whole_table, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    process = start(*STUDY[:-2], "2", "--out", tmp_path)
    until(process, lambda: len(workers_of(process)) == 2)
    workers_of(process)[0].kill()
    code, said = finish(process)
    assert code == 1 and "study: a worker process was killed, perhaps because memory" in said, said
    assert not (tmp_path / "family.csv").exists()
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert run(*STUDY, tmp_path)[0] == 0
    pd.testing.assert_frame_equal(table(tmp_path), whole_table)


# ---------------------------------------------------------------- a recording


def recorded(folder) -> dict:
    """What was recorded: the arrays of every sequence, not the times within the zip files."""
    import numpy as np

    found = {}
    for path in sorted(Path(folder).rglob("*.npz")):
        with np.load(path) as file:
            found[path.name] = sha256(b"".join(file[n].tobytes() for n in file.files)).hexdigest()
    return found


@pytest.fixture(scope="module")
def whole_recording(simulator, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording") / "r"
    code, said = run("record", folder)
    assert code == 0, said
    return recorded(folder)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_recording_that_is_stopped_goes_on(whole_recording, tmp_path, how):
    folder = tmp_path / "r"
    process = start("record", folder)
    until_said(process, 2)
    result = stop(process, how)
    assert result[0] == -how if how == signal.SIGKILL else ended_by_ctrl_c(result, "record")
    kept = contents(folder / "sequences")
    assert 2 <= len(recorded(folder)) < 6
    assert run("record", folder)[0] == 0
    assert recorded(folder) == whole_recording
    after = contents(folder)
    assert {k: v for k, v in kept.items() if ".part" not in k}.items() <= after.items()
    assert not [name for name in after if name.endswith(".part")]


def test_a_worker_that_is_killed(simulator, whole_recording, tmp_path):
    """As when memory runs out: one sentence, and the same command goes on."""
    folder = tmp_path / "r"
    process = start("record", folder, 2)
    until(process, lambda: list(folder.glob("sequences/*.npz")))
    workers_of(process)[0].kill()
    code, said = finish(process)
    assert code == 1 and "record: a worker process was killed, perhaps because memory" in said, said
    assert run("record", folder)[0] == 0
    assert recorded(folder) == whole_recording


def test_corrected_clips_of_which_the_recorder_is_killed(simulator, tmp_path):
    """At most the clip at hand is lost, and the same command goes on to the same clips."""
    folder, whole = tmp_path / "clips", tmp_path / "whole"
    process = start("corrections", folder)
    until_said(process, 2)
    assert stop(process, signal.SIGKILL)[0] == -signal.SIGKILL
    kept = contents(folder / "clips")
    assert 2 <= len(recorded(folder)) < 6 and not (folder / "clips.npz").exists()
    assert run("corrections", folder)[0] == run("corrections", whole)[0] == 0
    assert recorded(folder) == recorded(whole) and len(recorded(whole)) == 7
    after = contents(folder)
    assert {k: v for k, v in kept.items() if ".part" not in k}.items() <= after.items()
    assert not [name for name in after if name.endswith(".part")]


# ---------------------------------------------------------------- a full re-run


@pytest.fixture
def stored(tmp_path):
    """A data folder with what the tiny stages make."""
    folder = tmp_path / "stored"
    (folder / "results").mkdir(parents=True)
    for name in ("one", "two", "three"):
        rows = [{"model": "a", "seed": 0, "row": i, "accuracy": 90 + i} for i in range(4)]
        pd.DataFrame(rows).to_csv(folder / f"results/{name}.csv", index=False)
        file = f"results/{name}.csv"
        artefacts.register(file, command="x", seed=0, minutes=0, data=folder)
    return folder


def finished(out) -> list[str]:
    """The stages that a re-run's folder says are finished."""
    path = out / "rerun.json"
    return list(json.loads(path.read_text())["done"]) if path.exists() else []


def test_a_full_rerun_that_is_killed_in_its_first_stage_goes_on(stored, tmp_path):
    """The re-run alone is killed, and not what it has started, which ends by itself."""
    out = tmp_path / "out"
    process = start("rerun", out, stored)
    until(process, (out / "logs" / "one.log").exists)
    process.kill()
    assert finish(process)[0] == -signal.SIGKILL and finished(out) == []
    code, said = run("rerun", out, stored)
    assert code == 0, said
    assert finished(out) == ["one", "two", "three"]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_full_rerun_that_is_stopped_does_nothing_finished_twice(stored, tmp_path, how):
    out = tmp_path / "out"
    process = start("rerun", out, stored)
    until(process, lambda: finished(out) == ["one"])
    result = stop(process, how)
    assert result[0] == -how if how == signal.SIGKILL else ended_by_ctrl_c(result, "full")
    assert finished(out) == ["one"]
    with unchanged(stored):
        code, said = run("rerun", out, stored)
    assert code == 0, said
    made = (out / "results" / "times_made.txt").read_text().split()
    assert made.count("one.csv") == 1 and set(made) == {"one.csv", "two.csv", "three.csv"}
    assert json.loads((out / "report.json").read_text())["good"]


# ---------------------------------------------------------------- the book

CHAPTER = """---
jupytext:
  text_representation:
    extension: .md
    format_name: myst
kernelspec:
  display_name: Python 3
  language: python
  name: python3
---

# A chapter

```{code-cell} ipython3
import os, time
open(os.environ["BEGUN"], "w").close()
time.sleep(float(os.environ["TAKES_S"]))
print("it ran")
```
"""


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    """A book of one chapter under the real one's configuration."""
    folder = tmp_path_factory.mktemp("book")
    (folder / "conf.py").write_text((ROOT / "book" / "conf.py").read_text("utf-8"), "utf-8")
    (folder / "_static").mkdir()
    for name in ("book.css", "book.js", "icon.svg"):
        (folder / "_static" / name).write_text("")
    contents = "```{toctree}\n:caption: Chapters\n01_one\n```\n"
    (folder / "index.md").write_text(f"# A book\n\n{contents}")
    (folder / "01_one.md").write_text(CHAPTER)
    return folder


def build(book, out, begun, takes_s="0"):
    return start("site", out, book, BEGUN=str(begun), TAKES_S=takes_s)


@pytest.fixture(scope="module")
def whole_site(book, tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    code, said = finish(build(book, out, out / "begun"))
    assert code == 0, said
    return pages(out)


def pages(out) -> dict:
    return {p.name: p.read_bytes() for p in sorted((out / "html").glob("*.html"))}


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_book_that_is_stopped_leaves_the_site_before_it(book, whole_site, tmp_path, how):
    assert b"it ran" in whole_site["01_one.html"]
    (tmp_path / "html").mkdir()
    (tmp_path / "html" / "index.html").write_text("the site before")
    begun = tmp_path / "begun"
    process = build(book, tmp_path, begun, takes_s="60")
    until(process, begun.exists)
    assert sockets_of(process) == {"127.0.0.1"}  # the kernel, for Sphinx alone
    result = stop(process, how)
    if how == signal.SIGINT:  # the kernels, which got it as well, may have more to say
        assert result[0] == 130 and "book: stopped; what was finished is kept" in result[1]
    assert (tmp_path / "html" / "index.html").read_text() == "the site before"
    assert not (tmp_path / "chapter_times.json").exists()
    code, said = finish(build(book, tmp_path, begun))
    assert code == 0, said
    assert pages(tmp_path) == whole_site
    assert not (tmp_path / "html.part").exists()

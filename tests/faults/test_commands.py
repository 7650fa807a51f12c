"""Commands with nowhere to write and with senseless numbers: one sentence, and nothing changed."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch
from watch import environment, unchanged

import ptae_lite.__main__ as cli
from ptae_lite import artefacts, files, training, vision
from ptae_lite.data import frames
from ptae_lite.errors import FileError
from ptae_lite.experiments import family, tables
from ptae_lite.models import MODELS
from ptae_lite.robot import recorder, scene

TINY = ["--set", "hidden=16", "--set", "heads=2", "--set", "feed_forward=32",
        "--set", "decoder_units=12", "--epochs", "1"]  # fmt: skip


@pytest.fixture
def refused(capsys):
    """A function: a command that must fail, and after its progress with one sentence; that."""

    def run(*arguments):
        assert cli.main([*map(str, arguments)]) == 1
        out, err = capsys.readouterr()
        assert out == "" and "Traceback" not in err
        *progress, sentence = err.splitlines()
        assert all("|" in line or not line.strip() for line in progress)
        return sentence

    return run


@pytest.fixture
def usage(capsys):
    """A function: a command whose arguments are refused; the last line of what it says."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            cli.main([*map(str, arguments)])
        assert ended.value.code == 2
        return capsys.readouterr().err.splitlines()[-1]

    return run


@pytest.fixture
def no_training(monkeypatch):
    """A training would be a fault: the command has to be refused before it."""
    monkeypatch.setattr(
        "ptae_lite.experiments.experiment.train", lambda *_, **__: pytest.fail("it was trained")
    )
    monkeypatch.setattr(vision, "train_autoencoder", lambda *_, **__: pytest.fail("it was trained"))


@pytest.fixture
def few_stored(few, monkeypatch):
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda data, holdout=None: few)
    quick = MODELS["ptae"]._replace(recipe=training.Recipe(epochs=1, batch=8))
    monkeypatch.setitem(MODELS, "ptae", quick)


def full_disk(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def half_then_full(file, **_):
    """A disk that is full after some bytes."""
    file.write(b"half")
    full_disk()


# ---------------------------------------------------------------- where to


def test_weights_into_a_folder(refused, no_training, tmp_path):
    with unchanged(tmp_path):
        message = refused("train", "ptae", "--out", tmp_path)
    assert message == f"train: {tmp_path} is a folder; name a file in it"


def test_weights_below_a_file(refused, no_training, tmp_path):
    (tmp_path / "notes").write_text("mine")
    with unchanged(tmp_path):
        message = refused("train", "ptae", "--out", tmp_path / "notes" / "w.safetensors")
    assert "notes is no folder; name another place" in message


def test_weights_into_a_folder_that_is_read_only(refused, no_training, tmp_path, monkeypatch):
    def touch(self, *_, **__):
        raise PermissionError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(Path, "touch", touch)
    with unchanged(tmp_path):
        message = refused("train", "ptae", "--out", tmp_path / "new" / "w.safetensors")
    assert "w.safetensors cannot be written (Read-only file system)" in message


def test_an_eye_into_a_folder_where_none_may_be_made(refused, no_training, tmp_path, monkeypatch):
    def mkdir(self, *_, **__):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "mkdir", mkdir)
    with unchanged(tmp_path):
        message = refused("train", "cae", "--out", tmp_path / "new" / "eye.safetensors")
    assert "cannot be written (Permission denied); nothing there was changed" in message


def test_weights_over_the_stored_ones(refused, no_training):
    path = artefacts.data_folder() / "weights" / "ptae.safetensors"
    with unchanged(path.parent):
        message = refused("train", "ptae", "--out", path)
    assert "data/ holds what the book is built on; write into build/weights/" in message


def test_a_study_into_the_stored_tables(refused):
    with unchanged(artefacts.data_folder() / "results"):
        message = refused("study", "family", "--out", artefacts.data_folder() / "results")
    assert "data/ holds what the book is built on; write into build/results/" in message


def test_a_second_study_of_one_table(refused, tmp_path):
    with files.file_lock(tmp_path / "family"), unchanged(tmp_path):
        message = refused("study", "family", "--out", tmp_path)
    assert "another run is at work on" in message and "wait until it ends" in message


def test_features_of_a_recording_that_is_at_work(refused, tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "check_ours", lambda *_, **__: {})
    folder = tmp_path / "recording"
    with files.file_lock(folder), unchanged(tmp_path):
        message = refused("features", "--data", folder)
    assert message.startswith(f"features: another run is at work on {folder}")


# ---------------------------------------------------------------- senseless numbers


def test_no_workers(usage, tmp_path):
    with unchanged(tmp_path):
        message = usage("record", "--workers", 0, "--out", tmp_path / "new")
    assert "argument --workers: '0' is no whole number from 1 up" in message


def test_a_negative_seed(usage, tmp_path):
    with unchanged(tmp_path):
        message = usage("train", "ptae", "--seed", -1, "--out", tmp_path / "w.safetensors")
    assert "argument --seed: '-1' is no whole number from 0 up" in message


def test_a_word_for_a_number_of_threads(usage, tmp_path):
    with unchanged(tmp_path):
        message = usage("evaluate", tmp_path / "w.safetensors", "--threads", "two")
    assert "argument --threads: 'two' is no whole number from 1 up" in message


# ---------------------------------------------------------------- a full disk


def test_a_disk_that_is_full_when_weights_are_written(refused, few_stored, tmp_path, monkeypatch):
    path = tmp_path / "w.safetensors"
    artefacts.save_weights(path, {"a": torch.ones(2)}, {"kind": "old"})

    def save(tensors, file, metadata):
        file.write_bytes(b"half")
        raise artefacts.SafetensorError("I/O error: No space left on device (os error 28)")

    monkeypatch.setattr(artefacts, "save_file", save)
    with unchanged(tmp_path):
        message = refused("train", "ptae", *TINY, "--out", path)
    assert "w.safetensors cannot be written (I/O error: No space left on device" in message


def test_a_disk_that_is_full_in_the_middle_of_a_recording(refused, tmp_path, monkeypatch):
    made = recorder.Sequence(
        np.zeros((50, 120, 160, 3), np.uint8), np.zeros((50, 5), np.float32),
        np.zeros((50, 2, 7), np.float32), np.zeros((50, 2), bool), 480,
    )  # fmt: skip
    monkeypatch.setattr(scene, "pybullet", lambda: None)
    monkeypatch.setattr(recorder, "record_sequence", lambda *_: made)
    real, count = np.savez_compressed, []

    def third_is_too_many(file, **arrays):
        count.append(file)
        (half_then_full if len(count) > 2 else real)(file, **arrays)

    monkeypatch.setattr(np, "savez_compressed", third_is_too_many)
    message = refused("record", "--out", tmp_path / "r", "--workers", 1)
    assert "p000_v2.npz cannot be written (No space left on device)" in message
    names = sorted(path.name for path in (tmp_path / "r").rglob("*") if path.is_file())
    assert names == ["p000_v0.npz", "p000_v1.npz", "recording.json"]


def test_a_disk_that_is_full_when_features_are_written(refused, tmp_path, monkeypatch):
    (tmp_path / "features.npz").write_bytes(b"the old ones")
    encoder, images = vision.PlainCAE(2), np.zeros((1, 120, 160, 3), np.uint8)
    vision.save_autoencoder(tmp_path / "eye.safetensors", encoder)
    sequence = SimpleNamespace(images=images)
    monkeypatch.setattr(recorder, "check_ours", lambda *_, **__: {})
    monkeypatch.setattr(recorder, "samples_in_order", lambda: [(0, 0)])
    monkeypatch.setattr(recorder, "load_sequence", lambda *_: sequence)
    monkeypatch.setattr(np, "savez_compressed", half_then_full)
    with unchanged(tmp_path):
        monkeypatch.setattr(cli, "bar", lambda items, **_: items)
        encoder_file = tmp_path / "eye.safetensors"
        message = refused("features", "--data", tmp_path, "--encoder", encoder_file, "--threads", 1)
    assert "features.npz cannot be written (No space left on device)" in message


def test_a_disk_that_is_full_when_frames_are_written(tmp_path, monkeypatch):
    (tmp_path / "frames.zip").write_bytes(b"the old ones")
    monkeypatch.setattr(frames, "choice", lambda: [(0, 0, 0)])
    sequence = SimpleNamespace(images=np.zeros((1, 120, 160, 3), np.uint8))
    monkeypatch.setattr(recorder, "load_sequence", lambda *_: sequence)
    monkeypatch.setattr(frames.zipfile.ZipFile, "writestr", full_disk)
    with (
        unchanged(tmp_path),
        pytest.raises(FileError, match="frames.zip cannot be written .No spac"),
    ):
        frames.write(tmp_path)


def test_a_disk_that_is_full_when_the_manifest_is_written(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("a")
    artefacts.register("a", command="x", seed=0, minutes=0, data=tmp_path)
    (tmp_path / "b").write_text("b")
    real = Path.write_text

    def write_text(self, text, *rest, **more):
        real(self, text[: len(text) // 2], *rest, **more)
        full_disk()

    monkeypatch.setattr(Path, "write_text", write_text)
    with unchanged(tmp_path), pytest.raises(FileError, match="MANIFEST.json cannot be written"):
        artefacts.register("b", command="x", seed=0, minutes=0, data=tmp_path)


def test_a_disk_that_is_full_in_the_middle_of_a_study(refused, few_stored, tmp_path, monkeypatch):
    table = tmp_path / "family.csv"
    pd.DataFrame({"data": ["x"], "variant": ["PTAE"], "seed": [9]}).to_csv(table, index=False)
    row = pd.DataFrame({"data": ["recording"], "variant": ["PTAE"], "seed": [0]})
    monkeypatch.setattr(family, "command", lambda _: tables.add(table, row, list(row)))
    monkeypatch.setattr(pd.DataFrame, "to_csv", full_disk)
    for name in ("family.lock", "family.csv.lock"):  # empty, and they stay
        (tmp_path / name).touch()
    with unchanged(tmp_path):
        message = refused("study", "family", "--out", tmp_path)
    assert "cannot be written (No space left on device)" in message


@pytest.mark.slow
def test_a_disk_that_is_really_full(tmp_path):
    """The system lets no file grow beyond some kilobytes, as if there were no room for more."""
    pytest.importorskip("resource", reason="limits of a process are Unix's")
    path = tmp_path / "w.safetensors"
    path.write_bytes(b"the old ones")
    code = (
        "import resource, sys, torch\n"
        "from ptae_lite import artefacts, cli\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        "save = lambda: artefacts.save_weights(sys.argv[1], {'a': torch.ones(9999)}, {})\n"
        "sys.exit(cli.guarded('train', save))\n"
    )
    with unchanged(tmp_path):
        run = subprocess.run(
            [sys.executable, "-c", code, str(path)], capture_output=True, text=True,
            env=environment(),
        )  # fmt: skip
    assert run.returncode == 1, run.stderr
    assert "w.safetensors cannot be written" in run.stderr and "Traceback" not in run.stderr


def test_a_disk_that_is_full_when_a_notebook_is_written(tmp_path, monkeypatch, capsys):
    from ptae_lite.book import notebooks

    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "01_x.md").write_text("# X\n")
    (tmp_path / "book" / "01_x.ipynb").write_text("the twin before")
    named = "```{toctree}\n:caption: Chapters\n\n01_x\n```\n"
    (tmp_path / "book" / "index.md").write_text(named)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(notebooks, "execute", lambda notebook, folder: None)
    real = Path.write_bytes

    def write_bytes(self, content):
        real(self, content[:10])
        full_disk()

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    with unchanged(tmp_path):
        assert notebooks.main(["--from", "md"]) == 1
    assert "01_x.ipynb cannot be written (No space left on device)" in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"", b"\x80\x00not a table", b"a,b\n1,2\n"])
def test_a_study_into_a_folder_whose_table_is_another_file(refused, few_stored, tmp_path, content):
    (tmp_path / "family.csv").write_bytes(content)
    message = refused("study", "family", "--out", tmp_path)
    assert "family.csv is no table of this study (" in message
    assert "move it away, or name another --out" in message
    assert (tmp_path / "family.csv").read_bytes() == content

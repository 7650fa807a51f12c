"""Recordings with wrong numbers or files in the wrong place: refused before they are learnt."""

import json

import numpy as np
import pytest
from watch import unchanged

from ptae_lite.data.samples import load_samples
from ptae_lite.errors import FileError, RecordingError
from ptae_lite.files import file_lock
from ptae_lite.robot import recorder, scene

FAST = 80  # a pattern of 50 frames


@pytest.fixture
def recording(tmp_path):
    """A recording's folder with two samples of 100 and 50 frames, and features for them."""
    folder = tmp_path / "recording"
    folder.mkdir()
    about = {"format": recorder.FORMAT, "fingerprint": recorder.fingerprint()}
    (folder / "recording.json").write_text(json.dumps(about))

    def write(joints=None, features=None):
        np.savez(
            folder / "samples.npz",
            joints_rad=np.zeros((150, 5), np.float32) if joints is None else joints,
            cubes=np.zeros((150, 2, 7), np.float32), touched=np.zeros((150, 2), bool),
            pattern=np.array([0, 72]), variation=np.zeros(2, int), frames=np.array([100, 50]),
        )  # fmt: skip
        rows = np.ones((150, 30), np.float16) if features is None else features
        np.savez(folder / "features.npz", features=rows, encoder=np.array("e" * 64))
        return folder

    return write


def sequence(folder, variation=0, **changes):
    """A made-up sequence of the fast pattern in its place."""
    path = recorder.sequence_path(folder, FAST, variation)
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {
        "images": np.zeros((50, 120, 160, 3), np.uint8), "cubes": np.zeros((50, 2, 7), np.float32),
        "joints_rad": np.zeros((50, 5), np.float32), "touched": np.zeros((50, 2), bool),
        "seed": 6 * FAST + variation,
    }  # fmt: skip
    np.savez(path, **arrays | changes)
    return path


def test_joints_that_are_no_numbers(recording):
    joints = np.zeros((150, 5), np.float32)
    joints[100, 2] = np.nan  # the first frame of the second sample
    folder = recording(joints=joints)
    with (
        unchanged(folder),
        pytest.raises(
            RecordingError,
            match=r"joints_rad of sample 1 \(pattern 72\) are not all finite numbers",
        ),
    ):
        load_samples(folder)


def test_features_that_are_infinite(recording):
    features = np.ones((150, 30), np.float16)
    features[99, 29] = np.inf
    folder = recording(features=features)
    with (
        unchanged(folder),
        pytest.raises(
            RecordingError, match=r"features of sample 0 \(pattern 0\) are not all finite"
        ),
    ):
        load_samples(folder)


def test_images_of_another_size(tmp_path):
    sequence(tmp_path, images=np.zeros((50, 60, 80, 3), np.uint8))
    with (
        unchanged(tmp_path),
        pytest.raises(
            RecordingError, match=r"images are \(60, 80, 3\) of uint8, not \(120, 160, 3\) of uint8"
        ),
    ):
        recorder.load_sequence(tmp_path, FAST, 0)


def test_images_that_are_no_bytes(tmp_path):
    sequence(tmp_path, images=np.zeros((50, 120, 160, 3), np.float16))
    with (
        unchanged(tmp_path),
        pytest.raises(RecordingError, match="of float16, not .* of uint8; del"),
    ):
        recorder.load_sequence(tmp_path, FAST, 0)


def test_two_samples_that_changed_places(tmp_path):
    first, second = sequence(tmp_path, 0), sequence(tmp_path, 1)
    first.rename(tmp_path / "aside")
    second.rename(first)
    with (
        unchanged(tmp_path),
        pytest.raises(
            RecordingError,
            match="holds sample 481, not 480: files were swapped; delete it and record",
        ),
    ):
        recorder.load_sequence(tmp_path, FAST, 0)


def test_a_description_that_is_no_text(tmp_path):
    (tmp_path / "recording.json").write_bytes(b"\xff\xfe{}")
    with unchanged(tmp_path), pytest.raises(RecordingError, match="does not say 'ptae-lite record"):
        load_samples(tmp_path)


def test_a_file_where_a_folder_is_to_be(tmp_path):
    (tmp_path / "recording").write_text("mine")
    with (
        unchanged(tmp_path),
        pytest.raises(RecordingError, match="is a file; name a new or an emp"),
    ):
        recorder.record(tmp_path / "recording", only=[FAST])


def test_a_second_run_in_the_same_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(scene, "pybullet", lambda: None)
    with (
        file_lock(tmp_path / "recording"),
        unchanged(tmp_path),
        pytest.raises(FileError, match="another run is at work on .*recording; wait until it ends"),
    ):
        recorder.record(tmp_path / "recording", only=[FAST])

"""The recorder: repeatable, resumable, and careful with folders that are not its own."""

import json
import os
import subprocess
import sys
from hashlib import sha256

import numpy as np
import pytest
from joblib.externals.loky import get_reusable_executor

from ptae_lite.errors import LanguageError, RecordingError
from ptae_lite.language import pattern
from ptae_lite.robot import recorder

FAST = 80  # a fast pattern: 50 frames

DIGEST = """
import sys
from hashlib import sha256
from ptae_lite.language import pattern
from ptae_lite.robot.recorder import record_sequence
made = vars(record_sequence(pattern(int(sys.argv[1])), 0))
print(sha256(b"".join(made[k].tobytes() for k in sorted(made) if k != "seed")).hexdigest())
"""


def digest(made):
    columns = vars(made)
    return sha256(
        b"".join(columns[k].tobytes() for k in sorted(columns) if k != "seed")
    ).hexdigest()


def made_up(frames=50, **changes):
    """A sequence of plausible shapes without a simulation."""
    arrays = {
        "images": np.zeros((frames, 120, 160, 3), np.uint8),
        "joints_rad": np.zeros((frames, 5), np.float32),
        "cubes": np.zeros((frames, 2, 7), np.float32),
        "touched": np.zeros((frames, 2), bool),
        "seed": 480,
    }
    return arrays | changes


def put(folder, **arrays):
    path = recorder.sequence_path(folder, FAST, 0)
    path.parent.mkdir(exist_ok=True)
    np.savez(path, **arrays)
    return path


@pytest.fixture(scope="module")
def sequence(simulator):
    return recorder.record_sequence(pattern(FAST), 0)


def end_workers():
    """End joblib's processes, which would wait five minutes for more work, with 200 MB each."""
    get_reusable_executor(reuse=True).shutdown()


@pytest.fixture(scope="module")
def recording(simulator, tmp_path_factory):
    """The six samples of one pattern, recorded by two processes."""
    folder = tmp_path_factory.mktemp("recording") / "new"
    recorder.record(folder, only=[FAST], workers=2)
    end_workers()
    return folder


def test_a_sequence_has_images_joints_cubes_and_contacts_of_the_same_instants(sequence):
    shapes = {name: (a.shape, a.dtype) for name, a in vars(sequence).items() if name != "seed"}
    assert shapes == {
        "images": ((50, 120, 160, 3), np.uint8),
        "joints_rad": ((50, 5), np.float32),
        "cubes": ((50, 2, 7), np.float32),
        "touched": ((50, 2), bool),
    }
    assert sequence.seed == 6 * FAST


def test_the_same_sample_gives_the_same_bytes_here_and_in_two_fresh_processes(sequence):
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", DIGEST, str(FAST)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONHASHSEED": hash_seed},
            text=True,
        )
        for hash_seed in ("1", "2")
    ]
    again = digest(recorder.record_sequence(pattern(FAST), 0))
    fresh = [run.communicate()[0].strip() for run in runs]
    assert [again, *fresh] == [digest(sequence)] * 3


@pytest.mark.slow
def test_variations_of_a_pattern_differ(recording):
    assert len({digest(recorder.load_sequence(recording, FAST, v)) for v in range(6)}) == 6


def test_workers_record_what_one_process_records(recording, sequence):
    assert digest(recorder.load_sequence(recording, FAST, 0)) == digest(sequence)


def test_a_stopped_recording_goes_on_with_what_is_missing_only(recording):
    paths = [recorder.sequence_path(recording, FAST, v) for v in range(6)]
    before = [(path.stat().st_mtime_ns, path.read_bytes()) for path in paths]
    paths[3].unlink()
    made = []
    recorder.record(
        recording, only=[FAST], workers=1, progress=lambda runs: made.extend(runs) or ()
    )
    after = [(path.stat().st_mtime_ns, path.read_bytes()) for path in paths]
    assert len(made) == 1
    assert [content for _, content in after] == [content for _, content in before]
    assert [a[0] == b[0] for a, b in zip(after, before, strict=True)] == [True] * 3 + [False] + [
        True
    ] * 2
    assert sorted(path.name for path in (recording / "sequences").iterdir()) == [
        path.name for path in paths
    ]


def test_a_sequence_is_there_as_a_whole_or_not_at_all(simulator, tmp_path, monkeypatch):
    def break_off(file, **arrays):
        file.write(b"PK half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(recorder, "record_sequence", lambda *_: recorder.Sequence(**made_up()))
    monkeypatch.setattr(np, "savez_compressed", break_off)
    with pytest.raises(KeyboardInterrupt):
        recorder.record(tmp_path, only=[FAST], workers=1)
    assert not list(tmp_path.glob("sequences/*.npz"))


@pytest.mark.parametrize(
    ("found", "message"),
    [
        ({"notes.txt": "mine"}, "is not empty and is not a recording of ours"),
        ({"recording.json": "{"}, "does not say 'ptae-lite recording 1'"),
        ({"recording.json": "[]"}, "does not say 'ptae-lite recording 1'"),
        ({"recording.json": '{"format": "something else"}'}, "does not say"),
        (
            {"recording.json": json.dumps({"format": recorder.FORMAT, "fingerprint": "0" * 16})},
            "another robot, scene or motion than this version's; delete it or record into another",
        ),
    ],
)
def test_a_folder_of_something_else_is_refused_and_left_alone(tmp_path, found, message):
    for name, text in found.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(RecordingError, match=message):
        recorder.record(tmp_path, only=[FAST], workers=1)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == found


def test_another_scene_may_be_read_but_not_gone_on_with(tmp_path):
    about = {"format": recorder.FORMAT, "fingerprint": "0" * 16}
    (tmp_path / "recording.json").write_text(json.dumps(about))
    assert recorder.check_ours(tmp_path, same_scene=False) == about
    with pytest.raises(RecordingError, match="another robot, scene or motion"):
        recorder.check_ours(tmp_path)


def test_a_folder_that_is_no_recording_says_how_to_make_one(tmp_path):
    with pytest.raises(RecordingError, match="no recording.json.*python -m ptae_lite record"):
        recorder.check_ours(tmp_path)


def test_a_sequence_comes_back_as_it_was_written(tmp_path):
    put(tmp_path, **made_up(joints_rad=np.ones((50, 5), np.float32)))
    found = recorder.load_sequence(tmp_path, FAST, 0)
    assert (found.joints_rad == 1).all() and found.seed == 480


def flip(content):
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0xFF]) + content[middle + 1 :]


@pytest.mark.parametrize(
    "damage",
    [lambda content: content[:5000], flip, lambda content: b"", lambda content: b"not a zip"],
    ids=["cut short", "one byte wrong", "empty", "something else"],
)
def test_a_damaged_sequence_is_named(tmp_path, damage):
    path = put(tmp_path, **made_up())
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(
        RecordingError, match=r"p080_v0.npz is damaged .* delete it and record again"
    ):
        recorder.load_sequence(tmp_path, FAST, 0)


@pytest.mark.parametrize("name", ["images", "joints_rad", "cubes", "touched"])
def test_a_sequence_of_another_length_is_refused(tmp_path, name):
    put(tmp_path, **made_up(**{name: made_up(49)[name]}))
    with pytest.raises(RecordingError, match=f"{name} has 49 frames where pattern {FAST} has 50"):
        recorder.load_sequence(tmp_path, FAST, 0)


def test_a_sequence_without_one_of_its_arrays_is_refused(tmp_path):
    arrays = made_up()
    del arrays["cubes"]
    put(tmp_path, **arrays)
    with pytest.raises(RecordingError, match="cubes"):
        recorder.load_sequence(tmp_path, FAST, 0)


@pytest.mark.parametrize("index", [-1, 144])
def test_a_pattern_that_does_not_exist_is_refused(tmp_path, index):
    folder = tmp_path / "new"
    message = f"pattern {index} does not exist; patterns are 0 to 143"
    with pytest.raises(LanguageError, match=message):
        recorder.record(folder, only=[FAST, index], workers=1)
    with pytest.raises(LanguageError, match=message):
        recorder.load_sequence(folder, index, 0)
    assert not folder.exists()


def test_a_recording_with_a_gap_is_not_gathered(tmp_path):
    put(tmp_path, **made_up())
    with pytest.raises(RecordingError, match="p000_v0.npz is missing; go on recording"):
        recorder.gather(tmp_path)
    assert not (tmp_path / "samples.npz").exists()


def test_samples_are_gathered_in_order(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "samples_in_order", lambda: [(FAST, 0), (FAST, 1)])
    for v in range(2):
        path = recorder.sequence_path(tmp_path, FAST, v)
        path.parent.mkdir(exist_ok=True)
        np.savez(path, **made_up(joints_rad=np.full((50, 5), v, np.float32), seed=6 * FAST + v))
    with np.load(recorder.gather(tmp_path)) as file:
        assert file["frames"].tolist() == [50, 50]
        assert file["variation"].tolist() == [0, 1]
        assert file["seed"].tolist() == [6 * FAST, 6 * FAST + 1]
        assert file["pattern"].tolist() == [FAST, FAST]
        assert file["joints_rad"].mean(1).tolist() == [0] * 50 + [1] * 50
        assert "images" not in file.files

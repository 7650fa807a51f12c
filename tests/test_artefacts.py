"""Stored files: trusted only when whole, never half-written, and only with their own eye."""

import hashlib
import json

import numpy as np
import pandas as pd
import pytest
import torch

from ptae_lite import artefacts
from ptae_lite.data.samples import load_samples, write_features
from ptae_lite.errors import ArtefactError, PTAEError, RecordingError

COMMAND = "python -m ptae_lite record"
EYE_FILE = "weights/cae.safetensors"


@pytest.fixture
def data(tmp_path, monkeypatch):
    """A data folder with one stored file, taken for the real one."""
    monkeypatch.setenv("PTAE_DATA", str(tmp_path))
    (tmp_path / "one.bin").write_bytes(b"whole")
    artefacts.register("one.bin", command=COMMAND, seed=3, minutes=4.25, data=tmp_path)
    return tmp_path


def test_the_manifest_says_what_a_file_is_and_where_it_came_from(data):
    entry = json.loads((data / "MANIFEST.json").read_text())["one.bin"]
    assert entry["sha256"] == hashlib.sha256(b"whole").hexdigest()
    assert entry["bytes"] == 5
    assert (entry["command"], entry["seed"], entry["minutes"]) == (COMMAND, 3, 4.2)
    assert entry["versions"]["numpy"] == np.__version__
    assert artefacts.stored("one.bin") == data / "one.bin"


def test_registering_again_renews_one_entry_and_keeps_the_others(data):
    (data / "two.bin").write_bytes(b"2")
    artefacts.register("two.bin", command="x", seed=None, minutes=0, data=data)
    (data / "one.bin").write_bytes(b"another")
    artefacts.register("one.bin", command="y", seed=None, minutes=0, data=data)
    found = artefacts.manifest()
    assert list(found) == ["one.bin", "two.bin"]
    assert found["one.bin"]["bytes"] == 7 and artefacts.stored("one.bin").read_bytes() == b"another"


def test_the_manifest_names_data_that_are_not_stored(data):
    hashes = {"authors": "ab" * 32}
    artefacts.register("one.bin", command="z", seed=None, minutes=0, data=data, inputs=hashes)
    assert artefacts.entry_of("one.bin")["inputs"] == hashes


def test_each_table_with_the_authors_data_names_the_same_files():
    tables = [name for name in artefacts.manifest() if name.endswith(".csv")]
    with_theirs = [name for name in tables if "authors" in set(
        pd.read_csv(artefacts.stored(name)).get("data", []))]  # fmt: skip
    assert {"results/family.csv", "results/supervision.csv"} <= set(with_theirs)
    found = [artefacts.entry_of(name)["inputs"] for name in with_theirs]
    assert all(one == found[0] for one in found) and len(found[0]["authors"]) == 64


def test_a_missing_file_is_named_with_its_hash_and_command(data):
    (data / "one.bin").unlink()
    digest = hashlib.sha256(b"whole").hexdigest()
    with pytest.raises(ArtefactError, match=f"data/one.bin is missing; .*{COMMAND}; .*{digest}"):
        artefacts.stored("one.bin")


def test_a_damaged_file_is_named_with_its_hash_and_command_even_just_after_it_was_whole(data):
    assert artefacts.stored("one.bin")
    (data / "one.bin").write_bytes(b"w hole")
    digest = hashlib.sha256(b"whole").hexdigest()
    message = f"data/one.bin is damaged: .*git checkout data/one.bin .*{COMMAND}; .*{digest}"
    with pytest.raises(ArtefactError, match=message):
        artefacts.stored("one.bin")


def test_an_unknown_name_is_refused_with_those_there_are(data):
    with pytest.raises(ArtefactError, match="no stored file 'three.bin'; there are one.bin"):
        artefacts.stored("three.bin")


@pytest.mark.parametrize(
    ("text", "message"), [(None, "is missing, so no"), ("{", "is damaged"), ("[]", "is damaged")]
)
def test_without_a_manifest_nothing_is_trusted(data, text, message):
    (data / "MANIFEST.json").unlink()
    if text is not None:
        (data / "MANIFEST.json").write_text(text)
    with pytest.raises(ArtefactError, match=f"MANIFEST.json {message}.*git checkout data"):
        artefacts.stored("one.bin")


def test_weights_come_back_with_what_they_are(tmp_path):
    tensors = {"a": torch.randn(3, 4), "b": torch.arange(6).reshape(2, 3).T}
    path = tmp_path / "new" / "w.safetensors"
    artefacts.save_weights(path, tensors, {"kind": "ptae", "history": [[1.5, 2]]})
    found, about = artefacts.load_weights(path)
    assert about == {"kind": "ptae", "history": [[1.5, 2]]}
    assert set(found) == set(tensors)
    assert all(torch.equal(found[name], tensors[name]) for name in tensors)


def test_weights_are_there_as_a_whole_or_as_before(tmp_path, monkeypatch):
    path = tmp_path / "w.safetensors"
    artefacts.save_weights(path, {"a": torch.ones(2)}, {"kind": "old"})

    def break_off(tensors, file, metadata):
        file.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(artefacts, "save_file", break_off)
    for name in ("w.safetensors", "new.safetensors"):
        with pytest.raises(KeyboardInterrupt):
            artefacts.save_weights(tmp_path / name, {"a": torch.zeros(2)}, {"kind": "new"})
    assert artefacts.load_weights(path)[1] == {"kind": "old"}
    assert not (tmp_path / "new.safetensors").exists()


def test_missing_weights_say_how_to_train_them(tmp_path):
    with pytest.raises(ArtefactError, match="w.safetensors is missing; .*ptae_lite train"):
        artefacts.load_weights(tmp_path / "w.safetensors")


@pytest.mark.parametrize("content", [b"", b"not weights", bytes(100)])
def test_a_file_without_weights_is_refused(tmp_path, content):
    path = tmp_path / "w.safetensors"
    path.write_bytes(content)
    with pytest.raises(ArtefactError, match="w.safetensors holds no weights of ours"):
        artefacts.load_weights(path)


def test_weights_of_others_are_refused(tmp_path):
    from safetensors.torch import save_file

    save_file({"a": torch.ones(2)}, tmp_path / "w.safetensors")
    with pytest.raises(ArtefactError, match="holds no weights of ours"):
        artefacts.load_weights(tmp_path / "w.safetensors")


def recorded(**changes):
    """Arrays of two samples: pattern 0 (100 frames) and pattern 72 (50 frames)."""
    rows = np.arange(150, dtype=np.float32)
    arrays = {
        "joints_rad": np.repeat(rows[:, None], 5, axis=1),
        "cubes": np.zeros((150, 2, 7), np.float32),
        "touched": np.zeros((150, 2), bool),
        "pattern": np.array([0, 72]),
        "variation": np.array([0, 0]),
        "frames": np.array([100, 50]),
    }
    return arrays | changes


@pytest.fixture
def write(data):
    """Put a recording of two samples into the data folder: features and eye agree, or not."""

    def put(arrays=None, features=150, encoder=b"encoder"):
        (data / "recording").mkdir(exist_ok=True)
        (data / "weights").mkdir(exist_ok=True)
        (data / EYE_FILE).write_bytes(b"encoder")
        (data / "another eye").write_bytes(encoder)
        np.savez(data / "recording/samples.npz", **(arrays or recorded()))
        write_features(
            data / "recording/features.npz", np.ones((features, 30)), data / "another eye"
        )
        for name in ("recording/samples.npz", "recording/features.npz", EYE_FILE):
            artefacts.register(name, command=COMMAND, seed=0, minutes=0, data=data)

    return put


def test_stored_samples_are_padded_to_100_frames(write):
    write()
    samples = load_samples()
    assert samples.frames.tolist() == [100, 50] and samples.pattern.tolist() == [0, 72]
    assert samples.joints[0, :, 0].tolist() == list(range(100))
    assert samples.joints[1, :, 4].tolist() == [*range(100, 150), *[0] * 50]
    assert samples.features[1].sum() == 50 * 30
    assert samples.encoder == hashlib.sha256(b"encoder").hexdigest()


def test_features_of_another_eye_are_refused(write):
    write(encoder=b"another")
    other, ours = (hashlib.sha256(x).hexdigest()[:12] for x in (b"another", b"encoder"))
    with pytest.raises(ArtefactError, match=f"made by the CAE {other}, the stored CAE is {ours}"):
        load_samples()


def test_features_are_refused_where_the_manifest_names_no_eye(write, data):
    write()
    entries = json.loads((data / "MANIFEST.json").read_text())
    del entries[EYE_FILE]
    (data / "MANIFEST.json").write_text(json.dumps(entries))
    with pytest.raises(ArtefactError, match=f"no stored file '{EYE_FILE}'"):
        load_samples()


@pytest.mark.parametrize("index", [144, -1])
def test_a_sample_of_a_pattern_that_does_not_exist_is_refused(write, index):
    write(arrays=recorded(pattern=np.array([0, index])))
    message = f"pattern {index} does not exist; patterns are 0 to 143; record again"
    with pytest.raises(RecordingError, match=message):
        load_samples()


@pytest.mark.parametrize("name", ["joints_rad", "touched", "frames", "variation", "features"])
def test_a_recording_without_one_of_its_arrays_is_refused(write, data, name):
    arrays = recorded()
    arrays.pop(name, None)
    write(arrays=arrays)
    if name == "features":
        np.savez(data / "recording/features.npz", encoder="e")
        artefacts.register("recording/features.npz", command=COMMAND, seed=0, minutes=0, data=data)
    with pytest.raises(RecordingError, match=f"no array '{name}', so it is no recording of ours"):
        load_samples()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"arrays": recorded(joints_rad=np.zeros((149, 5), np.float32))},
         "joints_rad has 149 frames, the clip lengths add up to 150"),
        ({"arrays": recorded(cubes=np.zeros((151, 2, 7), np.float32))}, "cubes has 151 frames"),
        ({"arrays": recorded(touched=np.zeros((1, 2), bool))}, "touched has 1 frames"),
        ({"arrays": recorded(pattern=np.array([0]))},
         "pattern is given for 1 samples, the clip length for 2"),
        ({"arrays": recorded(variation=np.zeros(3, int))}, "variation is given for 3 samples"),
        ({"features": 140}, "140 frames of features for 150 frames of joints"),
        ({"arrays": recorded(pattern=np.array([0, 1]))},
         "a sample of pattern 1 has 50 frames, not 100"),
    ],
)  # fmt: skip
def test_arrays_that_disagree_in_length_are_refused(write, given, message):
    write(**given)
    with pytest.raises(RecordingError, match=message):
        load_samples()


def test_a_folder_without_its_arrays_says_which_command_makes_them(tmp_path):
    about = {"format": "ptae-lite recording 1", "fingerprint": "0"}
    (tmp_path / "recording.json").write_text(json.dumps(about))
    for name, command in (("samples.npz", "record"), ("features.npz", "features")):
        with pytest.raises(RecordingError, match=f"{name} is missing; .*ptae_lite {command}"):
            load_samples(tmp_path)
        np.savez(tmp_path / name, x=0)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut short", b"something else"])
def test_a_folder_with_a_damaged_file_is_refused(tmp_path, content):
    about = {"format": "ptae-lite recording 1", "fingerprint": "0"}
    (tmp_path / "recording.json").write_text(json.dumps(about))
    (tmp_path / "samples.npz").write_bytes(content)
    np.savez(tmp_path / "features.npz", features=np.ones((1, 30)), encoder="e")
    with pytest.raises(PTAEError, match="samples.npz is damaged"):
        load_samples(tmp_path)


def test_every_stored_file_is_whole_and_every_file_is_in_the_manifest():
    entries = artefacts.manifest()
    files = [path for path in artefacts.data_folder().rglob("*") if path.is_file()]
    names = {path.relative_to(artefacts.data_folder()).as_posix() for path in files}
    assert names - {"MANIFEST.json"} == set(entries)
    for name, entry in entries.items():
        assert artefacts.stored(name).stat().st_size == entry["bytes"]
        assert entry["command"] and entry["versions"]

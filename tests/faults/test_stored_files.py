"""Stored files that are damaged, swapped, of somebody else or dangerous: refused, by name."""

import io
import json
import pickle
import shutil
import zipfile

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from watch import unchanged

from ptae_lite import artefacts, vision
from ptae_lite.data import frames
from ptae_lite.data.samples import load_samples
from ptae_lite.errors import ArtefactError, RecordingError
from ptae_lite.models import checkpoint

ENCODERS = ("weights/cae.safetensors", "weights/plain_cae.safetensors")


class Trap:
    """An object that touches a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


@pytest.fixture
def data(tmp_path, monkeypatch):
    """A data folder with the stored CAEs, whole, taken for the real one."""
    folder = tmp_path / "data"
    for name in ENCODERS:
        artefacts.adopt(name, artefacts.data_folder(), folder)
    monkeypatch.setenv("PTAE_DATA", str(folder))
    return folder


def put(data, name, content) -> None:
    """Something else in place of a stored file, and its hash in the manifest: a forged folder."""
    (data / name).parent.mkdir(parents=True, exist_ok=True)
    (data / name).write_bytes(content)
    artefacts.register(name, command="x", seed=0, minutes=0, data=data)


def test_a_file_that_was_cut_short(data):
    path = data / ENCODERS[0]
    path.write_bytes(path.read_bytes()[:-1])
    with (
        unchanged(data),
        pytest.raises(
            ArtefactError,
            match="data/weights/cae.safetensors is damaged: .*git checkout data/weights",
        ),
    ):
        artefacts.stored(ENCODERS[0])


def test_two_files_that_changed_places(data):
    one, other = (data / name for name in ENCODERS)
    shutil.move(one, data / "aside")
    shutil.move(other, one)
    shutil.move(data / "aside", other)
    with unchanged(data):
        for name in ENCODERS:
            with pytest.raises(ArtefactError, match=f"data/{name} is damaged: its SHA-256 is not"):
                artefacts.stored(name)


def test_a_folder_where_a_file_belongs(data):
    (data / ENCODERS[0]).unlink()
    (data / ENCODERS[0]).mkdir()
    with (
        unchanged(data),
        pytest.raises(ArtefactError, match=f"data/{ENCODERS[0]} is missing; restore"),
    ):
        artefacts.stored(ENCODERS[0])


def test_a_manifest_whose_entry_has_lost_its_hash(data):
    entries = json.loads((data / "MANIFEST.json").read_text())
    del entries[ENCODERS[0]]["sha256"]
    (data / "MANIFEST.json").write_text(json.dumps(entries))
    with unchanged(data), pytest.raises(ArtefactError, match="is damaged; restore it with: git ch"):
        artefacts.stored(ENCODERS[1])


def test_a_manifest_that_is_no_text(data):
    (data / "MANIFEST.json").write_bytes(b"\xff\xfe\x00binary")
    with unchanged(data), pytest.raises(ArtefactError, match="MANIFEST.json is damaged"):
        artefacts.manifest()


def test_a_name_that_leads_out_of_the_folder(data, tmp_path):
    (tmp_path / "secret").write_text("mine")
    entries = json.loads((data / "MANIFEST.json").read_text())
    entries["../secret"] = entries[ENCODERS[0]]
    (data / "MANIFEST.json").write_text(json.dumps(entries))
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="'../secret' leads out of"):
        artefacts.stored("../secret")


def test_a_link_that_leads_out_of_the_folder(data, tmp_path):
    (tmp_path / "elsewhere").write_text("mine")
    (data / "link").symlink_to(tmp_path / "elsewhere")
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="'link' leads out of"):
        artefacts.register("link", command="x", seed=0, minutes=0)


def test_a_pickle_where_weights_belong_is_not_run(data, tmp_path):
    trap = tmp_path / "sprung"
    put(data, ENCODERS[0], pickle.dumps(Trap(trap)))
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="holds no weights of ours"):
        vision.load_autoencoder(artefacts.stored(ENCODERS[0]))
    assert not trap.exists()


def test_a_file_of_torch_save_where_weights_belong_is_not_run(tmp_path):
    trap, path = tmp_path / "sprung", tmp_path / "w.safetensors"
    torch.save({"x": Trap(trap)}, path)
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="holds no weights of ours"):
        checkpoint.load(path)
    assert not trap.exists()


def test_pickled_objects_among_arrays_are_not_run(data, tmp_path):
    trap, content = tmp_path / "sprung", io.BytesIO()
    np.savez(content, joints_rad=np.array([Trap(trap)], dtype=object))
    trap.unlink(missing_ok=True)
    put(data, "recording/samples.npz", content.getvalue())
    put(data, "recording/features.npz", content.getvalue())
    with (
        unchanged(tmp_path),
        pytest.raises(RecordingError, match="samples.npz is damaged .*pickle"),
    ):
        load_samples()
    assert not trap.exists()


def test_weights_of_a_training_that_diverged(tmp_path):
    path = tmp_path / "w.safetensors"
    artefacts.save_weights(path, {"model.a": torch.tensor([1.0, float("nan")])}, {"kind": "ptae"})
    with (
        unchanged(tmp_path),
        pytest.raises(
            ArtefactError, match="model.a has numbers that are not finite; train it again"
        ),
    ):
        checkpoint.load(path)


def test_weights_that_say_they_are_larger_than_the_machine(tmp_path):
    path = tmp_path / "w.safetensors"
    path.write_bytes((2**62).to_bytes(8, "little") + b"{}")
    with (
        unchanged(tmp_path),
        pytest.raises(ArtefactError, match="holds no weights of ours .*train"),
    ):
        artefacts.load_weights(path)


def test_weights_that_were_cut_short(tmp_path):
    path = tmp_path / "w.safetensors"
    artefacts.save_weights(path, {"a": torch.ones(1000)}, {"kind": "ptae"})
    path.write_bytes(path.read_bytes()[:-10])
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="holds no weights of ours"):
        artefacts.load_weights(path)


def test_weights_that_do_not_say_what_they_are(tmp_path):
    path = tmp_path / "w.safetensors"
    save_file({"a": torch.ones(2)}, path, metadata={"about": '["ptae"]'})
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="it does not say what they are"):
        vision.load_autoencoder(path)


def test_an_eye_that_asks_for_more_memory_than_there_is(tmp_path):
    path = tmp_path / "eye.safetensors"
    artefacts.save_weights(path, {"a": torch.ones(2)}, {"kind": "plain", "code": 10**15})
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="do not fit the sizes written in"):
        vision.load_autoencoder(path)


def test_a_model_of_one_kind_that_says_it_is_another(tmp_path, trained):
    path = tmp_path / "model.safetensors"
    checkpoint.save(path, trained)
    tensors, about = artefacts.load_weights(path)
    config = {"features": about["config"]["features"]}
    artefacts.save_weights(path, tensors, about | {"kind": "pgae", "config": config})
    with unchanged(tmp_path), pytest.raises(ArtefactError, match="do not fit the sizes written in"):
        checkpoint.load(path)


def zipped(**files) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for name, text in files.items():
            file.writestr(name.replace("__", "."), text)
    return content.getvalue()


def test_pictures_beside_something_else(data):
    put(data, frames.STORED, zipped(p000_v0_t00__png=b"x", setup__py=b"print(1)"))
    with (
        unchanged(data),
        pytest.raises(RecordingError, match="holds more than frames, so it is not"),
    ):
        frames.stored_keys()


def test_a_picture_that_is_none(data):
    put(data, frames.STORED, zipped(p000_v0_t00__png=b"no picture"))
    with (
        unchanged(data),
        pytest.raises(
            RecordingError, match="frame 0 of pattern 0 is damaged .*python -m ptae_lite record"
        ),
    ):
        frames.frame(0, 0, 0)


def test_pictures_whose_zip_was_cut_short(data):
    put(data, frames.STORED, zipped(p000_v0_t00__png=b"x" * 1000)[:200])
    with (
        unchanged(data),
        pytest.raises(RecordingError, match="frames.zip is damaged .*make it again"),
    ):
        frames.stored_keys()

"""The command line: help, one sentence for an error, one line of JSON for a result."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ptae_lite.__main__ as cli
from ptae_lite import artefacts, training, vision
from ptae_lite.data import frames
from ptae_lite.errors import ArtefactError
from ptae_lite.experiments import closed_loop, experiment, runner
from ptae_lite.experiments.registry import STUDIES
from ptae_lite.models import MODELS, checkpoint
from ptae_lite.robot import recorder

COMMANDS = ("record", "features", "train", "evaluate")


@pytest.fixture
def result(capsys):
    """A function: run a command with `--json`, which must print one line of JSON and succeed."""

    def run(*arguments):
        assert cli.main([*map(str, arguments), "--json"]) == 0
        (line,) = capsys.readouterr().out.splitlines()
        return json.loads(line)

    return run


@pytest.fixture
def refusal(capsys):
    """A function: run a command that must fail, with one sentence on the error stream alone."""

    def run(*arguments):
        assert cli.main([*map(str, arguments)]) == 1
        out, err = capsys.readouterr()
        assert out == ""
        (line,) = err.splitlines()
        assert line.startswith(f"{arguments[0]}: ")
        return line

    return run


@pytest.fixture
def misfit(capsys):
    """A function: a command whose arguments are refused; the last line of what it says."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            cli.main([*map(str, arguments)])
        assert ended.value.code == 2
        return capsys.readouterr().err.splitlines()[-1]

    return run


@pytest.fixture
def few_stored(few, monkeypatch):
    """`load` gives a few made-up samples."""
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda data, holdout=None: few)
    return few


@pytest.fixture
def small_training(monkeypatch, small_configs):
    """Trainings are of tiny models, in small batches; keeps what they were asked for."""
    asked, real = [], training.train

    def train(samples, recipe, *, model, config, **options):
        asked.append((recipe, options | {"model": model, "config": config}))
        config = small_configs[model]
        return real(
            samples, training.Recipe(epochs=1, batch=8), model=model, config=config, **options
        )

    monkeypatch.setattr(experiment, "train", train)
    return asked


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(capsys, command):
    with pytest.raises(SystemExit) as ended:
        cli.main([command, "--help"])
    assert ended.value.code == 0
    assert f"ptae_lite {command}" in capsys.readouterr().out


@pytest.mark.slow
def test_the_module_runs_and_lists_its_commands():
    run = subprocess.run(
        [sys.executable, "-m", "ptae_lite", "--help"], capture_output=True, text=True, check=True
    )
    assert all(command in run.stdout for command in COMMANDS)


def test_an_unknown_command_is_an_error(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["dance"])
    assert ended.value.code == 2
    assert "dance" in capsys.readouterr().err


@pytest.mark.parametrize("folder", ["", "recording", "deep/er"])
def test_nothing_is_recorded_into_the_data_folder(refusal, tmp_path, monkeypatch, folder):
    monkeypatch.setenv("PTAE_DATA", str(tmp_path))
    message = refusal("record", "--out", tmp_path / folder)
    assert "data/ holds what the book is built on; write into build/recording/" in message
    assert not list(tmp_path.iterdir())


def test_a_refused_folder_is_an_error(refusal, tmp_path):
    (tmp_path / "notes.txt").touch()
    assert "is not a recording of ours" in refusal("record", "--out", tmp_path)


def test_recording_tells_how_much_it_did(result, tmp_path, monkeypatch):
    asked = {}

    def record(folder, *, workers, progress):
        asked.update(folder=folder, workers=workers)
        list(progress(iter(range(3))))

    monkeypatch.setattr(recorder, "record", record)
    monkeypatch.setattr(frames, "write", lambda folder: asked.update(frames=folder))
    path = tmp_path / "sequences" / "p000_v0.npz"
    path.parent.mkdir()
    path.touch()
    found = result("record", "--out", tmp_path, "--workers", 3)
    assert asked == {"folder": tmp_path, "workers": 3, "frames": tmp_path}
    assert found["samples"] == 864 and found["recorded_now"] == 863


def test_features_are_written_with_the_hash_of_their_eye(result, tmp_path, monkeypatch):
    encoder, encoder_file = vision.PlainCAE(4), tmp_path / "eye.safetensors"
    vision.save_autoencoder(encoder_file, encoder, vision.AutoencoderRecipe())
    images = np.random.default_rng(0).integers(0, 256, (50, 120, 160, 3), np.uint8)
    recording = tmp_path / "recording"
    recording.mkdir()
    about = {"format": recorder.FORMAT, "fingerprint": "0"}
    (recording / "recording.json").write_text(json.dumps(about))
    (recording / "sequences").mkdir()
    np.savez(
        recorder.sequence_path(recording, 72, 0),
        images=images, joints_rad=np.zeros((50, 5)), cubes=np.zeros((50, 2, 7)),
        touched=np.zeros((50, 2), bool), seed=432,
    )  # fmt: skip
    monkeypatch.setattr(recorder, "samples_in_order", lambda: [(72, 0)])
    found = result("features", "--data", recording, "--encoder", encoder_file, "--threads", 1)
    assert found["frames"] == 50
    with np.load(found["features"]) as file:
        assert str(file["encoder"]) == artefacts.sha256(encoder_file)
        wanted = vision.encode_images(encoder, images)
        np.testing.assert_allclose(file["features"], wanted, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("model", ["ptae", "pgae", "pvae", "prae"])
def test_train_and_evaluate(result, few_stored, small_training, tmp_path, model):
    path = tmp_path / "model.safetensors"
    made = result("train", model, "--epochs", 7, "--seed", 5, "--out", path)
    assert made["weights"] == str(path) and made["steps"] == 3
    ((recipe, options),) = small_training
    assert recipe == replace(MODELS[model].recipe, epochs=7, seed=5)
    assert options["model"] == checkpoint.load(path).about["kind"] == model
    assert options["split"] == "train" and options["labelled"] is None
    scores = result("evaluate", path)
    assert set(scores) > {"describe_accuracy", "execute_nrmse_valid", "seconds"}
    assert checkpoint.load(path).about["steps"] == 3


def test_weights_have_a_place_where_none_is_named(
    result, few_stored, small_training, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    made = result("train", "pgae", "--seed", 0)
    assert made["weights"] == "build/weights/pgae_seed0.safetensors"
    assert checkpoint.load(made["weights"]).about["kind"] == "pgae"


def test_a_study_takes_what_the_command_trained_and_nothing_else(
    result, few_stored, small_experiments, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    result("train", "ptae", "--epochs", 1, "--seed", 2)
    (trained,) = small_experiments

    def asked(samples, seed):
        return experiment.experiment(samples, "ptae", {}, {"epochs": 1}, seed, name="PTAE")

    def score(trained, samples, seed):
        return pd.DataFrame([{"seed": seed, "steps": trained.about["steps"]}])

    study = runner.Study("rows.csv", ["seed"], asked, score)
    table = runner.run(study, few_stored, [(2,)], tmp_path, "build/weights")
    assert table["steps"].tolist() == [3] and small_experiments == [trained]
    for option in (["--set", "dropout=0.3"], ["--labelled", 50]):
        result("train", "ptae", "--epochs", 1, "--seed", 2, *option)
        with pytest.raises(ArtefactError, match="holds another training than the one asked for"):
            runner.run(study, few_stored, [(2,)], tmp_path / "new", "build/weights")


@pytest.mark.parametrize("name", ["encoders", "encoders-in-use", "closed-loop"])
def test_a_study_of_our_recording_alone_takes_no_other_data(misfit, tmp_path, name):
    for option in (("--data", "authors"), ("--holdout", "18")):
        message = misfit("study", name, *option, "--out", tmp_path / "new")
        assert f"study {name} does not understand {' '.join(option)}; " in message
        assert f"python -m ptae_lite study {name} --help" in message
    assert not list(tmp_path.iterdir())


def test_each_study_understands_its_own_options_and_no_other(misfit, tmp_path):
    for option in ("--shares", "--modes", "--encoders"):
        message = misfit("study", "closed-loop", option, "2", "--out", tmp_path / "new")
        assert f"study closed-loop does not understand {option} 2; " in message
    for name in STUDIES:
        with pytest.raises(SystemExit) as ended:
            cli.main(["study", name, "--help"])
        assert ended.value.code == 0
    assert not list(tmp_path.iterdir())


def test_models_of_the_closed_loop_are_those_that_are_named(monkeypatch, capsys, tmp_path):
    asked = []
    monkeypatch.setattr("ptae_lite.data.samples.load_samples", lambda *_: None)
    monkeypatch.setattr(
        closed_loop, "study", lambda *given, **_: asked.append(given[3]) or pd.DataFrame()
    )
    monkeypatch.setattr("ptae_lite.experiments.episodes.keep", lambda *_: None)
    for option in ("--models", "--variants"):
        cli.main(["study", "closed-loop", option, "ptae", "--out", str(tmp_path)])
    assert asked == [["ptae"], ["ptae"]]


@pytest.mark.parametrize("model", ["ptae", "pvae"])
def test_a_labelled_share_is_drawn_from_the_split(
    result, few_stored, small_training, tmp_path, model
):
    result("train", model, "--labelled", 50, "--seed", 2, "--out", tmp_path / "w.safetensors")
    train = few_stored.split("train")
    wanted = training.label(train, 50, 2)
    np.testing.assert_array_equal(small_training[0][1]["labelled"], wanted)


@pytest.mark.parametrize("model", ["cae", "plain-cae"])
def test_an_eye_is_trained_by_steps(result, tmp_path, monkeypatch, model):
    images = np.random.default_rng(0).integers(0, 256, (4, 120, 160, 3), np.uint8)
    monkeypatch.setattr(frames, "training_images", lambda folder: images)
    monkeypatch.setattr(vision.AutoencoderRecipe, "batch", 2)
    path = tmp_path / "eye.safetensors"
    small = [
        "--steps", 2, "--code", 3, "--out", path, "--threads", 1, "--data", tmp_path
    ]  # fmt: skip
    assert result("train", model, *small)["loss"] > 0
    encoder = vision.load_autoencoder(path)
    assert (encoder.kind, encoder.code) == ("separated" if model == "cae" else "plain", 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate", "none.safetensors"], "none.safetensors is missing; train a model with"),
        (["features", "--data", "none", "--encoder", "none.st"], "none.st is missing"),
        (["train", "ptae", "--data", "none", "--out", "w"], "none is not a recording"),
        (["train", "cae", "--data", "none", "--out", "w"], "none is not a recording"),
        (["train", "cae", "--epochs", "3", "--out", "w"], "trained by --steps, not by --epochs"),
        (["train", "cae", "--steps", "0", "--out", "w"], "at least one step"),
    ],
)
def test_an_error_is_one_sentence(refusal, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(*arguments)
    assert not Path("w").exists()


def test_a_choice_of_the_model_is_set_by_name(result, few_stored, small_training, tmp_path):
    settings = ["--set", "queries=action", "--set", "frame_positions=true", "--set", "hidden=64"]
    result("train", "ptae", *settings, "--set", "dropout=0", "--out", tmp_path / "w.safetensors")
    config = small_training[0][1]["config"]
    assert (config.queries, config.frame_positions, config.hidden, config.dropout) == (
        "action",
        True,
        64,
        0,
    )
    assert config.features == few_stored.features.shape[2]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("colour=red", "ptae has no setting 'colour'; it has features, joints, hidden"),
        ("hidden=wide", "hidden is a whole number, not 'wide'"),
        ("frame_positions=maybe", "frame_positions is true or false, not 'maybe'"),
        ("queries=all", "queries is 'all'; it can be language, action, both"),
        ("hidden=0", "hidden is 0; it must be 1 or more"),
        pytest.param("language_encoder=bert", "holds no BERT", marks=pytest.mark.extras),
    ],
)
def test_a_wrong_choice_is_refused(refusal, few_stored, tmp_path, setting, message):
    if "bert" in setting:
        pytest.importorskip("transformers", reason="the extra `bert` is not installed")
    path = tmp_path / "w.safetensors"
    assert message in refusal("train", "ptae", "--set", setting, "--out", path)
    assert not path.exists()


@pytest.mark.parametrize(
    ("option", "message"),
    [(("--epochs", 0), "at least one epoch"), (("--labelled", 0), "a share of 0.0 % does not")],
)
def test_nought_is_not_taken_for_the_default(refusal, few_stored, tmp_path, option, message):
    path = tmp_path / "w.safetensors"
    assert message in refusal("train", "ptae", *option, "--out", path)
    assert not path.exists()


def test_without_json_a_result_is_a_table(capsys, few_stored, trained, tmp_path):
    path = tmp_path / "w.safetensors"
    checkpoint.save(path, trained)
    assert cli.main(["evaluate", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines][::6] == ["describe_accuracy", "seconds"]


def test_an_interrupted_command_says_so(capsys, monkeypatch):
    def stop(path):
        raise KeyboardInterrupt

    monkeypatch.setattr(checkpoint, "load", stop)
    assert cli.main(["evaluate", "w"]) == 130
    assert capsys.readouterr().err == "evaluate: stopped; what was finished is kept\n"

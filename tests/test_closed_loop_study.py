"""The study of the closed loop on made-up data, and what it keeps for the pages."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from ptae_lite import artefacts, vision
from ptae_lite.data.samples import load_samples
from ptae_lite.errors import ConfigError
from ptae_lite.experiments import closed_loop as study
from ptae_lite.experiments import episodes, experiment, family, runner, videos
from ptae_lite.models import MODELS, PTAEConfig, checkpoint
from ptae_lite.training import Recipe, train

TINY = {"hidden": 16, "heads": 2, "feed_forward": 32, "decoder_units": 12, "dropout": 0.0}


@pytest.fixture(scope="module")
def recorded():
    """Six samples to train and six to test, of our recording."""
    whole = load_samples()
    chosen = np.concatenate([whole.split("train")[:12], whole.split("test")[:6]])
    columns = ("joints", "features", "frames", "pattern", "variation", "cubes", "touched")
    return replace(whole, **{name: getattr(whole, name)[chosen] for name in columns})


@pytest.fixture
def quick(monkeypatch):
    """One epoch of a tiny model, and an arm that is given up after a few frames."""
    sizes = lambda **choices: PTAEConfig(**TINY | choices)  # noqa: E731
    small = {"ptae": MODELS["ptae"]._replace(config=sizes, recipe=Recipe(epochs=1, batch=6))}
    monkeypatch.setattr(experiment, "MODELS", small)
    monkeypatch.setattr("ptae_lite.robot.closed_loop.LIMIT", 4)


def test_a_model_that_the_family_has_is_the_same_training_and_lies_in_the_same_place(recorded):
    for model, variant in study.NAMES.items():
        own = study.experiment_of(recorded, model, 2)
        other = family.experiment_of(recorded, "recording", variant, 2)
        assert own == other and (own.hash, own.file) == (other.hash, other.file)
    assert own.file == "ptae_adam_seed2.safetensors"
    own = study.experiment_of(recorded, "watching_policy", 0)
    assert own.file == "watching_policy_seed0.safetensors"
    assert study.experiment_of(recorded, "dagger", 0).base == own


@pytest.mark.slow
def test_rows_are_trained_acted_out_and_written_once(simulator, quick, recorded, tmp_path):
    models, conditions = ("one_look_policy", "dagger"), ("replay", "test", "there_and_back")
    table = study.study(recorded, tmp_path, tmp_path / "w", models, (0,), conditions)
    counts = table.groupby(["model", "condition"]).size().to_dict()
    assert counts == {
        ("recorded joints", "replay"): 6,
        ("one_look_policy", "test"): 6, ("one_look_policy", "there_and_back"): 2,
        ("dagger", "test"): 6, ("dagger", "there_and_back"): 2,
    }  # fmt: skip
    assert set(table["success"]) <= {0, 1}
    assert table[table["condition"] != "replay"]["duration"].max() == 4
    assert table[table["condition"] == "test"]["sentence"].str.split().str.len().eq(3).all()
    back = table["condition"] == "there_and_back"
    for said in ("described", "described_held"):
        assert (table[said].notna() == back).all()
    scores = pd.read_csv(tmp_path / "closed_loop_models.csv")
    assert (
        set(scores["model"]) == {"one_look_policy", "dagger"}
        and (scores["execute_nrmse"] > 0).all()
    )
    assert (
        tmp_path / "w" / "watching_policy_seed0.safetensors"
    ).exists()  # its episodes were taken
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    study.study(recorded, tmp_path, tmp_path / "w", models, (0,), conditions)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_without_conditions_each_model_goes_through_those_that_are_stored():
    table = pd.read_csv(artefacts.stored("results/closed_loop.csv"))
    found = set(table[study.KEY].itertuples(index=False, name=None))
    expected = {(m, seed, c) for m, own in study.SHOWN.items() for c in own for seed in (0, 1, 2)}
    expected = {job for job in expected if job[2] != "replay"} | {(study.REPLAY, 0, "replay")}
    assert found <= expected
    assert {job for job in found if job[1] == 0} == {job for job in expected if job[1] == 0}


def test_rows_that_are_stored_are_not_made_again(simulator, tmp_path, monkeypatch):
    for name in ("closed_loop.csv", "closed_loop_models.csv"):
        shutil.copy(artefacts.stored(f"results/{name}"), tmp_path)
    monkeypatch.setattr(runner, "obtain", lambda *_: pytest.fail("it was trained"))
    before = {path: path.read_bytes() for path in tmp_path.glob("*.csv")}
    study.study(load_samples(), tmp_path, tmp_path / "w", seeds=(0,))  # all of it is stored
    assert {path: path.read_bytes() for path in tmp_path.glob("*.csv")} == before


def test_no_more_than_that_is_acted_out(simulator, quick, recorded, tmp_path, monkeypatch):
    acted = []
    made = replace(study.EPISODES, score=lambda *job: acted.append(job[2:]) or pd.DataFrame(
        [dict(zip(study.KEY, job[2:], strict=True))]))  # fmt: skip
    monkeypatch.setattr(study, "EPISODES", made)
    study.study(recorded, tmp_path, tmp_path / "w", ("ptae_first_frame", "watching_policy"), (0,))
    assert acted == [
        (study.REPLAY, 0, "replay"), ("ptae_first_frame", 0, "test"),
        ("watching_policy", 0, "test"), ("watching_policy", 0, "displaced"),
    ]  # fmt: skip


@pytest.mark.parametrize("names", [{"models": ("deaf",)}, {"conditions": ("drunk",)}])
def test_a_name_that_does_not_exist_is_refused_with_those_that_do(recorded, tmp_path, names):
    with pytest.raises(ConfigError, match="no (model 'deaf'.*dagger|condition 'drunk'.*displaced)"):
        study.study(recorded, tmp_path, tmp_path, **names)
    assert not any(tmp_path.iterdir())


def test_what_a_model_saw_of_its_own_acts_is_a_film_of_99_frames(simulator, quick, recorded):
    trained = study.experiment_of(recorded, "watching_policy", 0).fit(recorded)
    own = recorded.split("train")[:2]
    seen = videos.seen_in_own_episodes(trained, recorded, own)
    assert list(seen) == own.tolist()
    for sample, video in seen.items():
        assert video.shape == (99, 30) and np.isfinite(video).all()
        assert np.abs(video[0] - recorded.features[sample, 0]).max() < 0.05  # the same first look
        last = recorded.frames[sample]
        assert (video[last:] == video[-1]).all()


def test_films_reach_execute_alone(source):
    from ptae_lite.data.signals import build, signal_number, with_video

    signals = torch.tensor([signal_number(s) for s in ("execute", "repeat action", "execute")])
    batch = build(source, torch.tensor([0, 1, 2]), signals, torch.zeros(3, dtype=torch.long))
    other = torch.full_like(batch.video[0], 7.0)
    changed = with_video(batch, {0: other, 1: other})
    assert (changed.video[0] == 7).all()
    assert (changed.video[1:] == batch.video[1:]).all()
    assert (batch.video[0] != 7).any()
    assert changed.keys is batch.keys and changed.joints is batch.joints


def test_training_takes_other_films_where_it_is_given_some(few, tiny):
    recipe = Recipe(epochs=1, batch=8)
    videos = {int(i): [few.features[i, :99] + 1] for i in few.split("train")}
    plain, other = (train(few, recipe, config=tiny, videos=f) for f in (None, videos))
    weights = [model.model.action.cells[0].weight_ih for model in (plain, other)]
    assert (weights[0] != weights[1]).any()


@pytest.fixture(scope="module")
def kept(simulator):
    """Two episodes of a model that knows nothing, given up after a few frames."""
    torch.manual_seed(0)
    samples = load_samples()
    config = PTAEConfig(**TINY, freeze_video=True, pad_still_frame=False, condition_on_code=True)
    from ptae_lite.data.scaling import fit_scaling
    from ptae_lite.models.ptae import PTAE

    scaling = fit_scaling(samples, samples.split("train")[:50])
    trained = checkpoint.Trained(PTAE(config).eval(), scaling, {"encoder": samples.encoder})
    encoder = vision.load_autoencoder(artefacts.stored("weights/cae.safetensors"))
    stage = episodes.stages()["red and green"]
    from ptae_lite.language import parse

    instruction = ("push red slowly", "pull green fast", "slide cyan fast")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ptae_lite.robot.closed_loop.LIMIT", 5)
        made = [
            episodes.perform(trained, encoder, stage, text, parse(text)) for text in instruction
        ]
    return trained, encoder, made


def test_episodes_come_back_as_they_were_kept(kept, tmp_path):
    *_, made = kept
    episodes.write(tmp_path / "e.npz", made[:2])
    again = episodes.load(tmp_path / "e.npz")
    for old, new in zip(made[:2], again, strict=True):
        assert (new.instruction, new.stage.colours) == (old.instruction, old.stage.colours)
        assert np.allclose(new.episode.joints_rad, old.episode.joints_rad, atol=1e-6)
        assert new.verdict.reason == old.verdict.reason


def test_a_colour_that_is_not_there_is_no_success(kept):
    verdict = kept[2][2].verdict
    assert not verdict.success and verdict.reason == study.NOT_THERE


def test_every_scene_lies_within_what_training_knows():
    for stage in episodes.stages().values():
        assert np.abs(stage.places_m - np.array(episodes.motions.NOMINAL_PLACES_M)).max() <= 0.012


def test_strips_show_three_successes_and_three_kinds_of_failure():
    rows = [
        {"condition": "test", "model": model, "action": action, "success": success,
         "reason": reason, "pattern": i}
        for i, (model, action, success, reason) in enumerate([
            ("one_look_policy", "push", 1, "done"), ("one_look_policy", "pull", 1, "done"),
            ("one_look_policy", "slide", 1, "done"), ("ptae", "push", 0, "a"),
            ("ptae", "push", 0, "b"), ("ptae", "push", 0, "b"), ("ptae", "pull", 0, "c"),
            ("one_look_policy", "push", 1, "done"),
        ])
    ]  # fmt: skip
    chosen = episodes.strips_of(pd.DataFrame(rows), "one_look_policy")
    assert chosen["pattern"].tolist()[:3] == [0, 1, 2]
    assert sorted(chosen["reason"][3:]) == ["a", "b", "c"]


def test_pages_get_what_the_table_can_show(kept, tmp_path, monkeypatch):
    trained = kept[0]
    samples = load_samples()

    def keep_weights(model):
        asked = study.experiment_of(samples, model, 0)
        trained.about["experiment"] = asked.hash
        checkpoint.save(tmp_path / asked.file, trained)

    keep_weights("one_look_policy")
    monkeypatch.setattr("ptae_lite.robot.closed_loop.LIMIT", 5)
    rows = [
        {"condition": "test", "model": model, "seed": 0, "action": action, "reason": reason,
         "success": reason == "done", "pattern": i, "variation": 0,
         "sentence": f"{action} red fast"}
        for i, (model, action, reason) in enumerate([
            ("one_look_policy", "push", "done"), ("one_look_policy", "pull", "done"),
            ("one_look_policy", "slide", "done"), ("one_look_policy", "push", "a"),
            ("one_look_policy", "push", "b"), ("ptae", "push", "c"),
        ])
    ]  # fmt: skip
    table, strips = pd.DataFrame(rows), tmp_path / episodes.STRIPS
    episodes.keep(tmp_path, table[table["condition"] == "synonyms"], samples, tmp_path)
    stored = (tmp_path / episodes.EPISODES).read_bytes()
    assert len(episodes.load(tmp_path / episodes.EPISODES)) == 36 and not strips.exists()
    episodes.keep(tmp_path, table, samples, tmp_path)  # the weights of one row are not there
    assert not strips.exists()
    keep_weights("ptae")
    episodes.keep(tmp_path, table, samples, tmp_path)
    with np.load(strips, allow_pickle=False) as file:
        assert file["strips"].shape == (6, 5, 120, 160, 3)
        assert file["texts"].tolist()[0] == "one_look_policy: push red fast (done)"
    assert (tmp_path / episodes.EPISODES).read_bytes() == stored


def test_corrections_come_from_scenes_of_the_training_samples(monkeypatch, recorded, kept):
    base, asked, given = kept[0], [], {}

    def act(_, __, indices):
        asked.extend(int(i) for i in indices)
        return dict.fromkeys(asked, np.zeros((99, 30)))

    def train(*_, videos, **__):
        given.update(videos)
        return base

    monkeypatch.setattr(videos, "seen_in_own_episodes", act)
    monkeypatch.setattr(experiment, "train", train)
    study.experiment_of(recorded, "dagger", 1).fit(recorded, base)
    own = recorded.split("train").tolist()
    assert asked == own[1::2] and set(given) == set(asked)
    assert not set(asked) & set(recorded.split("test").tolist())


def test_the_panel_finds_each_episode_and_says_its_verdict(kept):
    from ptae_lite.widgets import episodes as shown

    *_, made = kept
    text = shown.verdict_text(made[0])
    assert "NOT done" in text and "red cube (left)" in text and "slowly asked for" in text
    assert "no cyan cube here" in shown.verdict_text(made[2])
    for cube, words in enumerate(("The red cube (left) fell off", "the other one fell off")):
        cubes = made[0].episode.cubes.copy()
        cubes[-1, cube, 2] = -3
        flung = made[0]._replace(episode=made[0].episode._replace(cubes=cubes))
        assert words in shown.verdict_text(flung)
    html = shown.Shown(made[0])._repr_html_()
    assert "NOT done" in html and "iframe" in html


def test_the_box_acts_or_says_in_a_sentence_why_not(kept, monkeypatch):
    from ptae_lite.widgets import episodes as shown

    trained, encoder, made = kept
    box = shown.Box({"it": trained, "another": trained}, encoder, made).widget()
    who, scene, text, buttons, view = box.children
    button, snatch = buttons.children
    monkeypatch.setattr("ptae_lite.robot.closed_loop.LIMIT", 5)
    text.value = "pull the red one"
    button.click()
    assert "a sentence has three words" in view.value
    text.value = "push scarlet slowly"
    button.click()
    assert "red cube (left)" in view.value
    moved = []
    monkeypatch.setattr(shown.watching_shown, "move_of", lambda *given: moved.append(given[2]))
    snatch.click()
    snatch.click()
    assert "red cube (left)" in view.value and moved == [0, 1]  # another move each time

    def no_simulator():
        from ptae_lite.errors import RobotError

        raise RobotError("none")

    monkeypatch.setattr(shown, "pybullet", no_simulator)
    text.value = "move-up red slowly"
    button.click()
    assert "red cube (left)" in view.value  # the stored one with this meaning
    text.value = "slide red slowly"
    button.click()
    assert "no PyBullet here" in view.value and button.disabled is False
    text.value, who.value = "move-up red slowly", "another"
    button.click()
    assert "no PyBullet here" in view.value  # what is stored is the first one's
    assert scene.options == tuple(episodes.stages())

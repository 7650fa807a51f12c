"""The study of the watching policy on a few scenes, its trainings, its scores, and the places."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest
import torch

from ptae_lite.data import demonstrations
from ptae_lite.data.clips import CLIPS, Clips, join, read_clips, write_clips
from ptae_lite.data.samples import load_samples
from ptae_lite.data.scaling import fit_scaling
from ptae_lite.errors import ArtefactError, ConfigError, RecordingError
from ptae_lite.experiments import disturbances, experiment, places, runner, watching_training
from ptae_lite.experiments import watching as study
from ptae_lite.experiments.tasks import tasks_of
from ptae_lite.experiments.watching_training import fingerprint, share_of
from ptae_lite.language import sentence
from ptae_lite.models import MODELS, PTAEConfig
from ptae_lite.robot import closed_loop, motions
from ptae_lite.robot.disturbances import Disturbance
from ptae_lite.training import Recipe
from ptae_lite.watching_training import Prepared, WatchingRecipe

TINY = {"hidden": 16, "heads": 2, "feed_forward": 32, "decoder_units": 12, "dropout": 0.0}
PARTS = ("meaning", "colour", "place", "plan", "teller")
SHORT = {f"{name}_steps": 2 for name in PARTS} | {"clips": 2}


@pytest.fixture(scope="module")
def recorded():
    """Twelve samples to fit and six that are held out, of our recording."""
    whole = load_samples()
    chosen = np.concatenate([whole.split("fit")[::46], whole.split("held_out")[::16]])
    columns = ("joints", "features", "frames", "pattern", "variation", "cubes", "touched")
    return replace(whole, **{name: getattr(whole, name)[chosen] for name in columns})


@pytest.fixture(scope="module")
def clips(recorded, tmp_path_factory):
    """A folder of clips made of recorded samples, as if the left cube had been moved in frame 3."""
    folder = tmp_path_factory.mktemp("clips")
    count = len(recorded.frames)
    inside = np.arange(100) < recorded.frames[:, None]
    made = Clips(
        sample=np.arange(count), pattern=recorded.pattern, kind=np.full(count, "named"),
        event=np.full(count, 3), pushed=np.full(count, -1), success=np.ones(count, dtype=bool),
        seed=100_000 + np.arange(count), frames=recorded.frames,
        features=recorded.features[inside], joints_rad=recorded.joints[inside],
        goal_m=np.full((int(recorded.frames.sum()), 3), 0.5), cubes=recorded.cubes[inside],
    )  # fmt: skip
    write_clips(folder / CLIPS, made)
    return folder


@pytest.fixture
def quick(monkeypatch):
    """One epoch of a tiny model, two updates of each part, and episodes of a few frames."""
    sizes = lambda **choices: PTAEConfig(**TINY | choices)  # noqa: E731
    small = {"ptae": MODELS["ptae"]._replace(config=sizes, recipe=Recipe(epochs=1, batch=6))}
    monkeypatch.setattr(experiment, "MODELS", small)
    monkeypatch.setattr(watching_training, "WatchingRecipe", partial(WatchingRecipe, **SHORT))
    monkeypatch.setattr(closed_loop, "LIMIT", 4)
    scene = disturbances.scene_of
    monkeypatch.setattr(disturbances, "scenes", lambda split, condition: [scene(5)])


def test_rows_are_trained_acted_and_written_once(simulator, quick, recorded, clips, tmp_path):
    act = partial(
        study.study, recorded, tmp_path, tmp_path / "w", str(clips), seeds=(0,),
        conditions=("displaced", "dark"),
    )  # fmt: skip
    displaced = tasks_of(recorded, "displaced", "held_out")
    table = act(("watching", "frozen", "planner", "one_look_policy"))
    counts = table.groupby(["model", "condition"]).size().to_dict()
    assert counts == {
        (model, condition): count
        for model in ("watching", "frozen", "planner", "one_look_policy")
        for condition, count in (("displaced", len(displaced)), ("dark", 1))
    }
    assert set(table["split"]) == {"held_out"} and table["duration"].max() == 4
    tells = table["model"].isin(("watching", "frozen"))
    assert (table["described"].notna() & table["described"].ne("") == tells).all()
    assert set(table["move_mm_x"]) == {0.0}
    scores = pd.read_csv(tmp_path / "watching_models.csv")
    assert scores["model"].tolist() == ["watching"] and scores["execute_nrmse"].gt(0).all()
    weights = {path.name for path in (tmp_path / "w").glob("*.safetensors")}
    assert weights == {"watching_fit_seed0.safetensors", "one_look_policy_fit_seed0.safetensors"}
    again = act(("watching",))
    pd.testing.assert_frame_equal(again, pd.read_csv(tmp_path / "watching.csv"))


def test_a_training_says_what_it_learned_from(quick, recorded, clips):
    asked = {
        name: study.experiment_of(recorded, name, 0, "held_out", clips=str(clips))
        for name in ("watching", "frozen", "blind_on_clips", "recorded_only", "half")
    }
    assert asked["watching"] == asked["frozen"] and asked["watching"].split == "fit"
    hashes = {one.hash for name, one in asked.items() if name != "frozen"}
    assert len(hashes) == 4
    assert asked["recorded_only"].clips == "" and asked["watching"].clips
    assert asked["blind_on_clips"].clips == asked["watching"].clips
    assert all(one.base == asked["watching"].base for one in asked.values())
    base = study.experiment_of(recorded, "one_look_policy", 0, "held_out", clips=str(clips))
    assert base == asked["watching"].base
    assert study.experiment_of(recorded, "planner", 0, "test", clips="nowhere") is None
    trained = runner.obtain(asked["half"], recorded)
    assert trained.about["experiment"] == asked["half"].hash
    assert trained.about["clips"] == 12 + 6


def test_shares_of_the_clips_lie_inside_each_other_and_have_a_fingerprint(clips):
    every = read_clips(clips / CLIPS)
    parts = [set(share_of(every, amount).seed) for amount in (1, 1 / 2, 1 / 4, 1 / 8)]
    assert [len(part) for part in parts] == [18, 9, 5, 3]
    assert all(small < large for large, small in zip(parts, parts[1:], strict=False))
    shown = fingerprint(every)
    reverse = every.where(np.arange(18) >= 9), every.where(np.arange(18) < 9)
    assert fingerprint(join(list(reverse))) == shown
    other = replace(every, goal_m=every.goal_m + np.eye(len(every.goal_m), 3))
    assert fingerprint(other) != shown


def test_clips_of_other_patterns_are_not_learned_from(quick, recorded, clips):
    """Held-out patterns have clips in the folder; a policy of `fit` has not seen them."""
    asked = study.experiment_of(recorded, "watching", 0, "held_out", clips=str(clips))
    assert runner.obtain(asked, recorded).about["clips"] == 12 + 12
    final = study.experiment_of(recorded, "watching", 0, "test", clips=str(clips))
    assert final.split == "train" and final.clips != asked.clips


def test_other_clips_than_those_of_the_experiment_are_refused(quick, recorded, clips):
    asked = study.experiment_of(recorded, "watching", 0, "held_out", clips=str(clips))
    with pytest.raises(ConfigError, match="holds other clips"):
        replace(asked, clips="0" * 64).fit(recorded)
    with pytest.raises(RecordingError, match="no corrected clips"):
        study.experiment_of(recorded, "watching", 0, "held_out", clips=str(clips / "none"))


def test_a_name_that_does_not_exist_is_refused(recorded, tmp_path):
    act = partial(study.study, recorded, tmp_path, tmp_path, "nowhere")
    with pytest.raises(ConfigError, match="no model 'seeing'"):
        act(("seeing",))
    with pytest.raises(ConfigError, match="no condition 'night'"):
        act(("watching",), conditions=("night",))
    with pytest.raises(ConfigError, match="no split 'all'"):
        act(("watching",), split="all")


def test_what_an_episode_says_of_the_move_and_the_hand(simulator):
    """The planner comes down beside the moved cube: its hand is off by as much as the cube."""
    scene = disturbances.scene_of(481)
    asked, drawn = scene.asked, scene.drawn
    side = ("left", "right").index(asked.side)
    stage = closed_loop.stage_of(asked, 1)
    places_m = drawn.places_m.copy()
    places_m[side] += (0.012, -0.016)
    moved = Disturbance(frame=3, places_m=places_m)
    task = tasks_of(load_samples(), "test", "train")[0]
    task = task._replace(sample=481, stage=stage, asked=asked, disturbance=moved,
                         instruction=sentence(asked.meaning))  # fmt: skip
    assert study.motion_of(task).clock.tolist() == motions.draw(481).clock.tolist()
    row = study.row(study.act("planner", None, torch.nn.Identity(), task))
    assert row["success"] == 1 and row["described"] == ""
    assert (row["move_mm_x"], row["move_mm_y"]) == pytest.approx((12, -16), abs=0.2)
    assert (row["hand_mm_x"], row["hand_mm_y"]) == pytest.approx((12, -16), abs=4)
    blind = study.row(study.act("unaware", None, torch.nn.Identity(), task))
    assert (blind["hand_mm_x"], blind["hand_mm_y"]) == pytest.approx((0, 0), abs=4)


def test_readers_of_places_learn_and_are_scored_on_the_named_cube(
    recorded, clips, tmp_path, monkeypatch
):
    short = partial(WatchingRecipe, place_steps=300, frames=64)
    monkeypatch.setattr(places, "WatchingRecipe", short)
    table = places.study(recorded, tmp_path, clips)
    assert len(table) == len(places.READERS) * 2 * len(places.AXES)
    assert table["error_mm"].between(0.1, 50).all()
    stored = pd.read_csv(tmp_path / places.FILE)
    assert len(stored) == len(table) and stored["error_mm"].sum() == pytest.approx(
        table["error_mm"].sum()
    )
    shown = demonstrations.recorded(recorded, recorded.split("fit"))
    known = Prepared.of(shown, fit_scaling(recorded, recorded.split("fit")))
    free, error = known.before_touch, {}
    for name, read in places._readers(known, 0).items():
        off = read(known.features) - known.places_m.numpy()
        error[name] = float((off[free] ** 2).mean())
    assert error["network"] < error["linear"] < error["guess"]


def test_scenes_of_a_condition_that_was_not_drawn_are_refused(tmp_path):
    with pytest.raises(ArtefactError, match="draw them with"):
        tasks_of(load_samples(), "moved", "held_out", tmp_path / "none.csv")

"""What pages show of the watching policy: strips of corrected clips, and episodes with moves."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.experiments import corrections, episodes, watching_shown
from ptae_lite.language import Meaning
from ptae_lite.robot import closed_loop, motions
from ptae_lite.robot.closed_loop import Episode
from ptae_lite.robot.corrections import Planner, UnawarePlanner
from ptae_lite.widgets import episodes as widgets


@pytest.fixture(scope="module")
def strips(simulator, tmp_path_factory):
    path = tmp_path_factory.mktemp("strips") / watching_shown.STRIPS
    watching_shown.write_strips(path)
    with np.load(path, allow_pickle=False) as file:
        return file["strips"], file["texts"].tolist()


def test_a_strip_shows_a_clip_of_each_kind_before_and_after(strips):
    images, texts = strips
    assert images.shape == (3, watching_shown.IMAGES, 120, 160, 3) and images.dtype == np.uint8
    assert [text.split(": ")[1] for text in texts] == list(watching_shown.KINDS)
    for video in images:
        assert np.abs(video[0].astype(int) - video[1]).mean() > 1


def test_what_a_strip_says_is_what_happens_in_the_clip(simulator):
    for sample, round_ in corrections.jobs_in("train"):
        if watching_shown.kind_of(sample, round_) == watching_shown.KINDS[0]:
            break
    acted = corrections.act_clip(sample, round_)
    far = np.hypot(*acted.episode.shift_m.T)
    side = ("left", "right").index(corrections.pattern(sample // motions.VARIATIONS).side)
    assert far[side] >= watching_shown.FAR_M and far[1 - side] < 1e-4
    shown = watching_shown.frames_shown(acted)
    assert shown[0] == acted.episode.event - 1 and (np.diff(shown) > 0).all()
    assert shown[-1] < len(acted.planner.images)


def test_a_move_of_the_stored_scene_is_hard(simulator):
    stage = next(iter(episodes.stages().values()))
    what = watching_shown.move_of(stage, Meaning("push", "red", "fast"))
    asked = corrections.pattern(72)
    assert (asked.action, asked.side, asked.speed) == ("push", "left", "fast")
    planners = (one(asked, motions.middle(stage.places_m)) for one in (Planner, UnawarePlanner))
    knows, unaware = (
        closed_loop.judge(closed_loop.perform(stage, one, disturbance=what), "push", "left", "fast")
        for one in planners
    )
    assert knows.success and not unaware.success
    other = watching_shown.move_of(stage, Meaning("push", "red", "fast"), 1)
    assert not np.allclose(what.places_m, other.places_m)


@pytest.fixture
def made():
    """An episode of each of two models, in which the left cube is moved and then pushed."""
    stage = next(iter(episodes.stages().values()))
    joints, shift = np.zeros((60, 5)), np.array([[0.03, -0.01], [0, 0]])
    cubes = np.zeros((60, 2, 7))
    cubes[:, :, :2], cubes[:, :, 2], cubes[:, :, 6] = stage.places_m, 1, 1
    cubes[20:, :, :2] += shift
    cubes[40:, 0, 0] += 0.05
    kept = []
    for model, moved in (("watching", True), ("one_look_policy", False)):
        episode = Episode(joints, cubes, "home", 20, shift)
        verdict = closed_loop.judge(episode, "push", "left", "fast")
        stored = episodes.StoredEpisode(stage, "push red fast", episode, verdict)
        kept.append(watching_shown.Shown(model, moved, stored))
    return kept


def test_an_episode_is_read_back_and_judged_from_the_new_place(made, tmp_path):
    path = tmp_path / watching_shown.EPISODES
    watching_shown.write(path, made)
    back = watching_shown.load(path)
    assert [(one.model, one.moved) for one in back] == [
        ("watching", True), ("one_look_policy", False)
    ]  # fmt: skip
    assert [one.kept.episode.event for one in back] == [20, 20]
    assert back[0].kept.verdict.named_mm == pytest.approx(50, abs=0.01)
    assert widgets.verdict_text(back[0].kept).endswith("The cubes were moved in frame 20.")
    found = watching_shown.find(back, "watching", True, "move-up scarlet quickly")
    assert found is back[0].kept


def test_the_panel_names_who_acts_and_what_happens(made):
    names = {"one_look_policy": "one look", "watching": "watching"}
    whole = [one._replace(model=model, moved=moved, kept=one.kept._replace(
        instruction=f"{action} {colour} {speed}"))
        for one in made[:1] for model in names for moved in (True, False)
        for action in ("push", "pull", "slide") for colour in ("red", "green")
        for speed in ("slowly", "fast")]  # fmt: skip
    panel = widgets.watching_panel(whole, names)
    assert panel.values["who"] == ["one look", "watching"]
    assert panel.values["cubes"] == [widgets.MOVED, widgets.STAY]


def test_an_act_is_told_rightly_by_its_meaning():
    table = pd.DataFrame({
        "sentence": ["push red fast", "pull blue slowly", "pull blue slowly", "slide red fast"],
        "described": ["move-up scarlet quickly", "pull blue fast", None, "slide red"],
    })  # fmt: skip
    assert watching_shown.told_rightly(table).tolist() == [True, False, False, False]


def test_without_weights_no_episodes_are_kept(samples, tmp_path, monkeypatch):
    monkeypatch.setattr(watching_shown, "write_strips", lambda path: path.write_text("strips"))
    monkeypatch.setattr(watching_shown.watching, "experiment_of", lambda *_, **__: None)
    monkeypatch.setattr(watching_shown.runner, "found", lambda asked, weights: None)
    watching_shown.keep(tmp_path, samples, tmp_path, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [watching_shown.STRIPS]

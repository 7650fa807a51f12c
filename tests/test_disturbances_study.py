"""The disturbed scenes: drawn by the planner alone; the table says exactly what happens."""

import numpy as np
import pandas as pd
import pytest

from ptae_lite.errors import ArtefactError, ConfigError
from ptae_lite.experiments import disturbances as study
from ptae_lite.experiments.tasks import DISTURBED, tasks_of
from ptae_lite.language import parse
from ptae_lite.robot.closed_loop import Verdict

SAMPLES = {"moved": 571, "pushed": 486, "late": 480, "dark": 480}  # of fast patterns


@pytest.fixture(scope="module")
def table(simulator, tmp_path_factory):
    """A scene of each of four conditions, through the file."""
    folder = tmp_path_factory.mktemp("draws")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            study, "scenes", lambda split, condition: [study.scene_of(SAMPLES[condition])]
        )
        study.study(folder, ("train",), tuple(SAMPLES))
    return folder / study.FILE


def rows(path):
    return {row.condition: row for row in study.read(path).itertuples()}


def test_the_planner_that_knows_succeeds_in_each_and_a_move_defeats_the_other(table):
    found = rows(table)
    assert set(found) == set(SAMPLES)
    for row in found.values():
        assert (row.valid, row.knows, row.reason, row.knows_reason) == (1, 1, "", "done")
    assert found["moved"].unaware == 0 and found["moved"].unaware_reason != "done"
    assert found["dark"].unaware == 1


def test_the_table_says_exactly_what_was_tried(table):
    for condition, row in rows(table).items():
        if condition not in ("moved", "pushed"):
            continue
        scene = study.scene_of(row.sample)
        again = study.draw(scene, condition)
        assert (again["draws"], again["valid"], again["cubes"]) == (row.draws, 1, row.cubes)
        what = study.disturbance_of(row)
        assert study._verdict(scene, study.Planner, what).reason == row.knows_reason
        assert study._verdict(scene, study.UnawarePlanner, what).reason == row.unaware_reason
        for name in ("left_x_m", "right_y_m", "push_x_m", "away_m"):
            np.testing.assert_equal(float(again[name]), float(getattr(row, name)))


def test_cubes_are_moved_and_hands_pushed_as_far_as_asked(table):
    found = rows(table)
    for name in ("moved", "late"):
        scene, what = study.scene_of(found[name].sample), study.disturbance_of(found[name])
        far = np.linalg.norm(what.places_m - scene.drawn.places_m, axis=1)
        moved = far > 1e-4
        assert moved.any() and ((far[moved] > 0.0199) & (far[moved] < 0.0401)).all()
        assert what.low == (name == "late") and what.push_m is None
    pushed = study.disturbance_of(found["pushed"])
    assert 0.0299 < np.linalg.norm(pushed.push_m) < 0.0601 and pushed.places_m is None
    assert pushed.push_frames == 3 and pushed.held_frames == 13 and pushed.away_m > 0
    assert study.disturbance_of(found["dark"]).light == 2 / 3


def test_rows_that_are_there_are_not_drawn_again(table, monkeypatch):
    monkeypatch.setattr(
        study, "scenes", lambda split, condition: [study.scene_of(SAMPLES[condition])]
    )
    monkeypatch.setattr(study, "draw", lambda *_: pytest.fail("drawn again"))
    before = table.read_bytes()
    study.study(table.parent, ("train",), tuple(SAMPLES))
    assert table.read_bytes() == before


def verdicts(monkeypatch, **success):
    """Planners that succeed or not, without a simulation."""
    tried = []

    def verdict(scene, planner, what):
        tried.append(planner.__name__)
        done = success[planner.__name__]
        return Verdict(done, "done" if done else "the wrong speed", 0.0, 0.0, 0)

    monkeypatch.setattr(study, "_verdict", verdict)
    return tried


@pytest.mark.parametrize(
    ("condition", "knows", "unaware", "valid", "reason", "draws"),
    [
        ("moved", True, True, 0, study.NOT_NEEDED, study.DRAWS),
        ("moved", False, False, 0, study.NOT_DONE, study.DRAWS),
        ("moved", True, False, 1, "", 1),
        ("late", False, False, 0, study.NOT_DONE, study.DRAWS),
        ("late", True, True, 1, "", 1),
        ("pushed", False, True, 1, "", 1),
        ("heavy", False, False, 1, "", 1),
    ],
)
def test_a_scene_without_a_valid_draw_says_why(
    monkeypatch, condition, knows, unaware, valid, reason, draws
):
    verdicts(monkeypatch, Planner=knows, UnawarePlanner=unaware)
    row = study.draw(study.scene_of(480), condition)
    assert (row["valid"], row["reason"], row["draws"]) == (valid, reason, draws)


def test_a_scene_without_a_free_place_says_so(monkeypatch):
    monkeypatch.setattr(study.disturbances, "draw_places", lambda *_: None)
    for condition in ("moved", "late"):
        row = study.draw(study.scene_of(480), condition)
        assert (row["valid"], row["reason"]) == (0, study.NOT_FREE)


def test_scenes_of_the_conditions():
    assert len(study.scenes("test", "moved")) == 216 and len(study.scenes("test", "late")) == 72
    assert len(study.scenes("held_out", "pushed")) == 96
    assert len(study.scenes("held_out", "dark")) == 32
    one = study.scenes("held_out", "heavy")[3]
    assert (one.sample // 6, one.sample % 6) == (one.asked.index, 1)


def test_names_that_do_not_exist_are_refused(simulator, tmp_path):
    with pytest.raises(ConfigError, match="no split 'none'; there are"):
        study.study(tmp_path, ("none",))
    with pytest.raises(ConfigError, match="no condition 'none'; there are moved; pushed; late"):
        study.study(tmp_path, ("test",), ("none",))


def test_tasks_bring_their_disturbance_and_invalid_scenes_are_left_out(samples, table, tmp_path):
    (task,) = tasks_of(samples, "moved", "train", table)
    assert task.sample == SAMPLES["moved"] and task.disturbance.places_m is not None
    assert parse(task.instruction) == task.asked.meaning
    every = pd.read_csv(table).assign(valid=0)
    every.to_csv(tmp_path / "all.csv", index=False)
    assert tasks_of(samples, "moved", "train", tmp_path / "all.csv") == []
    with pytest.raises(ArtefactError, match="no scenes 'slippery' of the split 'train'; draw them"):
        tasks_of(samples, "slippery", "train", table)
    assert tasks_of(samples, "test", "fit")[0].disturbance is None
    assert DISTURBED == study.CONDITIONS

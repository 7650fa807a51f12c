"""The study of the closed loop: who is told what, in which scene, and what the table says of it."""

import numpy as np
import pytest

from ptae_lite.errors import RobotError
from ptae_lite.experiments import tasks as made_tasks
from ptae_lite.language import ACTIONS, parse, pattern
from ptae_lite.robot import motions
from ptae_lite.robot.scene import NOMINAL_PLACES_M


@pytest.fixture(scope="module")
def tasks(samples):
    return made_tasks.tasks_in(samples, samples.split("test"))


def test_every_test_sample_is_told_its_meaning_in_its_own_scene(samples, tasks):
    assert [task.sample for task in tasks] == samples.split("test").tolist()
    for task in tasks[::20]:
        assert parse(task.instruction) == task.asked.meaning
        assert task.stage.colours == (task.asked.left, task.asked.right)
        drawn = motions.draw(
            motions.sample_seed(task.asked.index, int(samples.variation[task.sample]))
        )
        assert (task.stage.places_m == drawn.places_m).all()
    assert len({task.instruction for task in tasks}) > 36  # synonyms, too


def test_blank_keeps_the_scene_and_drops_the_words(tasks):
    made = made_tasks.blank(tasks)
    assert {task.instruction for task in made} == {None}
    assert [task.stage for task in made] == [task.stage for task in tasks]


def test_synonyms_are_other_words_of_the_same_meaning(tasks):
    for task in made_tasks.synonyms(tasks):
        assert parse(task.instruction) == task.asked.meaning
        assert not set(task.instruction.split()) & {*ACTIONS, *task.asked.meaning}


def test_a_swapped_speed_word_changes_what_is_right(tasks):
    for old, new in zip(tasks, made_tasks.swapped_speed(tasks), strict=True):
        assert parse(new.instruction) == new.asked.meaning != old.asked.meaning
        assert (new.asked.action, new.asked.side) == (old.asked.action, old.asked.side)


def test_families_meet_that_never_met_in_training(tasks):
    two = made_tasks.first_two(tasks)
    assert len({task.asked.index for task in two}) == 36 and len(two) == 72
    made = made_tasks.new_family(two)
    trained = {(pattern(i).left, pattern(i).right) for i in range(144)}
    for task in made:
        assert task.stage.colours not in trained
        named = task.stage.colours[("left", "right").index(task.asked.side)]
        assert named == parse(task.instruction).colour


def test_displaced_cubes_are_where_training_has_none(tasks, monkeypatch):
    monkeypatch.setattr(motions, "plan", lambda *_: None)  # what the arm can do is asked below
    for task in made_tasks.displaced(tasks):
        off = np.linalg.norm(task.stage.places_m - np.array(NOMINAL_PLACES_M), axis=1)
        assert np.allclose(off, 0.024)
        assert off.min() > np.sqrt(2) * motions.PLACE_JITTER_M  # the far corner of what is known


def test_places_that_the_arm_cannot_reach_are_drawn_again(tasks, monkeypatch):
    some, tried, real = tasks[::12], [], motions.plan

    def plan(asked, variation):
        tried.append(variation.places_m)
        if len(tried) == 1:
            raise RobotError("out of reach")
        return real(asked, variation)

    monkeypatch.setattr(motions, "plan", plan)
    made = made_tasks.displaced(some)
    assert (made[0].stage.places_m == tried[1]).all() and (tried[0] != tried[1]).any()
    for task in made:
        real(task.asked, motions.middle(task.stage.places_m))  # the arm can do it


def test_an_absent_colour_is_of_the_family_and_not_on_the_table(tasks):
    for task in made_tasks.absent_colour(tasks):
        colour = parse(task.instruction).colour
        assert colour not in task.stage.colours
        pair = (pattern(i) for i in range(144))
        assert any({colour, task.stage.colours[0]} == {p.left, p.right} for p in pair)

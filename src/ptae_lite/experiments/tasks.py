"""What the closed loop is asked: scenes, sentences, and what would be right.

The conditions make of the test samples in their own scenes something that training did not show.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ptae_lite.data.samples import Samples
from ptae_lite.errors import RobotError
from ptae_lite.evaluation import alternatives_for
from ptae_lite.language import COLOURS, Pattern, pattern, sentence
from ptae_lite.robot import closed_loop, motions
from ptae_lite.robot.closed_loop import Setting
from ptae_lite.robot.motions import PLACE_JITTER_M, VARIATIONS
from ptae_lite.robot.scene import NOMINAL_PLACES_M

DISPLACED_M = 2 * PLACE_JITTER_M  # from the middle of the places that training knows


class Task(NamedTuple):
    """One episode to be acted out: the stage, the words, and what would be right."""

    sample: int  # its number, or that of the sample it was derived from
    stage: Setting
    instruction: str | None
    asked: Pattern  # whose action, side and speed count


def tasks_in(samples: Samples, indices) -> list[Task]:
    """Samples of the data set in their own scenes, each with one of its eight sentences."""
    alternative, tasks = alternatives_for(len(samples.frames)).tolist(), []
    for i in map(int, indices):
        asked = pattern(int(samples.pattern[i]))
        stage = closed_loop.stage_of(asked, int(samples.variation[i]))
        tasks.append(Task(i, stage, sentence(asked.meaning, alternative[i]), asked))
    return tasks


def as_recorded(tasks: list[Task]) -> list[Task]:
    return tasks


def first_two(tasks: list[Task]) -> list[Task]:
    """Two samples of each pattern: enough for the questions beside the main one."""
    return [task for i, task in enumerate(tasks) if i % VARIATIONS < 2]


def blank(tasks: list[Task]) -> list[Task]:
    return [task._replace(instruction=None) for task in tasks]


def synonyms(tasks: list[Task]) -> list[Task]:
    return [task._replace(instruction=sentence(task.asked.meaning, 7)) for task in tasks]


def swapped_speed(tasks: list[Task]) -> list[Task]:
    """*Fast* for *slowly* and the reverse, in the same scene; the sentence says what is right."""
    other = {"slowly": "fast", "fast": "slowly"}
    return [
        task._replace(asked=replace(task.asked, speed=other[task.asked.speed]),
                      instruction=sentence(task.asked.meaning._replace(speed=other[task.asked.speed])))
        for task in tasks
    ]  # fmt: skip


def new_family(tasks: list[Task]) -> list[Task]:
    """The cube that is not named has a colour of the other family: red meets yellow."""
    made = []
    for task in tasks:
        colours = [
            colour if colour == task.asked.meaning.colour
            else COLOURS[(COLOURS.index(colour) + 3) % len(COLOURS)]
            for colour in task.stage.colours
        ]  # fmt: skip
        made.append(task._replace(stage=task.stage._replace(colours=tuple(colours))))
    return made


def displaced(tasks: list[Task]) -> list[Task]:
    """Both cubes stand 24 mm off the middle of their place, in any direction.

    In training it is 12 mm at most to each side, so 17 mm to a corner.

    Places where the arm could not do what is asked are drawn again.
    """
    made = []
    for task in tasks:
        rng = np.random.default_rng([45, task.sample])
        while True:
            angle = rng.uniform(0, 2 * np.pi, 2)
            off = DISPLACED_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            places = np.array(NOMINAL_PLACES_M) + off
            try:
                motions.plan(task.asked, motions.middle(places))
                break
            except RobotError:
                continue
        made.append(task._replace(stage=task.stage._replace(places_m=places)))
    return made


def absent_colour(tasks: list[Task]) -> list[Task]:
    """The sentence names a colour of the same family that is not on the table."""
    made = []
    for task in tasks:
        start = COLOURS.index(task.asked.meaning.colour) // 3 * 3
        (colour,) = set(COLOURS[start : start + 3]) - set(task.stage.colours)
        made.append(task._replace(instruction=sentence(task.asked.meaning._replace(colour=colour))))
    return made


# What is asked of all test samples, and what of two of each pattern.
CONDITIONS: dict[str, Callable[[list[Task]], list[Task]]] = {
    "replay": as_recorded, "test": as_recorded, "blank": blank,
    "swapped_speed": swapped_speed, "synonyms": synonyms, "new_family": new_family,
    "displaced": displaced, "absent_colour": absent_colour, "there_and_back": as_recorded,
}  # fmt: skip
OF_ALL = ("replay", "test", "blank")


def tasks_of(samples: Samples, condition: str, split: str = "test") -> list[Task]:
    """All episodes of a condition."""
    tasks = tasks_in(samples, samples.split(split))
    return CONDITIONS[condition](tasks if condition in OF_ALL else first_two(tasks))

"""The tasks of the closed loop: scenes, sentences, and what would be right.

The conditions change test samples in their own scenes into something that training did not show.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ptae_lite import artefacts
from ptae_lite.data.samples import Samples
from ptae_lite.errors import ArtefactError, RobotError
from ptae_lite.evaluation import alternatives_for
from ptae_lite.experiments import disturbances
from ptae_lite.language import COLOURS, Pattern, pattern, sentence
from ptae_lite.robot import closed_loop, motions
from ptae_lite.robot.closed_loop import Setting
from ptae_lite.robot.disturbances import Disturbance
from ptae_lite.robot.motions import PLACE_JITTER_M, VARIATIONS
from ptae_lite.robot.scene import NOMINAL_PLACES_M

DISPLACED_M = 2 * PLACE_JITTER_M  # from the middle of the places that training knows


class Task(NamedTuple):
    """One episode to act: the scene, the sentence, and what would be right.

    Args:
        sample: its number, or that of the sample from which it was made.
        stage: the scene.
        instruction: the sentence; None for a blank one.
        asked: a pattern whose action, side and speed are the right ones.
        disturbance: what happens meanwhile; None for nothing.
    """

    sample: int
    stage: Setting
    instruction: str | None
    asked: Pattern
    disturbance: Disturbance | None = None


def tasks_in(samples: Samples, indices) -> list[Task]:
    """Samples in their own scenes, each with one of its eight sentences."""
    alternative, tasks = alternatives_for(len(samples.frames)).tolist(), []
    for i in map(int, indices):
        asked = pattern(int(samples.pattern[i]))
        stage = closed_loop.stage_of(asked, int(samples.variation[i]))
        tasks.append(Task(i, stage, sentence(asked.meaning, alternative[i]), asked))
    return tasks


def as_recorded(tasks: list[Task]) -> list[Task]:
    """The tasks, unchanged."""
    return tasks


def first_two(tasks: list[Task]) -> list[Task]:
    """Two samples of each pattern: enough for all conditions but the main ones."""
    return [task for i, task in enumerate(tasks) if i % VARIATIONS < 2]


def blank(tasks: list[Task]) -> list[Task]:
    """No sentence: its words are EOS."""
    return [task._replace(instruction=None) for task in tasks]


def synonyms(tasks: list[Task]) -> list[Task]:
    """Sentences of three synonyms."""
    return [task._replace(instruction=sentence(task.asked.meaning, 7)) for task in tasks]


def swapped_speed(tasks: list[Task]) -> list[Task]:
    """The other speed in the same scene. The sentence says it, and it is the right one."""
    other = {"slowly": "fast", "fast": "slowly"}
    return [
        task._replace(asked=replace(task.asked, speed=other[task.asked.speed]),
                      instruction=sentence(task.asked.meaning._replace(speed=other[task.asked.speed])))
        for task in tasks
    ]  # fmt: skip


def new_family(tasks: list[Task]) -> list[Task]:
    """The other cube has a colour of the other family: red stands beside yellow, say."""
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
    """Both cubes stand 24 mm away from the middle of their place, in a random direction.

    In training they are up to 12 mm away along each axis, so up to 17 mm in all. Places at which
    the arm cannot do the task are drawn again.
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
    """The sentence has a colour of the same family that no cube has."""
    made = []
    for task in tasks:
        start = COLOURS.index(task.asked.meaning.colour) // 3 * 3
        (colour,) = set(COLOURS[start : start + 3]) - set(task.stage.colours)
        made.append(task._replace(instruction=sentence(task.asked.meaning._replace(colour=colour))))
    return made


def disturbed(samples: Samples, condition: str, split: str, table=None) -> list[Task]:
    """Scenes in which something happens. Those without a valid draw are left out."""
    path = table or artefacts.stored(f"results/{disturbances.FILE}")
    rows = disturbances.read(path)
    rows = rows[(rows["split"] == split) & (rows["condition"] == condition)]
    if rows.empty:
        raise ArtefactError(
            f"{path} has no scenes {condition!r} of the split {split!r}; draw them with: "
            f"python -m ptae_lite study disturbances --splits {split}"
        )
    rows = rows[rows["valid"] == 1]
    tasks = tasks_in(samples, rows["sample"])
    return [
        task._replace(disturbance=disturbances.disturbance_of(row))
        for task, row in zip(tasks, rows.itertuples(), strict=True)
    ]


# Those in OF_ALL use all test samples; the others use two of each pattern.
CONDITIONS: dict[str, Callable[[list[Task]], list[Task]]] = {
    "replay": as_recorded, "test": as_recorded, "blank": blank,
    "swapped_speed": swapped_speed, "synonyms": synonyms, "new_family": new_family,
    "displaced": displaced, "absent_colour": absent_colour, "there_and_back": as_recorded,
}  # fmt: skip
OF_ALL = ("replay", "test", "blank")


DISTURBED = disturbances.CONDITIONS  # each scene with what is drawn for it in `disturbances.csv`


def tasks_of(samples: Samples, condition: str, split: str = "test", table=None) -> list[Task]:
    """All tasks of a condition, of `CONDITIONS` or of `DISTURBED`.

    Args:
        table: the file `disturbances.csv`; the stored one if None.

    Raises:
        ArtefactError: the file has no scenes of this condition and split.
    """
    if condition in DISTURBED:
        return disturbed(samples, condition, split, table)
    tasks = tasks_in(samples, samples.split(split))
    return CONDITIONS[condition](tasks if condition in OF_ALL else first_two(tasks))

"""Draws the disturbed scenes of the closed loop, by the planner alone: no policy acts.

Most random moves of a cube are no test of a policy's eyes, as the motion for the unmoved scene
still succeeds. So in `moved` each scene has up to `DRAWS` draws, until the planner that does not
know of the move fails and the one that knows succeeds. Scenes without such a draw say why. In
`late`, the planner that knows must succeed. All other disturbances are drawn once.

A row is a scene of a split under one condition, with what both planners did.
"""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import NamedTuple

import joblib
import numpy as np
import pandas as pd

from ptae_lite.cli import bar, whole_number
from ptae_lite.data.splits import SPLITS
from ptae_lite.experiments import options, tables
from ptae_lite.experiments.runner import check_names
from ptae_lite.language import SIDES, Pattern, pattern
from ptae_lite.robot import arm, closed_loop, disturbances, motions
from ptae_lite.robot.closed_loop import Verdict
from ptae_lite.robot.corrections import Planner, UnawarePlanner
from ptae_lite.robot.disturbances import Disturbance
from ptae_lite.robot.motions import Variation
from ptae_lite.robot.scene import TABLE_TOP_M, pybullet

FILE = "disturbances.csv"
KEY = ["split", "condition", "sample"]
DRAWS = 12
MOVED_M, PUSHED_M = (0.020, 0.040), (0.030, 0.060)
MOVED_AT, PUSHED_AT = 0.5, 0.5  # shares of the way to above the cube, when it happens
PUSH_CLOCK, HELD_CLOCK = 6, 26  # slow frames in which the hand is driven off, and held there
ROUND = 5  # decimals of what is drawn, in metres: the table says exactly what was tried
CHANGED = {
    "slippery": Disturbance(friction=0.5), "heavy": Disturbance(mass=2.0),
    "dark": Disturbance(light=2 / 3),
}  # fmt: skip
CONDITIONS = ("moved", "pushed", "late", *CHANGED)
OF_ALL = ("moved", "pushed")  # the others take two samples of each pattern
NOT_FREE = "no place is free"
NOT_NEEDED = "the planner that does not know succeeds"
NOT_DONE = "the planner that knows fails"


class Scene(NamedTuple):
    """A sample's scene and its motion."""

    sample: int
    asked: Pattern
    drawn: Variation


def scenes(split: str, condition: str) -> list[Scene]:
    """The scenes of a split that a condition takes."""
    variations = range(motions.VARIATIONS if condition in OF_ALL else 2)
    seeds = [motions.sample_seed(index, v) for index in SPLITS[split] for v in variations]
    return [scene_of(seed) for seed in seeds]


def scene_of(sample: int) -> Scene:
    """The scene of a sample of the recording."""
    return Scene(sample, pattern(sample // motions.VARIATIONS), motions.draw(sample))


def draw(scene: Scene, condition: str, most: int = DRAWS) -> dict:
    """A row: the disturbance that a scene has under a condition, and what the planners do.

    Args:
        most: draws where there may be more than one.
    """
    rng = np.random.default_rng([CONDITIONS.index(condition), scene.sample])
    row = {"draws": 1, "valid": 1, "reason": ""}
    which = "named" if condition == "late" or rng.random() < 0.5 else "both"
    for number in range(1, most + 1 if condition in ("moved", "late") else 2):
        row["draws"], what = number, _draw(rng, scene, condition, which)
        if what is None:
            return row | {"valid": 0, "reason": NOT_FREE}
        unaware = _verdict(scene, UnawarePlanner, what)
        if condition == "moved" and unaware.success and number < DRAWS:
            continue
        knows = _verdict(scene, Planner, what)
        row |= _columns(what, which if condition in ("moved", "late") else "")
        row |= {"knows": int(knows.success), "knows_reason": knows.reason,
                "unaware": int(unaware.success), "unaware_reason": unaware.reason}  # fmt: skip
        if condition == "moved" and unaware.success:
            row |= {"valid": 0, "reason": NOT_NEEDED}
        elif condition in ("moved", "late") and not knows.success:
            row |= {"valid": 0, "reason": NOT_DONE}
        else:
            return row | {"valid": 1, "reason": ""}
    return row


def _draw(rng, scene: Scene, condition: str, which: str) -> Disturbance | None:
    """One draw; None if there is no free place."""
    asked, drawn = scene.asked, scene.drawn
    if condition in CHANGED:
        return CHANGED[condition]
    start, along = motions.stroke_start_m(asked, drawn)
    above = np.array([*start, TABLE_TOP_M + drawn.high_m])
    home = np.array(arm.HOME_TIP_M)
    way_m = float(np.linalg.norm(above - home))
    if condition == "pushed":
        at_m = home + PUSHED_AT * (above - home)
        push_m = disturbances.draw_push(rng, asked, drawn, at_m, *PUSHED_M)
        if push_m is None:
            return None
        scale = (asked.frames - 1) / motions.CLOCK[-1]
        return Disturbance(
            away_m=round(PUSHED_AT * way_m, ROUND), push_m=push_m.round(ROUND),
            push_frames=round(PUSH_CLOCK * scale), held_frames=round(HELD_CLOCK * scale),
        )  # fmt: skip
    for _ in range(disturbances.TRIES):
        places = disturbances.draw_places(rng, asked, drawn, which, *MOVED_M)
        if places is None:
            return None
        places = places.round(ROUND)
        if condition == "moved":
            return Disturbance(away_m=round(MOVED_AT * way_m, ROUND), places_m=places)
        hand = np.linalg.norm(places[SIDES.index(asked.side)] - start)
        if hand > disturbances.CUBE_RADIUS_M + arm.HAND_RADIUS_M + disturbances.CLEAR_M:
            return Disturbance(low=True, places_m=places)
    return None


def _verdict(scene: Scene, planner, what: Disturbance) -> Verdict:
    asked = scene.asked
    stage = closed_loop.Setting(
        (asked.left, asked.right), scene.drawn.places_m, scene.drawn.yaws_rad
    )
    episode = closed_loop.perform(stage, planner(asked, scene.drawn), disturbance=what)
    return closed_loop.judge(episode, asked.action, asked.side, asked.speed)


def _columns(what: Disturbance, which: str) -> dict:
    """A disturbance as columns of the table: metres, shares, frames."""
    row = {"cubes": which, "away_m": what.away_m, "low": int(what.low)}
    places = np.full((2, 2), np.nan) if what.places_m is None else what.places_m
    push = np.full(3, np.nan) if what.push_m is None else what.push_m
    for side, place in zip(SIDES, places, strict=True):
        row |= {f"{side}_x_m": place[0], f"{side}_y_m": place[1]}
    row |= dict(zip(("push_x_m", "push_y_m", "push_z_m"), push, strict=True))
    return row | {"push_frames": what.push_frames, "held_frames": what.held_frames}


def disturbance_of(row) -> Disturbance:
    """The disturbance of a row of the table.

    Args:
        row: with the names of the columns as attributes, as `itertuples` gives it.
    """
    if row.condition in CHANGED:
        return CHANGED[row.condition]
    places = np.array([[row.left_x_m, row.left_y_m], [row.right_x_m, row.right_y_m]])
    push = np.array([row.push_x_m, row.push_y_m, row.push_z_m])
    return Disturbance(
        away_m=float(row.away_m), low=bool(row.low),
        push_frames=int(row.push_frames), held_frames=int(row.held_frames),
        places_m=None if np.isnan(places).any() else places,
        push_m=None if np.isnan(push).any() else push,
    )  # fmt: skip


def read(path) -> pd.DataFrame:
    """The table, with empty texts where nothing went wrong."""
    table = tables.read(Path(path), KEY)
    for name in ("reason", "cubes", "knows_reason", "unaware_reason"):
        if name in table:
            table[name] = table[name].astype(object).fillna("")
    return table


def study(folder, splits=("held_out",), conditions=CONDITIONS, workers: int = 1,
          progress=lambda results, total: results) -> pd.DataFrame:  # fmt: skip
    """Make the rows that `disturbances.csv` in a folder lacks; return the whole table.

    Raises:
        ConfigError: there is no such split or condition.
        RobotError: PyBullet is not installed.
    """
    check_names(splits, SPLITS, "split")
    check_names(conditions, CONDITIONS, "condition")
    pybullet()  # fail here, not in every worker
    path = Path(folder) / FILE
    done = tables.there(path, KEY)
    jobs = [
        (split, condition, scene.sample)
        for split in splits for condition in conditions for scene in scenes(split, condition)
    ]  # fmt: skip
    left = [job for job in jobs if job not in done]
    tables.run(_row, left, lambda rows: tables.add(path, rows, KEY), workers, progress)
    return read(path)


def _row(split: str, condition: str, sample: int) -> pd.DataFrame:
    scene = scene_of(sample)
    head = {"split": split, "condition": condition, "sample": sample}
    head |= {"pattern": scene.asked.index, "variation": sample % motions.VARIATIONS}
    empty = _columns(Disturbance(), "") | dict.fromkeys(("knows", "unaware"), 0)
    empty |= dict.fromkeys(("knows_reason", "unaware_reason"), "")
    return pd.DataFrame([head | empty | draw(scene, condition)])


def add_options(parser: ArgumentParser) -> None:
    """Add the options of the study."""
    parser.add_argument("--splits", nargs="+", metavar="NAME", default=("held_out", "test"),
                        help="of whose scenes")  # fmt: skip
    parser.add_argument("--conditions", nargs="+", metavar="NAME", default=CONDITIONS,
                        help="which disturbances")  # fmt: skip
    parser.add_argument("--workers", type=whole_number(1), default=joblib.cpu_count(),
                        help="scenes side by side; as many as there are cores")  # fmt: skip


def command(given) -> dict:
    """Run the study with its options; returns what the command prints."""
    table = study(given.out, given.splits, given.conditions, given.workers,
                  lambda results, total: bar(results, total=total, desc="scenes"))  # fmt: skip
    made = options.result(given, FILE, table)
    for condition, rows in table.groupby("condition", sort=False):
        valid = rows[rows["valid"] == 1]
        made[condition] = (
            f"{len(valid)} of {len(rows)} scenes; the planner that knows succeeds in "
            f"{int(valid['knows'].sum())}, the one that does not in {int(valid['unaware'].sum())}"
        )
    return made

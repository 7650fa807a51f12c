"""The planner that corrects itself: a rule on the present state, and that it always succeeds."""

from dataclasses import replace

import numpy as np
import pytest

from ptae_lite.data.splits import SPLITS
from ptae_lite.language import pattern, patterns
from ptae_lite.robot import arm, closed_loop, corrections, inverse, motions
from ptae_lite.robot.corrections import Phase, Planner, UnawarePlanner, correct
from ptae_lite.robot.disturbances import Disturbance, draw_places, draw_push
from ptae_lite.robot.scene import TABLE_TOP_M

SLOW, FAST = 0, 80
STEP = {SLOW: 1.0, FAST: 99 / 49}  # slow frames in a frame


def cubes_at(places_m):
    cubes = np.zeros((2, 7))
    cubes[:, :2], cubes[:, 2] = places_m, TABLE_TOP_M + 0.025
    return cubes


def followed(index, drawn, places, tip_m, phase, frames):
    """An arm without inertia that goes where the rule says."""
    tips, phases = [tip_m], [phase]
    for _ in range(frames):
        goal, phase = correct(pattern(index), drawn, tips[-1], cubes_at(places), phase)
        tips.append(goal)
        phases.append(phase)
    return np.array(tips), phases


@pytest.mark.parametrize("index", [SLOW, FAST])
def test_on_its_path_the_planner_goes_on(index):
    p, drawn = pattern(index), motions.draw(index)
    path = motions.fingertip_path(p, drawn)
    tips, phases = followed(index, drawn, drawn.places_m, path[0], Phase(0.0, drawn.places_m),
                            p.frames + 3)  # fmt: skip
    np.testing.assert_allclose(tips[: p.frames], path, atol=1e-9)
    np.testing.assert_allclose(tips[p.frames :], path[[-1] * 4], atol=1e-9)
    assert phases[-1].clock == 99


@pytest.mark.parametrize(("index", "frames"), [(SLOW, 10), (FAST, 5)])
@pytest.mark.parametrize("off", [(0.045, 0, 0), (0, -0.045, 0), (0.03, 0.03, 0.01)])
def test_it_is_back_on_its_path_after_ten_slow_frames(index, frames, off):
    p, drawn = pattern(index), motions.draw(index)
    begun = 5
    path = motions.fingertip_path(p, drawn)
    phase = Phase(begun * STEP[index], drawn.places_m)
    tips, _ = followed(index, drawn, drawn.places_m, path[begun] + off, phase, frames)
    off_path = np.linalg.norm(tips - path[begun : begun + frames + 1], axis=1)
    assert (np.diff(off_path) < 0).all() and off_path[-1] < 2e-3
    steps = np.linalg.norm(np.diff(tips - path[begun : begun + frames + 1], axis=0), axis=1)
    assert steps.max() < 0.02 * STEP[index]  # no jump


@pytest.mark.parametrize("index", [SLOW, FAST])
def test_a_moved_cube_is_the_new_aim_until_the_stroke_starts(index):
    p, drawn = pattern(index), motions.draw(index)
    side = ("left", "right").index(p.side)
    places = drawn.places_m.copy()
    places[side] += [0.0, 0.03]
    new = replace(drawn, places_m=places)
    begun = Phase(drawn.clock[2] - 2.5, drawn.places_m)
    tip = motions.points_at(p, drawn, np.array([begun.clock]))[0]
    tips, phases = followed(index, drawn, places, tip, begun, 40)
    start, _ = motions.stroke_start_m(p, new)
    starts = next(i for i, one in enumerate(phases) if one.clock >= drawn.clock[2])
    assert np.linalg.norm(tips[starts - 1, :2] - start) < corrections.READY_M
    later = phases[starts]
    for shift in (0.0, 0.02):  # what the stroke itself does to the cube is no new aim
        goal, now = correct(p, drawn, tips[starts], cubes_at(places + shift), later)
        np.testing.assert_allclose(now.places_m, places)
        assert np.linalg.norm(goal - tips[starts]) < 0.02


def test_it_does_not_come_down_before_it_is_above_the_place():
    p, drawn = pattern(SLOW), motions.draw(SLOW)
    places = drawn.places_m + [[0.0, 0.04], [0.0, 0.0]]
    start, _ = motions.stroke_start_m(p, replace(drawn, places_m=places))
    phase = Phase(drawn.clock[1], drawn.places_m)
    tip = motions.points_at(p, drawn, np.array([phase.clock]))[0]
    tips, _ = followed(SLOW, drawn, places, tip, phase, 14)
    aside = np.linalg.norm(tips[:, :2] - start, axis=1)
    assert aside[0] > 0.035
    high = TABLE_TOP_M + drawn.high_m
    assert (tips[aside > corrections.FAR_M, 2] > high - 1e-3).all()
    assert tips[-1, 2] < high - 0.04 and aside[-1] < corrections.CLOSE_M


def test_where_the_arm_cannot_go_it_goes_as_near_as_it_can():
    p, drawn = pattern(SLOW), motions.draw(SLOW)
    home = inverse.home_rad()
    far = np.array([0.70, 0.20, 0.65])
    q = inverse.towards(far, home)
    arm.check_limits(q[None])
    tip = arm.fingertip(q[None])[0]
    assert 0.15 < np.linalg.norm(tip - far) < np.linalg.norm(np.array(arm.HOME_TIP_M) - far) - 0.1
    on_way = np.cross(far - np.array(arm.HOME_TIP_M), tip - np.array(arm.HOME_TIP_M))
    assert np.linalg.norm(on_way) / np.linalg.norm(far - np.array(arm.HOME_TIP_M)) < 0.01
    path = motions.fingertip_path(p, drawn)
    plan, now = motions.plan(p, drawn), home
    for point, wanted in zip(path, plan, strict=True):  # within reach, it is what `solve` finds
        now = inverse.towards(point, now)
        np.testing.assert_allclose(now, wanted, atol=2e-3)
        np.testing.assert_allclose(arm.fingertip(now[None])[0], point, atol=1e-4)


def disturbed(rng, number):
    """A scene, and a disturbance in the range for which the planner is made."""
    index = SPLITS["train"][int(rng.integers(len(SPLITS["train"])))]
    p, drawn = patterns()[index], motions.draw(300_000 + number)
    scale = (p.frames - 1) / 99
    frame = round(rng.uniform(3, 20) * scale)
    places = push = None
    if number % 3 != 1:
        which = str(rng.choice(["named", "both", "other"]))
        places = draw_places(rng, p, drawn, which, 0.010, 0.045)
    if number % 3 != 0:
        now = drawn if places is None else replace(drawn, places_m=places)
        push = draw_push(rng, p, now, motions.fingertip_path(p, drawn)[frame], 0.030, 0.060)
    took, held = round(6 * scale), round(rng.uniform(0, 26) * scale)
    return p, drawn, Disturbance(frame, places_m=places, push_m=push, push_frames=took,
                                 held_frames=held)  # fmt: skip


def succeeds(policy, p, drawn, what) -> bool:
    stage = closed_loop.Setting((p.left, p.right), drawn.places_m, drawn.yaws_rad)
    episode = closed_loop.perform(stage, policy(p, drawn), disturbance=what)
    return closed_loop.judge(episode, p.action, p.side, p.speed).success


def test_the_planner_succeeds_where_the_unaware_one_fails(simulator):
    rng = np.random.default_rng(1)
    draws = [disturbed(rng, number) for number in range(3)]
    assert all(succeeds(Planner, *one) for one in draws)
    assert sum(succeeds(UnawarePlanner, *one) for one in draws) <= 1
    p, drawn = pattern(FAST), motions.draw(FAST)
    assert succeeds(UnawarePlanner, p, drawn, None)  # where nothing happens, it does as planned


@pytest.mark.slow
def test_from_any_disturbed_state_the_planner_succeeds_in_99_of_100(simulator):
    rng = np.random.default_rng(2)
    assert sum(succeeds(Planner, *disturbed(rng, number)) for number in range(200)) >= 198


def test_the_unaware_planner_goes_on_from_where_it_was_pushed():
    p, drawn = pattern(FAST), motions.draw(FAST)
    plan = motions.plan(p, drawn)
    policy = UnawarePlanner(p, drawn)
    for t in range(5):
        np.testing.assert_allclose(policy(None, plan[t]), plan[t + 1])
    pushed = plan[5] + 0.1
    np.testing.assert_allclose(policy(None, pushed), pushed + plan[6] - plan[5])

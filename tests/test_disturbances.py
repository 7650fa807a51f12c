"""What happens from outside: cubes are moved, the hand is pushed, friction, mass, light."""

from dataclasses import replace

import numpy as np
import pytest

from ptae_lite.language import pattern, patterns
from ptae_lite.robot import arm, closed_loop, disturbances, inverse, motions
from ptae_lite.robot.closed_loop import Episode, judge
from ptae_lite.robot.disturbances import Disturbance, draw_places, draw_push
from ptae_lite.robot.scene import TABLE_TOP_M, Scene

FAST = 80  # pushes the left cube in 50 frames


def stage_and_act():
    p = pattern(FAST)
    drawn = motions.draw(FAST)
    stage = closed_loop.Setting((p.left, p.right), drawn.places_m, drawn.yaws_rad)
    return stage, drawn, closed_loop.replay(motions.plan(p, drawn))


def performed(disturbance, limit=60, watch=False):
    """An episode of the plan, and what it saw."""
    stage, drawn, replay = stage_and_act()
    seen = []

    def act(look, joints_rad):
        if watch:
            seen.append(look())
        return replay(look, joints_rad)

    return closed_loop.perform(stage, act, limit, disturbance), seen, drawn


def test_nothing_happens_by_default(simulator):
    plain, none = performed(None)[0], performed(Disturbance())[0]
    assert (plain.joints_rad == none.joints_rad).all() and (plain.cubes == none.cubes).all()
    assert plain.event == none.event == -1 and not plain.shift_m.any()


def test_cubes_are_moved_before_the_frame_and_the_camera_sees_it(simulator):
    _, _, drawn = performed(None, 1)
    places = drawn.places_m + [[0.02, -0.01], [0.0, 0.03]]
    made, seen, _ = performed(Disturbance(frame=4, places_m=places), 8, watch=True)
    plain, unmoved, _ = performed(None, 8, watch=True)
    assert made.event == 4
    np.testing.assert_allclose(made.cubes[4, :, :2], places, atol=1e-6)
    np.testing.assert_allclose(made.cubes[3], plain.cubes[3])
    changed = [(a != b).any() for a, b in zip(seen, unmoved, strict=True)]
    assert changed == [False] * 4 + [True] * 3
    assert (made.joints_rad[:5] == plain.joints_rad[:5]).all()


def test_a_cube_that_stays_is_not_touched(simulator):
    stage, drawn, _ = stage_and_act()
    with Scene(*stage) as world:
        before = world.cubes()
        world.put(np.array([before[0, :2], [0.41, -0.02]]))
        assert (world.cubes()[0] == before[0]).all()
        np.testing.assert_allclose(world.cubes()[1, :2], [0.41, -0.02])


def test_ways_are_measured_from_the_place_after_the_move():
    cubes = np.zeros((50, 2, 7))
    cubes[:, :, 2] = 0.585
    cubes[20:, 0, 1] = 0.030  # moved from outside
    cubes[30:, 0, 0] = 0.060  # pushed by the arm
    shift = np.array([[0.0, 0.030], [0.0, 0.0]])
    episode = Episode(np.zeros((50, 5)), cubes, "home", 20, shift)
    np.testing.assert_allclose(episode.moved_mm, [[60, 0], [0, 0]], atol=1e-9)
    assert judge(episode, "push", "left", "fast").success
    other = np.array([[0.0, 0.0], [0.030, 0.0]])
    cubes[20:, 0, 1], cubes[20:, 1, 0] = 0, 0.030
    assert judge(
        Episode(episode.joints_rad, cubes, "home", 20, other), "push", "left", "fast"
    ).success
    assert not judge(Episode(episode.joints_rad, cubes, "home"), "push", "left", "fast").success


def test_it_waits_until_the_hand_is_on_its_way_or_low(simulator):
    _, _, drawn = performed(None, 1)
    away = performed(Disturbance(away_m=0.05, places_m=drawn.places_m))[0]
    tips = arm.fingertip(away.joints_rad)
    far = np.linalg.norm(tips - np.array(arm.HOME_TIP_M), axis=1) >= 0.05
    assert away.event == far.argmax() > 0
    low = performed(Disturbance(low=True, places_m=drawn.places_m))[0]
    is_low = arm.fingertip(low.joints_rad)[:, 2] < TABLE_TOP_M + disturbances.LOW_M
    assert low.event == is_low.argmax() > away.event
    assert performed(Disturbance(away_m=9.0, places_m=drawn.places_m))[0].event == -1


def test_a_push_is_stronger_than_the_motors_and_holds(simulator):
    push = np.array([0.03, 0.03, 0.01])
    what = Disturbance(frame=3, push_m=push, push_frames=3, held_frames=4)
    made = performed(what, 16)[0]
    tips, plain = arm.fingertip(made.joints_rad), arm.fingertip(performed(None, 16)[0].joints_rad)
    assert made.event == 3 and not made.shift_m.any()
    np.testing.assert_allclose(tips[:4], plain[:4])
    np.testing.assert_allclose(tips[7:11], np.tile(tips[3] + push, (4, 1)), atol=2e-3)
    assert np.linalg.norm(tips[10] - plain[10]) > 0.03
    assert np.linalg.norm(tips[13:] - plain[13:], axis=1).max() < 5e-3  # let go: back on the plan


def test_cubes_become_slippery_and_heavy(simulator):
    stage, *_ = stage_and_act()
    with Scene(*stage) as world:
        world.alter(friction=0.5, mass=2.0)
        found = [world._p.getDynamicsInfo(cube, -1, **world._at)[:2] for cube in world.cube_ids]
    np.testing.assert_allclose(found, [(0.16, 0.25)] * 2)
    slippery = performed(Disturbance(friction=0.5))[0]
    assert (slippery.cubes[-1] != performed(None)[0].cubes[-1]).any()


def test_the_light_is_a_third_darker_in_every_image(simulator):
    _, dark, _ = performed(Disturbance(light=2 / 3), 3, watch=True)
    _, light, _ = performed(None, 3, watch=True)
    table = light[0][100:, 20:140]
    share = dark[0][100:, 20:140].astype(float) / table
    assert abs(np.median(share) - 2 / 3) < 0.05 and dark[1].mean() < 0.8 * light[1].mean()
    _, again, _ = performed(None, 3, watch=True)  # the next scene has its usual light
    assert (again[0] == light[0]).all()


@pytest.mark.parametrize("which", ["named", "other", "both"])
def test_places_are_drawn_as_far_as_asked_and_free(which):
    rng = np.random.default_rng(0)
    for index in range(0, 144, 29):
        p, drawn = patterns()[index], motions.draw(index)
        places = draw_places(rng, p, drawn, which, 0.020, 0.040)
        far = np.linalg.norm(places - drawn.places_m, axis=1)
        side = ("left", "right").index(p.side)
        moved = {"named": [side], "other": [1 - side], "both": [0, 1]}[which]
        for cube in (0, 1):
            assert 0.020 <= far[cube] <= 0.040 if cube in moved else far[cube] == 0
        assert disturbances.is_free(p, places, drawn)


def test_places_in_each_others_way_or_out_of_reach_are_not_free(monkeypatch):
    monkeypatch.setattr(disturbances, "TRIES", 4)
    p, drawn = pattern(0), motions.draw(0)  # pushes the left cube away from the robot
    assert p.action == "push" and p.side == "left"
    named = drawn.places_m[0]
    assert disturbances.is_free(p, drawn.places_m, drawn)
    assert not disturbances.is_free(p, np.array([named, named + [0.0, -0.09]]), drawn)
    assert not disturbances.is_free(p, np.array([named, named + [0.11, 0.0]]), drawn)
    assert not disturbances.is_free(p, np.array([named, [0.48, 0.0]]), drawn)
    far = replace(drawn, travel_m=0.4)  # the stroke ends out of reach
    assert not disturbances.is_free(p, drawn.places_m, far)
    assert draw_places(np.random.default_rng(0), p, far, "named", 0.02, 0.04) is None


def test_a_push_leaves_the_hand_a_way_back(monkeypatch):
    rng = np.random.default_rng(0)
    for index in range(0, 144, 29):
        p, drawn = patterns()[index], motions.draw(index)
        at = motions.fingertip_path(p, drawn)[p.frames // 10]
        push = draw_push(rng, p, drawn, at, 0.030, 0.060)
        assert 0.030 <= np.linalg.norm(push) <= 0.060
        assert np.linalg.norm(at + push - np.array(arm.HOME_TIP_M)) >= disturbances.FROM_HOME_M
        inverse.solve((at + push)[None])
    monkeypatch.setattr(disturbances, "TRIES", 4)
    edge = np.array([0.60, 0.10, 0.60])  # at full stretch
    assert draw_push(rng, p, drawn, edge, 0.20, 0.25) is None

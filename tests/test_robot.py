"""NICO's arm: measures, forward and inverse kinematics, URDF, and the planned motions."""

import sys
import xml.etree.ElementTree as xml
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from ptae_lite.errors import RobotError
from ptae_lite.language import patterns
from ptae_lite.robot import arm, inverse, motions, scene, urdf

PLANNED = [p for p in patterns() if p.index % 13 == 0]  # all actions, sides, speeds are in


def random_poses(count, seed=0):
    return np.random.default_rng(seed).uniform(arm.LOWER_RAD, arm.UPPER_RAD, (count, 5))


@pytest.fixture(scope="module")
def plans():
    """(pattern, variation, joints) of a sample of the patterns."""
    drawn = [(p, motions.draw(motions.sample_seed(p.index, p.index % 6))) for p in PLANNED]
    return [(p, variation, motions.plan(p, variation)) for p, variation in drawn]


def test_the_joint_table():
    assert arm.JOINT_NAMES == ("shoulder_z", "shoulder_y", "arm_x", "elbow_y", "wrist_z")
    assert arm.LOWER_RAD.tolist() == [-2.182, -3.124, -1.868, 0.0, -1.571]
    assert arm.UPPER_RAD.tolist() == [1.745, 3.142, 3.002, 1.745, 1.571]


@pytest.mark.parametrize(
    ("link", "place_m", "tolerance_m"),
    [
        ("shoulder", (0.027, 0.050, 0.749), 0.0015),
        ("collar", (0.049, 0.073, 0.786), 0.0015),
        ("upper_arm", (0.073, 0.146, 0.763), 0.0015),
        # the fixed rotations that are left out move the rest by up to 10 mm at zero,
        ("forearm", (0.048, 0.169, 0.592), 0.011),
        ("wrist", (0.048, 0.159, 0.466), 0.011),
        # and wrist_x sits 23 mm further forward
        ("hand", (0.072, 0.154, 0.395), 0.035),
    ],
)
def test_the_zero_pose_is_that_of_the_robots_published_description(link, place_m, tolerance_m):
    found = arm.link_transforms(np.zeros((1, 5)))[link][0, :3, 3]
    assert np.linalg.norm(found - place_m) < tolerance_m


def test_forward_kinematics_by_hand_for_one_bent_joint():
    bent = np.zeros((1, 5))
    bent[0, 3] = np.pi / 2  # the elbow turns about -y: the hanging forearm swings forward
    hanging, swung = (arm.link_transforms(q)["wrist"][0, :3, 3] for q in (np.zeros((1, 5)), bent))
    elbow = arm.link_transforms(bent)["forearm"][0, :3, 3]
    np.testing.assert_allclose(hanging - elbow, [0, -0.010, -0.126], atol=1e-12)
    np.testing.assert_allclose(swung - elbow, [0.126, -0.010, 0], atol=1e-12)


def test_forward_kinematics_is_what_the_simulator_sees(simulator):
    p = simulator
    with scene.Scene(("red", "blue")) as world:
        at = {"physicsClientId": world._client}
        count = p.getNumJoints(world._nico, **at)
        links = {p.getJointInfo(world._nico, i, **at)[12].decode(): i for i in range(count)}
        assert {"shoulder", "collar", "upper_arm", "forearm", "wrist", "hand"} <= set(links)
        for pose in random_poses(20):
            for i, angle in zip(world._joints, pose, strict=True):
                p.resetJointState(world._nico, i, angle, **at)
            ours = arm.link_transforms(pose[None])
            for name, i in links.items():
                _, _, _, _, place, turn, *_ = p.getLinkState(
                    world._nico, i, computeForwardKinematics=True, **at
                )
                np.testing.assert_allclose(ours[name][0, :3, 3], place, atol=1e-6)
                theirs = np.reshape(p.getMatrixFromQuaternion(turn), (3, 3))
                np.testing.assert_allclose(ours[name][0, :3, :3], theirs, atol=1e-5)


def test_the_urdf_holds_the_five_joints_with_their_limits():
    robot = xml.fromstring(urdf.nico_urdf())
    joints = [joint for joint in robot.iter("joint") if joint.get("type") == "revolute"]
    assert tuple(joint.get("name") for joint in joints) == arm.JOINT_NAMES
    for found, ours in zip(joints, arm.JOINTS, strict=True):
        limit = found.find("limit")
        assert float(limit.get("lower")) == ours.lower_rad
        assert float(limit.get("upper")) == ours.upper_rad
        assert tuple(float(x) for x in found.find("axis").get("xyz").split()) == ours.axis
    chain = [[joint.find(end).get("link") for end in ("parent", "child")] for joint in joints]
    assert chain[0][0] == "torso" and chain[-1][1] == "wrist"
    assert all(above[1] == below[0] for above, below in pairwise(chain))


def test_the_urdf_is_the_same_text_each_time():
    assert urdf.nico_urdf() == urdf.nico_urdf()


def test_inverse_kinematics_reaches_what_its_message_promises_within_the_limits():
    targets = np.random.default_rng(2).uniform((0.33, -0.10, 0.57), (0.45, 0.25, 0.68), (300, 3))
    found = inverse.solve(targets)
    assert np.linalg.norm(arm.fingertip(found) - targets, axis=1).max() <= 1e-4
    arm.check_limits(found)


def test_a_point_out_of_reach_is_refused_with_the_miss():
    with pytest.raises(RobotError, match=r"cannot reach \(1.000, 0.000, 0.600\) m: .* misses by"):
        inverse.solve(np.array([[0.4, 0.1, 0.6], [1.0, 0.0, 0.6]]))


def test_the_home_pose_is_at_the_home_point_and_cannot_be_changed():
    home = inverse.home_rad()
    np.testing.assert_allclose(arm.fingertip(home[None])[0], arm.HOME_TIP_M, atol=1e-4)
    with pytest.raises(ValueError, match="read-only"):
        home[0] = 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: arm.check_shape(np.zeros(5)), r"frames x 5 angles .*, not of shape \(5,\)"),
        (lambda: arm.check_limits(np.full((3, 5), -0.1)), "elbow_y is at -0.100 rad in frame 0; "
         "its limits are 0.000 to 1.745"),
        (lambda: inverse.solve(np.zeros((4, 2))), r"frames x 3 metres, not \(4, 2\)"),
        (lambda: scene.Scene(("red", "pink")), "no colour 'pink'; the cubes are red, green"),
    ],
)  # fmt: skip
def test_wrong_input_is_refused_with_what_was_expected(unchecked, call, message):
    with pytest.raises(RobotError, match=message):
        call()


def test_without_pybullet_one_sentence_says_how_to_go_on(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(RobotError, match="PyBullet is not installed.*the stored recording"):
        scene.Scene(("red", "blue"))


def test_a_camera_that_gives_tuples_shows_the_same():
    """As of a PyBullet that was built without numpy."""
    shape = (scene.IMAGE_HEIGHT, scene.IMAGE_WIDTH, 4)
    pixels = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    world = object.__new__(scene.Scene)
    world._view = world._projection = world._client = None
    world._at, seen = {}, []
    for given in (pixels, tuple(pixels.ravel().tolist())):
        answer = (scene.IMAGE_WIDTH, scene.IMAGE_HEIGHT, given, (), ())
        world._p = SimpleNamespace(
            ER_TINY_RENDERER=0, ER_NO_SEGMENTATION_MASK=0,
            getCameraImage=lambda *_, answer=answer, **__: answer,
        )  # fmt: skip
        seen.append(world.image())
    array, tuples = seen
    assert tuples.dtype == array.dtype == np.uint8 and tuples.flags == array.flags
    np.testing.assert_array_equal(tuples, pixels[:, :, :3])
    np.testing.assert_array_equal(tuples, array)


def test_plans_go_from_home_to_home_within_the_limits(plans):
    assert {p.action_index for p, *_ in plans} == set(range(12))
    for p, _, joints in plans:
        assert len(joints) == p.frames
        np.testing.assert_allclose(joints[[0, -1]], [inverse.home_rad()] * 2, atol=1e-3)
        arm.check_limits(joints)


def test_plans_are_smooth(plans):
    """No joint jumps: largest step, and largest change of a step, in degrees a frame."""
    limits = {"slowly": (7, 2.5), "fast": (14, 7)}
    for p, _, joints in plans:
        step, change = limits[p.speed]
        assert np.degrees(np.abs(np.diff(joints, axis=0)).max()) < step
        assert np.degrees(np.abs(np.diff(joints, 2, axis=0)).max()) < change


def test_fingertips_stay_above_the_table(plans):
    for *_, joints in plans:
        assert arm.fingertip(joints)[:, 2].min() > scene.TABLE_TOP_M + 0.009


def test_the_stroke_starts_off_the_cube_and_goes_on_through_it(plans):
    for p, variation, joints in plans:
        tips = arm.fingertip(joints)[:, :2]
        cube = variation.places_m[0 if p.side == "left" else 1]
        along = (tips - cube) @ motions.DIRECTION[p.action]
        low = arm.fingertip(joints)[:, 2] < scene.TABLE_TOP_M + 0.02
        assert along[low].min() == pytest.approx(-motions.STANDOFF_M, abs=2e-3)
        end = variation.travel_m + motions.GAP_M - motions.STANDOFF_M
        assert along[low].max() == pytest.approx(end, abs=2e-3)


def test_a_fast_motion_takes_the_same_way_in_half_the_frames():
    slow, fast = patterns()[4], patterns()[76]
    variation = motions.draw(0)
    ways = [motions.fingertip_path(p, variation) for p in (slow, fast)]
    assert [len(way) for way in ways] == [100, 50]
    lengths = [np.linalg.norm(np.diff(way, axis=0), axis=1) for way in ways]
    assert lengths[1].sum() == pytest.approx(lengths[0].sum(), rel=0.02)
    assert lengths[1].max() == pytest.approx(2 * lengths[0].max(), rel=0.05)


def test_a_variation_depends_on_its_seed_only():
    first, again, other = (vars(motions.draw(seed)) for seed in (5, 5, 6))
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])
        assert not np.array_equal(first[name], other[name])


def test_every_sample_has_its_own_seed():
    seeds = [motions.sample_seed(p.index, v) for p in patterns() for v in range(6)]
    assert seeds == list(range(864))


def test_variations_stay_within_their_ranges():
    nominal = np.array(scene.NOMINAL_PLACES_M)
    for seed in range(0, 864, 9):
        drawn = motions.draw(seed)
        assert np.abs(drawn.places_m - nominal).max() <= motions.PLACE_JITTER_M
        assert motions.TRAVEL_M[0] <= drawn.travel_m <= motions.TRAVEL_M[1]
        assert (np.diff(drawn.clock) > 0).all() and drawn.clock[0] == 0 and drawn.clock[-1] == 99

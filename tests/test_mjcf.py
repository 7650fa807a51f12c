"""The scene for MuJoCo: frames, sizes, masses, limits and friction are those of our own robot."""

import xml.etree.ElementTree as xml
from functools import cache
from math import cos, sin

import numpy as np
import pytest

from ptae_lite.robot import arm, mjcf, scene
from ptae_lite.robot.scene import Scene
from ptae_lite.robot.urdf import nico_urdf


@cache
def model():
    return xml.fromstring(mjcf.nico_mjcf())


def numbers(text):
    return [float(part) for part in text.split()]


def geoms():
    return {one.get("name"): one for one in model().iter("geom")}


def turned(euler):
    """Rotation about the fixed axes x, y, z, as `eulerseq="XYZ"` says."""
    x, y, z = ([[1, 0, 0], [0, cos(a), -sin(a)], [0, sin(a), cos(a)]] for a in euler)
    about_y, about_z = np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]]  # x to y, x to z
    return about_z.T @ z @ about_z @ (about_y.T @ y @ about_y) @ np.array(x)


def frames(joints_rad):
    """World transforms of the links by the file alone."""
    found, parent, at = {}, np.eye(4), model().find("worldbody")
    angles = dict(zip(arm.JOINT_NAMES, joints_rad, strict=True))
    assert model().find("compiler").attrib.items() >= {"angle": "radian", "eulerseq": "XYZ"}.items()
    while (at := at.find("body")) is not None:
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = turned(numbers(at.get("euler"))), numbers(at.get("pos"))
        if (joint := at.find("joint")) is not None:
            angle = angles[joint.get("name")]
            own[:3, :3] = own[:3, :3] @ arm.rotation(numbers(joint.get("axis")), [angle])[0]
        parent = parent @ own
        found[at.get("name")] = parent
    return found


def test_links_are_where_our_forward_kinematics_puts_them():
    rng = np.random.default_rng(0)
    for joints_rad in rng.uniform(arm.LOWER_RAD, arm.UPPER_RAD, (5, 5)):
        own = arm.link_transforms(joints_rad[None])
        found = frames(joints_rad)
        assert set(found) == set(own) - {"torso", "head"}
        for name, made in found.items():
            np.testing.assert_allclose(made, own[name][0], atol=1e-9)


def test_joints_come_in_our_order_with_our_limits_and_motors():
    joints = list(model().iter("joint"))
    assert [one.get("name") for one in joints] == list(arm.JOINT_NAMES)
    ranges = np.array([numbers(one.get("range")) for one in joints])
    np.testing.assert_allclose(ranges, np.stack([arm.LOWER_RAD, arm.UPPER_RAD], axis=1))
    motors = list(model().iter("motor"))
    assert [one.get("joint") for one in motors] == list(arm.JOINT_NAMES)
    most = scene.MOTOR_FORCE_N_M
    assert all(numbers(one.get("forcerange")) == [-most, most] for one in motors)


def test_links_are_as_heavy_as_in_the_urdf():
    urdf = {
        one.get("name"): one.find("inertial") for one in xml.fromstring(nico_urdf()).iter("link")
    }
    chain = [body for body in model().iter("body") if body.get("name") not in ("left", "right")]
    assert len(chain) == 6
    for body in chain:
        own, theirs = body.find("inertial"), urdf[body.get("name")]
        assert float(own.get("mass")) == float(theirs.find("mass").get("value"))
        about = [float(theirs.find("inertia").get(axis)) for axis in ("ixx", "iyy", "izz")]
        assert numbers(own.get("diaginertia")) == about
        assert all(geom.get("mass") == "0" for geom in body.findall("geom"))


def sizes(geom):
    """The edges of a box, radius and length of a cylinder, the radius of a sphere."""
    doubled = {"box": [2, 2, 2], "cylinder": [1, 2], "sphere": [1]}[geom.get("type")]
    return np.array(numbers(geom.get("size"))) * doubled


def test_solid_shapes_and_only_they_are_there():
    solid = [shape for shape in (*scene.TABLE_SHAPES, *arm.SHAPES) if shape.solid]
    found = [one for name, one in geoms().items() if name not in ("left", "right")]
    parents = {child: body.get("name") for body in model().iter("body") for child in body}
    assert len(found) == len(solid)
    for geom, shape in zip(found, solid, strict=True):
        assert parents.get(geom, "world") == shape.link and geom.get("type") == shape.kind
        np.testing.assert_allclose(sizes(geom), shape.size)
        np.testing.assert_allclose(numbers(geom.get("pos")), shape.xyz)
        np.testing.assert_allclose(numbers(geom.get("euler")), shape.rpy)


def test_cubes_are_free_and_of_our_size_and_mass():
    for side in ("left", "right"):
        (body,) = (one for one in model().iter("body") if one.get("name") == side)
        assert body.find("freejoint") is not None
        geom = body.find("geom")
        np.testing.assert_allclose(sizes(geom), [scene.CUBE_EDGE_M] * 3)
        assert float(geom.get("mass")) == scene.CUBE_MASS_KG


def test_each_pair_that_can_touch_has_the_product_of_its_frictions():
    def friction(name):
        if name in ("left", "right"):
            return scene.CUBE_FRICTION
        return scene.TABLE_FRICTION if name.startswith("table") else scene.HAND_FRICTION

    pairs = {(one.get("geom1"), one.get("geom2")): one for one in model().iter("pair")}
    cubes, arms = ("left", "right"), [n for n in geoms() if n not in ("table 0", "left", "right")]
    wanted = {frozenset(p) for p in (("left", "right"), *(("table 0", c) for c in cubes))}
    wanted |= {frozenset((a, b)) for a in arms for b in (*cubes, "table 0")}
    assert {frozenset(pair) for pair in pairs} == wanted
    for (a, b), one in pairs.items():
        assert numbers(one.get("friction"))[:2] == pytest.approx([friction(a) * friction(b)] * 2)
        pushes = {a, b} & set(cubes) and {a, b} & set(arms)
        assert float(one.get("margin", 0)) == (mjcf.MARGIN_M if pushes else 0)
    assert all((g.get("contype"), g.get("conaffinity")) == ("0", "0") for g in geoms().values())


def test_time_and_gravity_are_those_of_the_recording():
    option = model().find("option")
    assert float(option.get("timestep")) * scene.SUBSTEPS * scene.FRAMES_PER_S == pytest.approx(1)
    assert tuple(numbers(option.get("gravity"))) == scene.GRAVITY_M_S2


def test_the_margin_is_that_of_the_simulator(simulator):
    with Scene(("red", "blue")) as world:
        links = range(simulator.getNumJoints(world._nico, **world._at))
        margins = [simulator.getDynamicsInfo(world._nico, i, **world._at)[11] for i in links]
    assert max(margins) == pytest.approx(mjcf.MARGIN_M)

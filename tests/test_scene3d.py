"""The recorded 3-D scene: what the page holds is what was given, and nothing leaves it."""

import base64
import json
import re
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest

from ptae_lite.display import scene3d
from ptae_lite.errors import PTAEError
from ptae_lite.robot import arm

FRAMES = 100
ONE_PIXEL_PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg=="
)


def sequence():
    """An arm that sweeps, a left cube that slides and turns, a right cube that stays."""
    swept = np.linspace(0, 1, FRAMES)
    joints_rad = np.array([-0.3, 0.5, 1.6, 1.2, 0.3]) + 0.4 * swept[:, None]
    cubes = np.zeros((FRAMES, 2, 7))
    cubes[:, 0, :3] = [0.40, 0.17, 0.585]
    cubes[:, 1, :3] = [0.40, 0.03, 0.585]
    cubes[:, 0, 0] += 0.07 * swept
    cubes[:, 0, 5], cubes[:, 0, 6] = np.sin(swept / 4), np.cos(swept / 4)  # yaw 0 to 0.5 rad
    cubes[:, 1, 6] = 1
    return joints_rad, cubes


def make(**changes):
    joints_rad, cubes = sequence()
    given = {"joints_rad": joints_rad, "cubes": cubes, "colours": ("red", "blue")} | changes
    return scene3d.arm_scene(**given)


def unpacked(page, part):
    text = re.search(rf'<script type="text/plain" id="{part}">(.*?)</script>', page).group(1)
    return zlib.decompress(base64.b64decode(text))


def poses_in(page):
    """The (T, M, 4, 4) poses and the M paths, read back from a page as its script reads them."""
    scene = json.loads(unpacked(page, "scene"))
    stored = np.frombuffer(unpacked(page, "poses"), "<f4")
    stored = stored.reshape(scene["last"] + 1, len(scene["moving"]), 4, 4)
    return stored.swapaxes(-1, -2), scene["moving"]


def placed(page):
    """Transforms set once: path to 4 x 4."""
    commands = json.loads(unpacked(page, "scene"))["commands"]
    return {
        command["path"]: np.array(command["matrix"]).reshape(4, 4).T
        for command in commands
        if command["type"] == "set_transform"
    }


def test_two_builds_are_the_same_bytes():
    assert make().html() == make().html()


def test_building_takes_less_than_a_second():
    start_s = time.perf_counter()
    make().html()
    assert time.perf_counter() - start_s < 1


@pytest.mark.parametrize("frame", [0, FRAMES // 2, FRAMES - 1])
def test_the_arm_is_where_forward_kinematics_puts_it(frame):
    joints_rad, _ = sequence()
    poses, moving = poses_in(make().html())
    for link, expected in arm.link_transforms(joints_rad).items():
        if link in ("torso", "head"):
            continue
        stored = poses[frame, moving.index(f"/scene/robot/{link}")]
        np.testing.assert_allclose(stored, expected[frame], atol=1e-4)  # 0.1 mm


@pytest.mark.parametrize("frame", [0, FRAMES // 2, FRAMES - 1])
def test_the_pushed_cube_is_where_it_was_recorded(frame):
    _, cubes = sequence()
    poses, moving = poses_in(make().html())
    stored = poses[frame, moving.index("/scene/cubes/left")]
    np.testing.assert_allclose(stored[:3, 3], cubes[frame, 0, :3], atol=1e-4)
    yaw_rad = np.arctan2(stored[1, 0], stored[0, 0])
    assert yaw_rad == pytest.approx(
        2 * np.arctan2(cubes[frame, 0, 5], cubes[frame, 0, 6]), abs=1e-4
    )


def test_what_never_moves_is_placed_once():
    page = make().html()
    _, moving = poses_in(page)
    assert not {"/scene/robot/torso", "/scene/robot/head", "/scene/cubes/right"} & set(moving)
    np.testing.assert_allclose(placed(page)["/scene/robot/head"], arm.head_transform(), atol=1e-4)
    np.testing.assert_allclose(placed(page)["/scene/cubes/right"][:3, 3], [0.40, 0.03, 0.585])


def test_a_cylinder_lies_along_the_z_axis_of_its_shape():
    tilted = arm.Shape("world", "cylinder", (0.02, 0.1), (0.1, 0.2, 0.3), rpy=(0.3, 0.2, 0.1))
    still = {"world": np.eye(4)[None]}
    page = scene3d.record({"rods": ([tilted], still)}, frames_per_s=25, title="a rod").html()
    pose = placed(page)["/scene/rods/world/0"]
    x, y, z = (
        arm.rotation(axis, [angle])[0] for axis, angle in zip(np.eye(3), tilted.rpy, strict=True)
    )
    np.testing.assert_allclose(pose[:3, 1], (z @ y @ x)[:, 2], atol=1e-5)  # three.js: along y
    np.testing.assert_allclose(pose[:3, 3], tilted.xyz)


def test_shapes_that_only_touch_are_not_drawn():
    commands = make().commands
    hand = [c for c in commands if c["type"] == "set_object" and "/robot/hand/" in c["path"]]
    assert len(hand) == sum(shape.link == "hand" and shape.drawn for shape in arm.SHAPES)


def test_the_ghost_is_a_transparent_arm_of_its_own():
    joints_rad, _ = sequence()
    viewer = make(ghost_joints_rad=joints_rad[::-1])
    poses, moving = poses_in(viewer.html())
    expected = arm.link_transforms(joints_rad)["hand"][-1]
    np.testing.assert_allclose(poses[0, moving.index("/scene/ghost/hand")], expected, atol=1e-4)
    ghosts = [c for c in viewer.commands if c["type"] == "set_object" and "/ghost/" in c["path"]]
    assert ghosts and all(c["object"]["materials"][0]["transparent"] for c in ghosts)
    assert not any("torso" in c["path"] for c in ghosts)


def test_the_page_loads_nothing_and_is_small():
    page = make(ghost_joints_rad=sequence()[0]).html()
    assert "://" not in page
    assert not re.search(r"\b(src|href)\s*=", page)
    assert len(page) < 450_000
    assert b"Copyright (c) 2018 Robin Deits" in unpacked(page, "viewer")


def test_a_notebook_gets_an_iframe_that_can_be_found_and_a_picture(tmp_path):
    viewer = make(still_png=ONE_PIXEL_PNG, title='a "quoted" <title>')
    bundle = viewer._repr_mimebundle_()
    start = bundle["text/html"][:400]
    for part in (
        'data-ptae-embed="scene"',
        'sandbox="allow-scripts"',
        'loading="lazy"',
        "aria-label=",
    ):
        assert part in start
    assert "a &quot;quoted&quot; &lt;title&gt;" in start and "<title>" not in start
    assert base64.b64decode(bundle["image/png"]) == ONE_PIXEL_PNG
    assert "100 frames" in bundle["text/plain"]
    assert "image/png" not in make()._repr_mimebundle_()
    assert viewer.save(tmp_path / "scene.html").read_text(encoding="utf-8") == viewer.html()


BAD = {
    "four joints": ({"joints_rad": np.zeros((FRAMES, 4))}, "joints_rad has shape"),
    "no frames": ({"joints_rad": np.zeros((0, 5))}, "joints_rad has shape"),
    "a gap": ({"joints_rad": np.full((FRAMES, 5), np.nan)}, "not numbers"),
    "too few cubes": ({"cubes": np.zeros((FRAMES, 1, 7))}, "100 x 2 x 7"),
    "other length": ({"cubes": np.zeros((FRAMES - 1, 2, 7))}, "100 x 2 x 7"),
    "no rotation": ({"cubes": np.zeros((FRAMES, 2, 7))}, "quaternion"),
    "ghost too short": ({"ghost_joints_rad": np.zeros((3, 5))}, "ghost_joints_rad has shape"),
    "unknown colour": ({"colours": ("red", "pink")}, "violet"),
    "one colour": ({"colours": ("red",)}, "two of"),
    "no speed": ({"frames_per_s": 0}, "positive"),
    "not a picture": ({"still_png": b"GIF89a"}, "not a PNG"),
}


@pytest.mark.parametrize(("changes", "message"), BAD.values(), ids=BAD)
def test_what_does_not_fit_is_refused(unchecked, changes, message):
    with pytest.raises(PTAEError, match=message):
        make(**changes)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (arm.Shape("world", "cone", (0.1, 0.1)), "no shape 'cone'"),
        (arm.Shape("world", "box", (0.1, 0.1)), "no shape 'box'"),
        (arm.Shape("world", "sphere", (-0.1,)), "no shape 'sphere'"),
        (arm.Shape("tail", "sphere", (0.1,)), "fixed to 'tail'"),
    ],
)
def test_a_shape_that_cannot_be_drawn_is_refused(shape, message):
    with pytest.raises(PTAEError, match=message):
        scene3d.record({"odd": ([shape], {"world": np.eye(4)[None]})}, frames_per_s=25, title="odd")


def test_links_of_different_lengths_are_refused():
    ball = arm.Shape("world", "sphere", (0.1,))
    groups = {str(n): ([ball], {"world": np.tile(np.eye(4), (n, 1, 1))}) for n in (2, 3)}
    with pytest.raises(PTAEError, match=r"\[2, 3\] frames"):
        scene3d.record(groups, frames_per_s=25, title="odd")


def test_no_simulator_and_no_server_is_started():
    code = (
        "import sys, threading, numpy as np; from ptae_lite.display import scene3d;"
        "cubes = np.tile([0, 0, 0, 0, 0, 0, 1.0], (2, 2, 1));"
        "scene3d.arm_scene(np.zeros((2, 5)), cubes, ('red', 'blue')).html();"
        "assert 'pybullet' not in sys.modules; assert threading.active_count() == 1"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)

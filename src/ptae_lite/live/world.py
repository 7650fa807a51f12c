"""What a page needs to act: MuJoCo, the scene with its constants, and a template of the 3-D view.

All of it comes from `robot` and from the views of the book; no number is written a second time.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ptae_lite.data.samples import Samples
from ptae_lite.language import SIDES
from ptae_lite.live import camera, packing, scene, scripts
from ptae_lite.robot.inverse import home_rad
from ptae_lite.robot.scene import NOMINAL_PLACES_M
from ptae_lite.widgets import episodes, scene3d, viewer

ENGINE = "@mujoco/mujoco"
PLAYER = f'<script src="@BASE@../{Path(viewer.SHARED_SCRIPT).name}"></script>'
LOOK = ("red", "blue")  # colours in the template; a page puts others in their place


def engine(folder) -> dict:
    """Write MuJoCo's module and its WebAssembly, packed."""
    source = scripts.folder() / ENGINE
    parts = {"wasm": "mujoco.wasm", "module": "mujoco.js"}
    return packing.write(
        folder, "mujoco", {part: (source / name).read_bytes() for part, name in parts.items()}
    )


def constants() -> dict:
    """All that a page's scripts know of the robot, its scene, its camera and its verdicts."""
    return scene.constants() | {
        "camera": camera.constants(),
        "view": view(),
        "texts": episodes.TEXTS | {"way": episodes.WAY},
    }


def stage(folder, samples: Samples) -> dict:
    """Write the constants, and where the cubes of all samples stand at first."""
    first = samples.cubes[:, 0].reshape(-1, 2, 7).astype("<f4")
    of = zip(samples.pattern.tolist(), samples.variation.tolist(), strict=True)
    about = constants() | {"recorded": [list(one) for one in of]}
    return packing.write(folder, "scene", {"cubes": first.tobytes()}, about)


def view() -> dict:
    """The page of a 3-D scene without its movement, and what a script puts into it."""
    joints_rad = np.stack([home_rad(), home_rad() + 0.1])
    cubes = np.zeros((2, 2, 7))
    cubes[:, :, :2] = NOMINAL_PLACES_M
    cubes[:, :, 6] = 1
    cubes[1, :, 2] += 0.1  # all that can move has to move once
    made = scene3d.arm_scene(joints_rad, cubes, LOOK, still_png=b"\x89PNG")
    return {
        "page": viewer.template("", PLAYER),
        "scene": made.described(),
        "cubes": {side: f"/scene/cubes/{side}" for side in SIDES},
    }

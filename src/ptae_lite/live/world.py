"""What a page needs to act: MuJoCo, the scene with its constants, and a template of the 3-D view.

All of it comes from `robot` and from the views of the book; no number is written a second time.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ptae_lite.data.samples import Samples
from ptae_lite.errors import ArtefactError
from ptae_lite.language import SIDES
from ptae_lite.live import camera, packing, scene, scripts
from ptae_lite.robot.inverse import home_rad
from ptae_lite.robot.scene import NOMINAL_PLACES_M
from ptae_lite.widgets import episodes, scene3d, viewer

ENGINE = "@mujoco/mujoco"
PLAYER = f'<script src="@BASE@../{Path(viewer.SHARED_SCRIPT).name}"></script>'
LOOK = ("red", "blue")  # colours in the template; a page puts others in their place


# MuJoCo's bindings write the text of a function for each function of theirs, which a careful server
# forbids (no 'unsafe-eval'). This one does the same without a text.
WRITTEN = "      var invokerFn = new Function(...args, invokerFnBody)(...closureArgs);\n"
UNWRITTEN = """      var invokerFn = function (...given) {
        checkArgCount(given.length, minArgs, expectedArgCount, humanName, throwBindingError);
        var destructors = needsDestructorStack ? [] : null;
        var wired = isClassMethodFunc ? [argTypes[1].toWireType(destructors, this)] : [];
        argTypes.slice(2).forEach((type, i) => wired.push(type.toWireType(destructors, given[i])));
        var rv = cppInvokerFunc(cppTargetFunc, ...wired);
        if (needsDestructorStack) runDestructors(destructors);
        else argTypes.slice(isClassMethodFunc ? 1 : 2).forEach((type, i) => {
          if (type.destructorFunction !== null) type.destructorFunction(wired[i]);
        });
        if (returns) return argTypes[0].fromWireType(rv);
      };
"""


def module() -> str:
    """MuJoCo's module, changed so that it makes no code from text.

    Raises:
        ArtefactError: this version of the package is written in another way.
    """
    text = (scripts.folder() / ENGINE / "mujoco.js").read_text("utf-8")
    if text.count(WRITTEN) != 1:
        raise ArtefactError(
            f"{ENGINE} {scripts.version_of(ENGINE)} makes functions in another way than 3.14.0; "
            "look at craftInvokerFunction in its mujoco.js, and change live/world.py"
        )
    return text.replace(WRITTEN, UNWRITTEN)


def engine(folder) -> dict:
    """Write MuJoCo's module and its WebAssembly, packed."""
    wasm = (scripts.folder() / ENGINE / "mujoco.wasm").read_bytes()
    return packing.write(folder, "mujoco", {"wasm": wasm, "module": module().encode()})


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

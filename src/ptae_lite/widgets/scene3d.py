"""The robot in 3-D: a meshcat scene, recorded without meshcat's server.

meshcat normally sends its commands to a web server of its own. That server listens on all network
interfaces without a password, and a static page cannot use it. Here the commands are kept, and
`Viewer` writes them into a page. The mouse turns the scene; after a click the wheel zooms.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi

import numpy as np
from jaxtyping import Float, UInt8

from ptae_lite.data import frames
from ptae_lite.data.samples import Samples
from ptae_lite.errors import PTAEError
from ptae_lite.language import SIDES, pattern, sentence
from ptae_lite.plots import simulation as simulation_plots
from ptae_lite.plots import style
from ptae_lite.robot.arm import SHAPES, Shape, fingertip, link_transforms
from ptae_lite.robot.scene import COLOUR_RGBA, CUBE_EDGE_M, FRAMES_PER_S, TABLE_SHAPES
from ptae_lite.widgets.viewer import Viewer

with warnings.catch_warnings():
    # meshcat imports its server, which we do not use, and which warns of an outdated name
    warnings.simplefilter("ignore", DeprecationWarning)
    from meshcat import geometry
    from meshcat import transformations as tf
    from meshcat.visualizer import Visualizer

GHOST_RGBA = (0.95, 0.55, 0.10, 0.45)
LOOK_AT_M = (0.26, 0.05, 0.66)
CAMERA_M = (1.15, 0.85, 1.20)  # in front of the robot, to its left, above the table
FIELD_OF_VIEW_DEG = 38
SIZES = {"box": 3, "cylinder": 2, "sphere": 1}  # how many numbers each kind of shape has

# A group of a scene: its shapes, and a (T, 4, 4) array of poses for each link they are fixed to.
Group = tuple[Sequence[Shape], Mapping[str, np.ndarray]]


def sample_scene(
    samples: Samples,
    index: int,
    *,
    ghost_joints_rad: Float[np.ndarray, "T 5"] | None = None,
    ghost_name: str = "made by the model",
    eye: bool = False,
    autoplay: bool = False,
) -> Viewer:
    """One recorded sample: its arm and its cubes, and a faint second arm if asked for.

    Args:
        ghost_joints_rad: joints of the second arm. They may be longer than the clip. A model's
            answer starts at the second frame, so put the sample's first pose before it.
        ghost_name: what the caption calls the second arm.
        eye: also show what the camera saw, for samples with a stored video
            (`frames.video_patterns`).
        autoplay: play again and again until it is stopped.

    Raises:
        PTAEError: the sample's video is not stored, or arrays do not fit together.
    """
    key = (int(samples.pattern[index]), int(samples.variation[index]))
    shown, count = pattern(key[0]), int(samples.frames[index])
    seen = None
    if eye:
        stored = [t for *sample, t in frames.stored_keys() if tuple(sample) == key]
        if len(stored) < 3:
            raise PTAEError(
                f"sample {index} has no stored video; of these patterns the first variation has: "
                f"{', '.join(map(str, frames.video_patterns()))}"
            )
        seen = {t: frames.frame(*key, t) for t in stored}
    return arm_scene(
        samples.joints[index, :count],
        samples.cubes[index, :count],
        (shown.left, shown.right),
        ghost_joints_rad=None if ghost_joints_rad is None else ghost_joints_rad[:count],
        ghost_name=ghost_name,
        eye=seen,
        autoplay=autoplay,
        title=f"NICO's left arm in 3-D: {sentence(shown.meaning)}, the {shown.side} cube",
    )


def arm_scene(
    joints_rad: Float[np.ndarray, "T 5"],
    cubes: Float[np.ndarray, "T 2 7"],
    colours: tuple[str, str],
    *,
    frames_per_s: float = FRAMES_PER_S,
    ghost_joints_rad: Float[np.ndarray, "T 5"] | None = None,
    ghost_name: str = "a second motion",
    eye: Mapping[int, UInt8[np.ndarray, "H W 3"]] | None = None,
    still_png: bytes | None = None,
    autoplay: bool = False,
    title: str = "NICO's left arm and two cubes",
) -> Viewer:
    """The arm and the cubes over a sequence, and a transparent second arm if asked for.

    Args:
        cubes: the left and the right cube: position in metres, quaternion x y z w.
        colours: of the left and the right cube.
        ghost_joints_rad: joints of the second arm, drawn in orange.
        ghost_name: what the caption calls the second arm.
        eye: camera's pictures; each is shown from its frame on.
        still_png: the still picture; None for a drawing of the middle frame.
        autoplay: play again and again until it is stopped.

    Raises:
        PTAEError: arrays do not fit together.
    """
    joints_rad = _checked("joints_rad", joints_rad, (None, 5))
    arm, count = link_transforms(joints_rad), len(joints_rad)
    cubes = _checked("cubes", cubes, (count, 2, 7))
    drawn = [shape for shape in SHAPES if shape.drawn]
    groups: dict[str, Group] = {
        "table": (TABLE_SHAPES, {"world": np.tile(np.eye(4), (count, 1, 1))}),
        "robot": (drawn, arm),
        "cubes": (_cube_shapes(colours), _cube_transforms(cubes)),
    }
    caption = f"Left cube, as the robot sees it: {colours[0]}. Right cube: {colours[1]}."
    if ghost_joints_rad is not None:
        ghost = link_transforms(_checked("ghost_joints_rad", ghost_joints_rad, (count, 5)))
        fixed = ("torso", "head")
        shapes = [replace(shape, rgba=GHOST_RGBA) for shape in drawn if shape.link not in fixed]
        groups["ghost"] = (shapes, ghost)
        caption += f" Faint orange arm: {ghost_name}."
    if still_png is None:
        middle = count // 2
        drawing = simulation_plots.arm_drawing(
            joints_rad[middle], cubes[middle], colours, path_m=fingertip(joints_rad)
        )
        still_png = style.png(drawing)
    made = record(groups, frames_per_s=frames_per_s, title=title, still_png=still_png)
    return replace(made, caption=caption, eye=eye, autoplay=autoplay)


def record(
    groups: Mapping[str, Group],
    *,
    frames_per_s: float,
    title: str,
    still_png: bytes | None = None,
) -> Viewer:
    """Record shapes on moving links. A link that never moves is placed once.

    Args:
        groups: name to shapes, and to the poses (T, 4, 4) of each link.

    Raises:
        PTAEError: a shape is on an unknown link, the links differ in frames, or a value is wrong.
    """
    if not frames_per_s > 0:
        raise PTAEError(f"frames_per_s is {frames_per_s}; it must be positive")
    if still_png is not None and not still_png.startswith(b"\x89PNG"):
        raise PTAEError("still_png is not a PNG picture; give the bytes of a .png file")
    window = _Recorder()
    scene = Visualizer(window=window)
    _set_stage(scene)
    moving: dict[str, np.ndarray] = {}
    for group, (shapes, transforms) in groups.items():
        for i, shape in enumerate(shapes):
            if shape.link not in transforms:
                raise PTAEError(
                    f"a {shape.kind} of {group!r} is fixed to {shape.link!r}, which has no "
                    f"transform; the links are {', '.join(transforms)}"
                )
            # a hundredth of a millimetre; rounding drops the last bits, which differ
            # between processors and do not compress. Adding 0 turns -0 into 0.
            poses = np.round(transforms[shape.link], 5) + 0.0
            path = f"/scene/{group}/{shape.link}"
            node = scene[path]
            node.set_transform(poses[0])
            node[str(i)].set_object(_mesh(shape, f"{path}/{i}"))
            node[str(i)].set_transform(_pose_in_link(shape))
            if np.ptp(poses, axis=0).any():
                moving[path] = poses
    counts = {len(poses) for _, transforms in groups.values() for poses in transforms.values()}
    if len(counts) != 1:
        raise PTAEError(f"the links have {sorted(counts)} frames; they must all have as many")
    stacked = np.stack(list(moving.values()), axis=1) if moving else np.zeros((*counts, 0, 4, 4))
    return Viewer(
        window.commands, tuple(moving), stacked, frames_per_s, LOOK_AT_M, title,
        still_png=still_png,
    )  # fmt: skip


class _Recorder:
    """Takes the place of meshcat's window: it keeps the commands instead of sending them."""

    def __init__(self) -> None:
        self.commands: list[dict] = []

    def send(self, command) -> None:
        """Keep a command."""
        self.commands.append(command.lower())


def _set_stage(scene: Visualizer) -> None:
    """The camera; meshcat's own lights stay as they are."""
    for name in ("/Grid", "/Axes"):
        scene[name].set_property("visible", False)
    x, y, z = CAMERA_M
    camera = scene["/Cameras/default/rotated/<object>"]
    camera.set_property("position", (x, z, -y))  # three.js has y upwards
    camera.set_property("fov", FIELD_OF_VIEW_DEG)


def _mesh(shape: Shape, name: str) -> geometry.Mesh:
    if SIZES.get(shape.kind) != len(shape.size) or min(shape.size) <= 0:
        raise PTAEError(
            f"no shape {shape.kind!r} of size {shape.size}; there are boxes (x, y, z), "
            "cylinders (radius, length) and spheres (radius,), in metres"
        )
    if shape.kind == "box":
        form = geometry.Box(shape.size)
    elif shape.kind == "cylinder":
        form = geometry.Cylinder(height=shape.size[1], radius=shape.size[0])
    else:
        form = geometry.Sphere(shape.size[0])
    red, green, blue = (round(255 * part) for part in shape.rgba[:3])
    paint = geometry.MeshPhongMaterial(color=red << 16 | green << 8 | blue, opacity=shape.rgba[3])
    mesh = geometry.Mesh(form, paint)
    # meshcat's own names contain the time and the machine's address, and compress badly
    for part in (form, paint, mesh):
        part.uuid = f"{name}/{type(part).__name__}"
    return mesh


def _pose_in_link(shape: Shape) -> Float[np.ndarray, "4 4"]:
    pose = tf.translation_matrix(shape.xyz) @ tf.euler_matrix(*shape.rpy)
    if shape.kind == "cylinder":  # three.js cylinders lie along y
        pose = pose @ tf.rotation_matrix(pi / 2, (1, 0, 0))
    return np.round(pose, 6) + 0.0


def _cube_shapes(colours: tuple[str, str]) -> list[Shape]:
    if len(colours) != 2 or not set(colours) <= set(COLOUR_RGBA):
        raise PTAEError(f"colours are two of {', '.join(COLOUR_RGBA)} (left, right), not {colours}")
    edges = (CUBE_EDGE_M,) * 3
    return [
        Shape(side, "box", edges, rgba=tuple(COLOUR_RGBA[colour]))
        for side, colour in zip(SIDES, colours, strict=True)
    ]


def _cube_transforms(cubes: Float[np.ndarray, "T 2 7"]) -> dict[str, np.ndarray]:
    if np.abs(np.linalg.norm(cubes[..., 3:], axis=-1) - 1).max() > 1e-3:
        raise PTAEError(
            "a cube's quaternion is not of length 1; the order is x, y, z, qx, qy, qz, qw"
        )
    return {
        side: np.stack([
            tf.translation_matrix(pose[:3]) @ tf.quaternion_matrix(pose[[6, 3, 4, 5]])
            for pose in cubes[:, i]
        ])
        for i, side in enumerate(SIDES)
    }  # fmt: skip


def _checked(name: str, array, shape: tuple[int | None, ...]) -> np.ndarray:
    """The array as floats, if it has this shape (None: any length from 1) and no gaps."""
    array = np.asarray(array, dtype=float)
    fits = array.ndim == len(shape) and all(
        have == want or (want is None and have)
        for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = " x ".join("frames" if size is None else str(size) for size in shape)
        raise PTAEError(f"{name} has shape {array.shape}; it must be {wanted}")
    if not np.isfinite(array).all():
        raise PTAEError(f"{name} has values that are not numbers")
    return array

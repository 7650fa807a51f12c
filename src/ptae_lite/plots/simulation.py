"""Figures of the simulation: rows of camera images, the arm, and the motion of joints and cubes.

Each function returns a closed matplotlib figure. A notebook shows it once, if it is the last line
of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from math import pi

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ptae_lite.errors import PTAEError
from ptae_lite.plots import style
from ptae_lite.robot import arm
from ptae_lite.robot.scene import COLOUR_RGBA, CUBE_EDGE_M, FRAMES_PER_S, TABLE_SHAPES

GAP_PX, GROUP_GAP_PX = 5, 20  # white between images, and between groups of them
LINE_IN = 0.2  # of a label above a row
VIEW = {"elev": 26, "azim": 42}  # from in front of the robot, to its left, above the table
LIGHT = (0.36, 0.48, 0.80)


def grid(
    rows: Mapping[str, Sequence[np.ndarray]],
    headings: Sequence[str] | None = None,
    groups: Sequence[int] | None = None,
) -> Figure:
    """Rows of images (H x W x 3 bytes, all of one size), with a label above each row.

    Args:
        headings: over the columns, or over the groups.
        groups: how many columns belong together.

    Raises:
        PTAEError: the rows have different lengths.
    """
    columns, (height, width, _) = next((len(row), np.shape(row[0])) for row in rows.values())
    edges = np.cumsum([0, *(groups or [1] * columns)])
    if {len(row) for row in rows.values()} != {edges[-1]}:
        raise PTAEError(f"each row of this grid must have {edges[-1]} images")
    gaps = np.full(columns, GAP_PX)
    gaps[edges[1:] - 1] = GROUP_GAP_PX if groups else GAP_PX
    left = np.cumsum([0, *(width + gaps)])
    wide = left[-2] + width
    line = round(LINE_IN * wide / style.WIDTH) if any(rows) else 0  # for the label, in pixels
    top = np.arange(len(rows)) * (height + GAP_PX + line)
    # With a channel that says it is opaque; else matplotlib adds one, in doubles (30 MB for 28).
    sheet = np.full((top[-1] + height, wide, 4), 255, np.uint8)
    for (r, row), c in product(enumerate(rows.values()), range(columns)):
        sheet[top[r] : top[r] + height, left[c] : left[c] + width, :3] = row[c]
    above = LINE_IN * (bool(line) + bool(headings))
    height_in = style.WIDTH * sheet.shape[0] / wide + above
    figure, axes = plt.subplots(figsize=(style.WIDTH, height_in))
    axes.imshow(sheet)
    for name, y in zip(rows, top, strict=True):
        axes.text(0, y - GAP_PX / 2, name, va="bottom")
    middles = (left[edges[:-1]] + left[edges[1:] - 1] + width) / 2
    axes.set_xticks(middles if headings else [], headings or [])
    axes.tick_params(length=0, labeltop=True, labelbottom=False, pad=2 + 72 * LINE_IN * bool(line))
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    axes.grid(False)
    return style.closed(figure)


def arm_drawing(
    joints_rad: Float[np.ndarray, " 5"],
    cubes: Float[np.ndarray, "2 7"],
    colours: tuple[str, str],
    *,
    path_m: Float[np.ndarray, "T 3"] | None = None,
    sticks_rad: Sequence[Float[np.ndarray, " 5"]] = (),
) -> Figure:
    """The robot and the cubes at one instant.

    Args:
        cubes: poses of the left and the right cube: position in metres, quaternion x y z w.
        path_m: a path of the fingertips to draw.
        sticks_rad: further poses, drawn as lines.
    """
    links = {name: pose[0] for name, pose in arm.link_transforms(joints_rad[None]).items()}
    links |= {"world": np.eye(4), "a": np.eye(4), "b": np.eye(4)}
    shapes = [shape for shape in arm.SHAPES if shape.drawn]
    body = [shape for shape in shapes if shape.link in ("torso", "head")]
    front = [shape for shape in shapes if shape not in body]
    for name, colour, pose in zip("ab", colours, cubes, strict=True):
        front.append(arm.Shape(name, "box", (CUBE_EDGE_M,) * 3, rgba=COLOUR_RGBA[colour]))
        links[name][:3, 3] = pose[:3]  # the cubes lie flat: they are only turned about z
        links[name][:3, :3] = arm.rotation((0, 0, 1), [2 * np.arctan2(pose[5], pose[6])])[0]
    figure = plt.figure(figsize=(style.WIDTH, 4.0), layout="none")
    axes = figure.add_axes((0, 0, 1, 1), projection="3d", computed_zorder=False)
    for layer, some in enumerate((body, TABLE_SHAPES, front)):
        faces, paint = zip(*(face for shape in some for face in _lit(shape, links)), strict=True)
        axes.add_collection3d(
            Poly3DCollection(faces, facecolors=paint, edgecolors=paint, lw=0.3, zorder=layer)
        )
    if path_m is not None:
        axes.plot(*np.transpose(path_m), color=style.BLUE, lw=1.5, zorder=4)
    for pose in sticks_rad:
        chain = list(arm.link_transforms(pose[None]).values())[2:]  # without torso and head
        points = [*(link[0, :3, 3] for link in chain), arm.fingertip(pose[None])[0]]
        axes.plot(*np.transpose(points), "o-", ms=3, lw=2, zorder=5)
    axes.set(xlim=(-0.05, 0.60), ylim=(-0.25, 0.40), zlim=(0.47, 0.98))
    axes.set_box_aspect((0.65, 0.65, 0.51), zoom=1.45)
    axes.view_init(**VIEW)
    axes.set_axis_off()
    return style.closed(figure)


def _lit(shape: arm.Shape, links):
    """The faces of a shape in the world, as polygons with their colours."""
    turned = np.eye(3)
    for axis, angle in zip(np.eye(3), shape.rpy, strict=True):
        turned = arm.rotation(axis, [angle])[0] @ turned
    pose = links[shape.link]
    for face in _faces(shape):
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        normal *= np.sign(normal @ face.mean(0)) / max(np.linalg.norm(normal), 1e-12)
        light = 0.62 + 0.38 * (pose[:3, :3] @ turned @ normal) @ LIGHT
        corners = (face @ turned.T + shape.xyz) @ pose[:3, :3].T + pose[:3, 3]
        yield corners, np.clip(light * np.array(shape.rgba[:3]), 0, 1)


def _faces(shape: arm.Shape) -> list[np.ndarray]:
    """The surface of a shape: rings along z with faces between them, and two caps.

    All faces have four corners. matplotlib fills up unequal ones with memory that it never set.
    """
    turn, size = np.linspace(0, 2 * pi, 17), np.array(shape.size)
    ring = size[0] * np.stack([np.cos(turn), np.sin(turn)], 1)
    levels = [(1, -size[-1] / 2), (1, size[-1] / 2)]
    if shape.kind == "box":
        ring = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]) * size[:2] / 2
    elif shape.kind == "sphere":
        levels = [(np.sin(a), -size[0] * np.cos(a)) for a in np.linspace(0.05, pi - 0.05, 10)]
    rings = [np.c_[scale * ring, np.full(len(ring), z)] for scale, z in levels]
    sides = [
        np.stack([a[i], a[i + 1], b[i + 1], b[i]])
        for (a, b), i in product(pairwise(rings), range(len(ring) - 1))
    ]
    caps = [r[[0, i, i + 1, i + 2]] for r in (rings[0], rings[-1]) for i in range(1, len(r) - 3, 2)]
    return [*sides, *caps]


def lines(
    curves: Mapping[str, tuple], x_label: str, y_label: str, *, dots=None, colours=(), **axis
) -> Figure:
    """Named curves (x, y), and named points as `dots`. `axis` goes to matplotlib's `Axes.set`.

    Args:
        colours: of the curves, in their order, where they are not the usual ones.
    """
    names = [*curves, *(dots or {})]
    columns = 3 if max(map(len, names)) < 14 else 2
    size = (style.WIDTH, 2.6 + 0.17 * -(-len(names) // columns))
    figure, axes = plt.subplots(figsize=size)
    for i, (name, (x, y)) in enumerate(curves.items()):
        colour = colours[i] if colours else style.of_model(name)
        axes.plot(x, y, ("-", "--", "-.", ":")[i % 4], label=name, color=colour)
    for name, (x, y) in (dots or {}).items():
        axes.plot(x, y, "o", color="black", ms=4, label=name)
    axes.set(xlabel=x_label, ylabel=y_label, **axis)
    figure.legend(loc="outside lower center", ncols=columns)
    return style.closed(figure)


def audit(checks: Mapping[str, tuple[int, int, int]], names: tuple[str, str]) -> Figure:
    """Two data sets under some checks, each (passed by the first, passed by the second, of).

    A row for each check, from none to all; a square for the first set, a circle for the second.
    """
    figure, axes = plt.subplots(figsize=(style.WIDTH, 0.62 * len(checks) + 0.5))
    looks = (("s", style.RED), ("o", style.BLUE))
    for row, (check, (*passed, total)) in enumerate(checks.items()):
        axes.text(-0.12, row - 0.3, f"{check} (of {total})", va="center")
        axes.plot([0, 1], [row, row], color="#D0D0D0", lw=1.5, zorder=1)
        for count, name, (mark, colour) in zip(passed, names, looks, strict=True):
            axes.plot(count / total, row, mark, color=colour, ms=9, zorder=2,
                      label=None if row else name)  # fmt: skip
            axes.annotate(f"{count}", (count / total, row), (0, -7), textcoords="offset points",
                          ha="center", va="top", color=style.ink(colour))  # fmt: skip
    axes.set(xticks=[0, 1], xticklabels=["none", "all"], yticks=[], xlim=(-0.12, 1.12))
    axes.set_ylim(len(checks) - 0.5, -0.5)
    axes.grid(False)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    figure.legend(loc="outside lower center", ncols=2)
    return style.closed(figure)


def ranges(used: Mapping[str, tuple[float, float]], allowed: Sequence[tuple], unit: str) -> Figure:
    """The range of each joint that a data set uses, within the range that is allowed."""
    figure, axes = plt.subplots(figsize=(style.WIDTH, 2.2))
    for row, ((low, high), (least, most)) in enumerate(zip(used.values(), allowed, strict=True)):
        axes.barh(row, most - least, left=least, height=0.7, color="#DDDDDD")
        axes.barh(row, high - low, left=low, height=0.35, color=style.BLUE)
    axes.set_yticks(range(len(used)), list(used))
    axes.invert_yaxis()
    axes.set(xlabel=unit)
    return style.closed(figure)


def joints(groups: Mapping[str, Sequence[Float[np.ndarray, "T 5"]]]) -> Figure:
    """The five joints over time in degrees, a panel each. A group of clips has one colour."""
    figure, panels = joint_panels("seconds")
    for (j, axes), (g, (name, tracks)) in product(enumerate(panels), enumerate(groups.items())):
        for k, track in enumerate(tracks):
            seconds, degrees = np.arange(len(track)) / FRAMES_PER_S, np.degrees(track[:, j])
            axes.plot(seconds, degrees, f"C{3 * g}", lw=0.9, label=None if k else name)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return style.closed(figure)


def joint_panels(x_label: str) -> tuple[Figure, list[Axes]]:
    """An empty figure with a panel for each joint, in two columns. The sixth place is free."""
    figure, grid = plt.subplots(3, 2, figsize=(style.WIDTH, 4.6), sharex=True)
    panels = list(grid.flat[: len(arm.JOINTS)])
    for axes, name in zip(panels, arm.JOINT_NAMES, strict=True):
        axes.set_title(name)
    figure.supylabel("degrees", fontsize=9)
    for axes in panels[-2:]:  # nothing stands below them
        axes.set_xlabel(x_label)
        axes.tick_params(labelbottom=True)
    grid.flat[-1].remove()
    return figure, panels


def travel(rows: Mapping[str, Mapping[str, np.ndarray]]) -> Figure:
    """How far cubes moved, in mm: a row for each action, with a dot for each sample and cube."""
    figure, axes = plt.subplots(figsize=(style.WIDTH, 2.5))
    for i, cubes in enumerate(rows.values()):
        for c, (name, far) in enumerate(cubes.items()):
            height = i - 0.15 + 0.3 * c + np.linspace(-0.1, 0.1, len(far))
            axes.plot(far, height, ".", ms=2, color=f"C{6 * c}", label=None if i else name)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set(xlabel="cube travel in mm")
    figure.legend(loc="outside lower center", ncols=2, markerscale=4)
    return style.closed(figure)

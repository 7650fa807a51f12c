"""The figures of the first chapters: rows of camera images, the arm, joints and cubes in motion.

Each function takes arrays and returns a matplotlib figure, taken off pyplot's list, so that a
notebook shows it once: where it stands as a cell's last line.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from math import pi

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ptae_lite.display import style
from ptae_lite.errors import PTAEError
from ptae_lite.robot import arm
from ptae_lite.robot.scene import COLOUR_RGBA, CUBE_EDGE_M, TABLE_SHAPES

GAP_PX, GROUP_GAP_PX = 5, 20  # white between images, and between groups of them
VIEW = {"elev": 32, "azim": 38}  # from in front of the robot, to its left, above the table


def png(figure: Figure) -> bytes:
    """The figure as a PNG file, the same bytes each time."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110, metadata={"Software": None})
    return file.getvalue()


def _done(figure: Figure) -> Figure:
    plt.close(figure)
    return figure


def grid(
    rows: Mapping[str, Sequence[np.ndarray]],
    headings: Sequence[str] | None = None,
    groups: Sequence[int] | None = None,
    width_in: float = 7.0,
) -> Figure:
    """Rows of images (each H x W x 3, all alike), a label before each row.

    `headings` stand over the columns, or, where `groups` says how many columns belong together,
    one over each group. Raises `PTAEError` for rows of different lengths.
    """
    lengths = {len(row) for row in rows.values()}
    if len(lengths) != 1:
        raise PTAEError(f"the rows of a grid are equally long; these have {sorted(lengths)} images")
    columns = lengths.pop()
    groups = list(groups or [1] * columns)
    if sum(groups) != columns or len(headings or groups) != len(groups):
        raise PTAEError(f"{columns} columns do not fit groups {groups} with headings {headings}")
    height, width = np.shape(next(iter(rows.values()))[0])[:2]
    gap = np.full(columns, GAP_PX)
    if headings and len(groups) < columns:
        gap[np.cumsum(groups) - 1] = GROUP_GAP_PX
    left = np.concatenate([[0], np.cumsum(width + gap)])
    sheet = np.full((len(rows) * (height + GAP_PX) - GAP_PX, left[-1] - gap[-1], 3), 255, np.uint8)
    for (r, row), c in product(enumerate(rows.values()), range(columns)):
        top = r * (height + GAP_PX)
        sheet[top : top + height, left[c] : left[c] + width] = row[c]
    figure, axes = plt.subplots(
        figsize=(width_in, (width_in - 1) * sheet.shape[0] / sheet.shape[1] + 0.4)
    )
    axes.imshow(sheet, interpolation="none")  # the pixels as they are, also in a vector file
    axes.set_yticks([r * (height + GAP_PX) + height / 2 for r in range(len(rows))], list(rows))
    edges = np.concatenate([[0], np.cumsum(groups)])
    middles = (left[edges[:-1]] + left[edges[1:] - 1] + width) / 2
    axes.set_xticks(middles if headings else [], headings or [])
    axes.tick_params(length=0, top=False, labeltop=True, labelbottom=False)
    axes.spines[:].set_visible(False)
    axes.grid(False)
    return _done(figure)


def marked(
    images: Sequence[UInt8[np.ndarray, "120 160 3"]],
    points: Mapping[str, Float[np.ndarray, "M 2"]],
    titles: Sequence[str],
) -> Figure:
    """Images side by side with marks: for each name, one point (column, row in pixels) an image."""
    figure, axes = plt.subplots(1, len(images), figsize=(7, 2.1), sharey=True)
    for i, (image, axis, title) in enumerate(zip(images, axes, titles, strict=True)):
        axis.imshow(image, interpolation="none")
        for (name, place), mark in zip(points.items(), "x+1.", strict=False):
            axis.plot(*place[i], mark, color="black", markersize=9, markeredgewidth=3)
            axis.plot(*place[i], mark, color="white", markersize=8, markeredgewidth=1.3, label=name)
        axis.set(title=title, xlim=(-0.5, 159.5), ylim=(119.5, -0.5), xticks=[], yticks=[])
    handles, names = axes[0].get_legend_handles_labels()
    legend = figure.legend(handles, names, loc="outside lower center", ncols=len(points))
    legend.set_frame_on(True)
    legend.get_frame().set(facecolor=style.GREY, edgecolor="none")
    plt.setp(legend.get_texts(), color="white")
    return _done(figure)


def lines(
    curves: Mapping[str, tuple],
    x_label: str,
    y_label: str,
    *,
    markers: Mapping[str, tuple] | None = None,
    size_in: tuple[float, float] = (7.0, 2.6),
    **axis,
) -> Figure:
    """Named curves (x, y), and single points (x, y) under `markers`; `axis` goes to `Axes.set`."""
    figure, axes = plt.subplots(figsize=size_in)
    for (name, (x, y)), dash in zip(curves.items(), ["-", "--", "-.", ":"] * 3, strict=False):
        axes.plot(x, y, dash, label=name)
    for name, (x, y) in (markers or {}).items():
        axes.plot(x, y, "o", color="black", markersize=4, label=name)
    axes.set(xlabel=x_label, ylabel=y_label, **axis)
    axes.legend()
    return _done(figure)


def arm_drawing(
    joints_rad: Float[np.ndarray, " 5"],
    cubes: Float[np.ndarray, "2 7"],
    colours: tuple[str, str],
    *,
    path_m: Float[np.ndarray, "T 3"] | None = None,
    sticks_rad: Sequence[Float[np.ndarray, " 5"]] = (),
) -> Figure:
    """The robot and the cubes at one instant, with the fingertips' path and other poses as sticks."""
    links = {name: pose[0] for name, pose in arm.link_transforms(joints_rad[None]).items()}
    links["world"] = np.eye(4)
    figure = plt.figure(figsize=(6.0, 4.4))
    axes = figure.add_axes((0, 0, 1, 1), projection="3d", computed_zorder=False)
    fixed = ("torso", "head")
    shapes = [shape for shape in arm.SHAPES if shape.drawn]
    _draw(axes, [shape for shape in shapes if shape.link in fixed], links, 1)
    _draw(axes, TABLE_SHAPES, links, 2)
    blocks = []
    for name, colour, (x, y, z, qx, qy, qz, qw) in zip("ab", colours, cubes, strict=True):
        links[name] = np.eye(4)
        links[name][:3, 3] = x, y, z
        links[name][:3, :3] = arm.rotation((0, 0, 1), [2 * np.arctan2(qz, qw)])[0]  # they stay flat
        blocks.append(arm.Shape(name, "box", (CUBE_EDGE_M,) * 3, rgba=COLOUR_RGBA[colour]))
    _draw(axes, [shape for shape in shapes if shape.link not in fixed] + blocks, links, 3)
    if path_m is not None:
        axes.plot(*np.transpose(path_m), color=style.BLUE, lw=1.5, zorder=4)
    for pose in sticks_rad:
        chain = arm.link_transforms(pose[None])
        points = [chain[joint.link][0, :3, 3] for joint in arm.JOINTS]
        points += [chain["hand"][0, :3, 3], arm.fingertip(pose[None])[0]]
        axes.plot(*np.transpose(points), "o-", ms=3, lw=2, zorder=5)
    axes.set(xlim=(-0.05, 0.60), ylim=(-0.25, 0.40), zlim=(0.47, 0.98))
    axes.set_box_aspect((0.65, 0.65, 0.51), zoom=1.45)
    axes.view_init(**VIEW)
    axes.set_axis_off()
    return _done(figure)


def _draw(axes, shapes, links, layer: int) -> None:
    """Add shapes as shaded faces; within a layer matplotlib sorts them by depth."""
    faces, colours = [], []
    for shape in shapes:
        roll, pitch, yaw = (
            arm.rotation(axis, [angle])[0] for axis, angle in zip(np.eye(3), shape.rpy, strict=True)
        )
        pose = links[shape.link]
        for face in _faces(shape):
            normal = np.cross(face[1] - face[0], face[2] - face[0])
            normal *= np.sign(normal @ face.mean(0)) / max(np.linalg.norm(normal), 1e-12)
            lit = 0.62 + 0.38 * (pose[:3, :3] @ yaw @ pitch @ roll @ normal) @ (0.36, 0.48, 0.80)
            faces.append((face @ (yaw @ pitch @ roll).T + shape.xyz) @ pose[:3, :3].T + pose[:3, 3])
            colours.append((*np.clip(lit * np.array(shape.rgba[:3]), 0, 1), 1.0))
    axes.add_collection3d(Poly3DCollection(faces, facecolors=colours, zorder=layer))


def _faces(shape: arm.Shape) -> list[np.ndarray]:
    """The outline of a shape as polygons: layers along z, with sides between them."""
    turn = np.linspace(0, 2 * pi, 17)
    ring = shape.size[0] * np.stack([np.cos(turn), np.sin(turn)], 1)
    if shape.kind == "box":
        ring = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]) * shape.size[:2] / 2
    levels = [(1, -shape.size[-1] / 2), (1, shape.size[-1] / 2)]
    if shape.kind == "sphere":
        angles = np.linspace(0.05, pi - 0.05, 10)
        levels = [(np.sin(a), -shape.size[0] * np.cos(a)) for a in angles]
    layers = [np.c_[scale * ring, np.full(len(ring), z)] for scale, z in levels]
    sides = [
        np.stack([a[i], a[i + 1], b[i + 1], b[i]])
        for a, b in pairwise(layers)
        for i in range(len(ring) - 1)
    ]
    return [*sides, layers[0], layers[-1]]


def joints(groups: Mapping[str, Sequence[Float[np.ndarray, "T 5"]]], frames_per_s: float) -> Figure:
    """The five joints over time in degrees, a panel each; `groups` of radians share a colour."""
    figure, axes = plt.subplots(1, len(arm.JOINTS), figsize=(7.6, 2.3), sharex=True)
    for j, (axis, name) in enumerate(zip(axes, arm.JOINT_NAMES, strict=True)):
        for (label, tracks), colour in zip(groups.items(), (style.BLUE, style.RED), strict=False):
            for k, track in enumerate(tracks):
                seconds = np.arange(len(track)) / frames_per_s
                axis.plot(seconds, np.degrees(track[:, j]), color=colour, lw=0.9,
                          label=label if k == 0 else None)  # fmt: skip
        axis.set(title=name, xlabel="s")
    axes[0].set_ylabel("degrees")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return _done(figure)


def spans(names: Sequence[str], limits: np.ndarray, used: np.ndarray, x_label: str) -> Figure:
    """For each name the range it may have (a pale bar) and the one it has (a dark bar); (M, 2)."""
    figure, axes = plt.subplots(figsize=(7, 0.6 + 0.32 * len(names)))
    for i, ((low, high), (a, b)) in enumerate(zip(limits, used, strict=True)):
        axes.barh(i, high - low, left=low, color=style.SKY, alpha=0.35, height=0.6)
        axes.barh(i, b - a, left=a, color=style.BLUE, height=0.3)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set(xlabel=x_label)
    return _done(figure)


def travel(named_mm: Mapping[str, np.ndarray], other_mm: Mapping[str, np.ndarray]) -> Figure:
    """How far the named and the other cube went: a dot for each sample, a row for each action."""
    figure, axes = plt.subplots(figsize=(7, 2.4))
    for i, action in enumerate(named_mm):
        for far, colour, up in ((other_mm, style.GREY, 0.14), (named_mm, style.BLUE, -0.14)):
            spread = np.linspace(-0.1, 0.1, len(far[action]))  # side by side, not on one line
            label = ("named cube" if far is named_mm else "other cube") if i == 0 else None
            axes.plot(far[action], i + up + spread, ".", ms=2.5, color=colour, label=label)
    axes.set_yticks(range(len(named_mm)), list(named_mm))
    axes.invert_yaxis()
    axes.set(xlabel="cube travel in mm")
    axes.legend(loc="center", markerscale=4)
    return _done(figure)


def spread_and_scores(variance: np.ndarray, kept: Sequence[int], scores: Mapping) -> Figure:
    """Left: shares of variance of the principal components (%); right: scores (%) by how many are kept."""
    figure, (a, b) = plt.subplots(1, 2, figsize=(7, 2.5))
    a.bar(np.arange(1, len(variance) + 1), variance, color=style.GREY)
    a.set(xlabel="principal component", ylabel="% of the variance", yscale="log")
    for (name, score), dash in zip(scores.items(), ("-", "--", "-."), strict=False):
        b.plot(kept, score, dash, marker="o", ms=3, label=name)
    b.set(xlabel="components kept", ylabel="% right", ylim=(0, 104))
    b.legend(loc="lower right")
    return _done(figure)

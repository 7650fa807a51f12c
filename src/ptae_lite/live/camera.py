"""What camera.js needs to draw the picture of the robot's eye: matrices, light and shapes.

PyBullet's TinyRenderer draws a box by its faces. It draws a cylinder and a sphere as the convex
hull of the points of the shape that are farthest in some directions, and takes the direction from
the middle to a corner for the normal there. The meshes here are made in the same way, so that a
picture in a page can be the one that the recording would have.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from jaxtyping import Float

from ptae_lite.robot import arm, scene

CYLINDER_STEPS = 32  # corners of each end
HULL_MARGIN_M = 0.001  # of a cylinder
BEHIND = ("torso", "head")  # the eye never sees them


def view_matrix() -> Float[np.ndarray, "4 4"]:
    """From the world to the right eye, which looks along -z with y upwards."""
    head = arm.head_transform()
    eye = (head @ [*arm.RIGHT_EYE_M, 1.0])[:3]
    forward, up = head[:3, 0], head[:3, 2]
    turn = np.stack([np.cross(forward, up), up, -forward])
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = turn, -turn @ eye
    return view


def projection_matrix() -> Float[np.ndarray, "4 4"]:
    """From the eye to clip coordinates, as OpenGL has them."""
    height = 1 / np.tan(np.radians(scene.VERTICAL_VIEW_DEG) / 2)
    made = np.zeros((4, 4))
    made[0, 0], made[1, 1] = height * scene.IMAGE_HEIGHT / scene.IMAGE_WIDTH, height
    near, far = scene.NEAR_M, scene.FAR_M
    made[2, 2], made[2, 3] = (near + far) / (near - far), 2 * near * far / (near - far)
    made[3, 2] = -1
    return made


def constants() -> dict:
    """The camera as one object; rows of matrices one after another."""
    direction = np.array(scene.LIGHT["lightDirection"])
    shapes = [s for s in (*scene.TABLE_SHAPES, *arm.SHAPES) if s.drawn and s.link not in BEHIND]
    cube = arm.Shape("cube", "box", (scene.CUBE_EDGE_M,) * 3)
    return {
        "width": scene.IMAGE_WIDTH,
        "height": scene.IMAGE_HEIGHT,
        "matrix": np.round(projection_matrix() @ view_matrix(), 9).ravel().tolist(),
        "eye_m": np.linalg.inv(view_matrix())[:3, 3].tolist(),
        "light": (direction / np.linalg.norm(direction)).tolist(),
        "ambient": scene.LIGHT["lightAmbientCoeff"],
        "diffuse": scene.LIGHT["lightDiffuseCoeff"],
        "shapes": [{"link": s.link, "rgb": s.rgba[:3], **mesh(s)} for s in shapes],
        "cube": mesh(cube),
        "colours": {name: rgba[:3] for name, rgba in scene.COLOUR_RGBA.items()},
    }


def mesh(shape: arm.Shape) -> dict:
    """Triangles of a shape in its link's frame: nine coordinates each, and nine of normals."""
    if shape.kind == "box":
        corners, normals = box(shape.size)
    else:
        points = cylinder(*shape.size) if shape.kind == "cylinder" else shape.size[0] * SPHERE
        corners = hull(points)
        normals = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    x, y, z = (arm.rotation(a, [t])[0] for a, t in zip(np.eye(3), shape.rpy, strict=True))
    turn = z @ y @ x
    return {
        "corners": np.round(corners @ turn.T + shape.xyz, 6).ravel().tolist(),
        "normals": np.round(normals @ turn.T, 5).ravel().tolist(),
    }


def box(size) -> tuple[np.ndarray, np.ndarray]:
    """Corners and normals (12, 3, 3) of the triangles of a box."""
    corners, normals = [], []
    for axis, sign in product(range(3), (1, -1)):
        across, along = ((axis + 1) % 3, (axis + 2) % 3)[::sign]
        normal = sign * np.eye(3)[axis]
        face = [
            normal + u * np.eye(3)[across] + v * np.eye(3)[along]
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        corners += [[face[0], face[1], face[2]], [face[0], face[2], face[3]]]
        normals += [[normal] * 3] * 2
    return np.array(corners) * np.array(size) / 2, np.array(normals)


def _sphere() -> np.ndarray:
    """The 42 directions: corners of an icosahedron that stands on one, and middles of its edges."""
    ring = np.radians(36 + 72 * np.arange(5))
    lower = np.stack([2 * np.cos(ring), 2 * np.sin(ring), np.full(5, -1.0)], axis=1) / np.sqrt(5)
    corners = np.array([[0, 0, -1], *lower, *-lower, [0, 0, 1]])
    edge = np.linalg.norm(lower[0] - lower[1])
    middles = [
        (a + b) / np.linalg.norm(a + b)
        for a, b in combinations(corners, 2)
        if np.linalg.norm(a - b) < edge + 1e-6
    ]
    return np.array([*corners, *middles])


SPHERE = _sphere()


def cylinder(radius_m: float, length_m: float) -> np.ndarray:
    """The points of a cylinder with 32 sides that are farthest in the 42 directions."""
    around = 2 * np.pi * np.arange(CYLINDER_STEPS) / CYLINDER_STEPS
    ring = np.stack([radius_m * np.sin(around), radius_m * np.cos(around), 0 * around], axis=1)
    half = np.array([0, 0, length_m / 2])
    points = np.concatenate([ring + half, ring - half])
    return np.unique(points[np.argmax(SPHERE @ points.T, axis=1)] + HULL_MARGIN_M * SPHERE, axis=0)


def hull(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "M 3 3"]:
    """The triangles of the convex hull of a few points, seen anticlockwise from outside."""
    made, seen = [], set()
    for i, j, k in combinations(range(len(points)), 3):
        normal = np.cross(points[j] - points[i], points[k] - points[i])
        size = np.linalg.norm(normal)
        if size < 1e-12:
            continue
        off = (points - points[i]) @ (normal / size)
        if off.max() > 1e-9 and off.min() < -1e-9:
            continue
        outward = normal if off.max() <= 1e-9 else -normal
        flat = tuple(np.flatnonzero(np.abs(off) <= 1e-9))
        if flat in seen:
            continue
        seen.add(flat)
        face = points[list(flat)]
        middle, u = face.mean(0), face[0] - face.mean(0)
        angle = np.arctan2((face - middle) @ np.cross(outward / size, u), (face - middle) @ u)
        face = face[np.argsort(angle)]
        made += [[face[0], face[n], face[n + 1]] for n in range(1, len(face) - 1)]
    return np.array(made)

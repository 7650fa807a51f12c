"""The simulated scene: NICO at a table with two cubes, and the camera in its right eye.

Each `Scene` is a fresh PyBullet world. A world that is used again does not repeat a sequence bit by
bit; a fresh one does, and it takes only 8 ms to make.
"""

from __future__ import annotations

import os
import tempfile

import numpy as np
from jaxtyping import Float, UInt8

from ptae_lite.errors import RobotError
from ptae_lite.robot import arm, inverse
from ptae_lite.robot.urdf import nico_urdf

FRAMES_PER_S = 25
SUBSTEPS = 10  # physics at 250 Hz
IMAGE_HEIGHT, IMAGE_WIDTH = 120, 160

TABLE_TOP_M = 0.56
TABLE_SHAPES = (
    arm.Shape("world", "box", (0.60, 0.80, 0.03), (0.44, 0.10, TABLE_TOP_M - 0.015),
              rgba=(0.80, 0.66, 0.47, 1.0), solid=True),
)  # fmt: skip
CUBE_EDGE_M = 0.05
CUBE_MASS_KG = 0.08
CUBE_FRICTION, TABLE_FRICTION, HAND_FRICTION = 0.5, 0.5, 0.3
CUBE_PLACES_M = {"left": (0.39, 0.18), "right": (0.40, 0.01)}  # x, y
NOMINAL_PLACES_M = tuple(CUBE_PLACES_M.values())
COLOUR_RGBA = {
    "red": (0.95, 0.10, 0.10, 1.0),
    "green": (0.10, 0.75, 0.15, 1.0),
    "blue": (0.12, 0.20, 0.95, 1.0),
    "yellow": (0.97, 0.90, 0.10, 1.0),
    "cyan": (0.10, 0.90, 0.95, 1.0),
    "violet": (0.58, 0.10, 0.85, 1.0),
}

GRAVITY_M_S2 = (0, 0, -9.81)
MOTOR_FORCE_N_M = 50.0
POSITION_GAIN, VELOCITY_GAIN = 0.5, 1.0
VERTICAL_VIEW_DEG = 42.0
NEAR_M, FAR_M = 0.02, 3.0  # what the camera sees
LIGHT = {"lightDirection": (0.3, 0.6, 1.5), "lightAmbientCoeff": 0.6, "lightDiffuseCoeff": 0.5,
         "lightSpecularCoeff": 0.0}  # fmt: skip


def pybullet():
    """The PyBullet module.

    Raises:
        RobotError: PyBullet is not installed. The message says what still works.
    """
    try:
        import pybullet as module
    except ImportError:
        raise RobotError(
            "PyBullet is not installed, so nothing can be recorded or driven here; environment.txt "
            "brings it for Python 3.11 to 3.13 on Linux (x86-64), macOS and Windows. Everything "
            "else runs on the stored recording."
        ) from None
    return module


class Scene:
    """A fresh world with NICO in the home pose and two cubes on the table.

    Use it as a context manager, or call `close()` at the end.

    Args:
        colours: of the left and the right cube, names in `COLOUR_RGBA`.
        places_m: (2, 2) x and y of the left and the right cube.
        yaws_rad: (2,) rotation of the cubes about the vertical.

    Raises:
        RobotError: there is no such colour, or PyBullet is not installed.
    """

    _light = LIGHT

    def __init__(self, colours, places_m=NOMINAL_PLACES_M, yaws_rad=(0.0, 0.0)):
        self._client = None
        for colour in colours:
            if colour not in COLOUR_RGBA:
                raise RobotError(f"no colour {colour!r}; the cubes are {', '.join(COLOUR_RGBA)}")
        self._p = p = pybullet()
        self._client = p.connect(p.DIRECT)
        self._at = {"physicsClientId": self._client}
        p.setGravity(*GRAVITY_M_S2, **self._at)
        p.setTimeStep(1 / (FRAMES_PER_S * SUBSTEPS), **self._at)
        for shape in TABLE_SHAPES:
            table = self._box(shape.size, shape.xyz, shape.rgba, mass_kg=0)
            p.changeDynamics(table, -1, lateralFriction=TABLE_FRICTION, **self._at)
        self._nico = self._load_nico()
        self._joints = self._find_joints()
        self.cube_ids = []
        for colour, (x, y), yaw in zip(colours, places_m, yaws_rad, strict=True):
            place = (x, y, TABLE_TOP_M + CUBE_EDGE_M / 2)
            cube = self._box((CUBE_EDGE_M,) * 3, place, COLOUR_RGBA[colour], CUBE_MASS_KG, yaw)
            p.changeDynamics(cube, -1, lateralFriction=CUBE_FRICTION, **self._at)
            self.cube_ids.append(cube)
        self._target_rad = np.array(inverse.home_rad())
        for i, angle in zip(self._joints, self._target_rad, strict=True):
            p.resetJointState(self._nico, i, angle, **self._at)
        self._view, self._projection = self._camera()
        self.drive(self._target_rad)  # one frame at rest: motors on, cubes settled

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """End the simulation. A second call does nothing."""
        if self._client is not None:
            self._p.disconnect(self._client)
            self._client = None

    def _box(self, size, xyz, rgba, mass_kg, yaw_rad=0.0):
        p, half = self._p, [edge / 2 for edge in size]
        return p.createMultiBody(
            mass_kg,
            p.createCollisionShape(p.GEOM_BOX, halfExtents=half, **self._at),
            p.createVisualShape(p.GEOM_BOX, halfExtents=half, rgbaColor=rgba, **self._at),
            xyz,
            p.getQuaternionFromEuler((0, 0, yaw_rad)),
            **self._at,
        )

    def _load_nico(self):
        p = self._p
        handle, path = tempfile.mkstemp(suffix=".urdf")
        try:
            with os.fdopen(handle, "w") as file:
                file.write(nico_urdf())
            nico = p.loadURDF(path, useFixedBase=True, **self._at)
        finally:
            os.unlink(path)
        for i in range(-1, p.getNumJoints(nico, **self._at)):
            p.changeDynamics(nico, i, lateralFriction=HAND_FRICTION, **self._at)
        return nico

    def _find_joints(self):
        p = self._p
        count = p.getNumJoints(self._nico, **self._at)
        infos = (p.getJointInfo(self._nico, i, **self._at) for i in range(count))
        index = {info[1].decode(): info[0] for info in infos}
        return [index[name] for name in arm.JOINT_NAMES]

    def _camera(self):
        p = self._p
        head = arm.head_transform()
        eye = head @ np.array([*arm.RIGHT_EYE_M, 1.0])
        forward, up = head[:3, 0], head[:3, 2]
        view = p.computeViewMatrix(eye[:3], eye[:3] + forward, up, **self._at)
        aspect = IMAGE_WIDTH / IMAGE_HEIGHT
        return view, p.computeProjectionMatrixFOV(
            VERTICAL_VIEW_DEG, aspect, NEAR_M, FAR_M, **self._at
        )

    def image(self) -> UInt8[np.ndarray, "120 160 3"]:
        """What the right eye sees now."""
        p = self._p
        *_, pixels, _, _ = p.getCameraImage(
            IMAGE_WIDTH, IMAGE_HEIGHT, self._view, self._projection, shadow=0,
            renderer=p.ER_TINY_RENDERER, flags=p.ER_NO_SEGMENTATION_MASK, **self._light, **self._at,
        )  # fmt: skip
        if not isinstance(pixels, np.ndarray):  # this PyBullet was built without numpy
            pixels = np.frombuffer(bytes(pixels), np.uint8).reshape(IMAGE_HEIGHT, IMAGE_WIDTH, 4)
        return np.ascontiguousarray(pixels[:, :, :3])

    def joints_rad(self) -> Float[np.ndarray, " 5"]:
        """The joint angles as measured now."""
        states = self._p.getJointStates(self._nico, self._joints, **self._at)
        return np.array([state[0] for state in states])

    def cubes(self) -> Float[np.ndarray, "2 7"]:
        """Poses of the left and the right cube: position in metres, then quaternion x y z w."""
        poses = (self._p.getBasePositionAndOrientation(c, **self._at) for c in self.cube_ids)
        return np.array([[*position, *turn] for position, turn in poses])

    def put(self, places_m: Float[np.ndarray, "2 2"]) -> None:
        """Take the cubes to other places in an instant; they stand still there, turned as before.

        Args:
            places_m: x and y of the left and the right cube. One that is where it is to be is not
                touched.
        """
        p = self._p
        for cube, (x, y) in zip(self.cube_ids, places_m, strict=True):
            (here_x, here_y, z), turn = p.getBasePositionAndOrientation(cube, **self._at)
            if (x, y) != (here_x, here_y):
                p.resetBasePositionAndOrientation(cube, (x, y, z), turn, **self._at)
                p.resetBaseVelocity(cube, (0, 0, 0), (0, 0, 0), **self._at)

    def alter(self, friction: float = 1.0, mass: float = 1.0, light: float = 1.0) -> None:
        """Make the cubes more slippery or heavier, or the light another.

        Args:
            friction: of the cubes, as a share of the usual one.
            mass: of the cubes, likewise.
            light: its brightness, likewise.
        """
        for cube in self.cube_ids:
            self._p.changeDynamics(
                cube, -1, lateralFriction=friction * CUBE_FRICTION, mass=mass * CUBE_MASS_KG,
                **self._at,
            )  # fmt: skip
        parts = ("lightAmbientCoeff", "lightDiffuseCoeff")
        self._light = LIGHT | {name: light * LIGHT[name] for name in parts}

    def drive(self, target_rad: Float[np.ndarray, " 5"]) -> tuple[bool, bool]:
        """Move the arm to `target_rad` in one frame (40 ms) of physics.

        The motors follow angles that go at constant speed from the last target to this one.

        Returns:
            Which cubes (left, right) the arm touched during the frame.

        Raises:
            RobotError: a target is outside a joint's limits.
        """
        target_rad = np.asarray(target_rad, dtype=float)
        arm.check_limits(target_rad[None])
        p, start_rad = self._p, self._target_rad
        speed = (target_rad - start_rad) * FRAMES_PER_S
        touched = [False, False]
        for step in range(1, SUBSTEPS + 1):
            p.setJointMotorControlArray(
                self._nico, self._joints, p.POSITION_CONTROL,
                targetPositions=start_rad + (target_rad - start_rad) * step / SUBSTEPS,
                targetVelocities=speed,
                forces=[MOTOR_FORCE_N_M] * len(self._joints),
                positionGains=[POSITION_GAIN] * len(self._joints),
                velocityGains=[VELOCITY_GAIN] * len(self._joints), **self._at,
            )  # fmt: skip
            p.stepSimulation(**self._at)
            for side, cube in enumerate(self.cube_ids):
                if not touched[side]:
                    touched[side] = bool(p.getContactPoints(self._nico, cube, **self._at))
        self._target_rad = target_rad
        return tuple(touched)

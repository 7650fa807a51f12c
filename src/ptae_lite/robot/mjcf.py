"""The arm, the table and the cubes as MJCF, the format of MuJoCo's physics engine.

It says of `arm`, `urdf` and `scene` what matters to physics, so that an engine that runs in a web
page can do what PyBullet does here. The engines differ in three things:

- PyBullet multiplies the friction of two bodies, and MuJoCo takes the larger. So each pair of
  shapes that can touch is listed, with the product.
- PyBullet lets shapes touch a margin before they meet. Here, only the pairs of arm and cube have
  it: it makes the arm thicker.
- PyBullet's motor reaches the speed it wants within one step, whatever it pushes, up to its
  greatest torque. MuJoCo's motor applies a torque, which whoever drives the arm has to work out. A
  heavy rotor keeps a cube that is hit from slowing a light wrist.
"""

from __future__ import annotations

import xml.etree.ElementTree as xml
from itertools import combinations, product

from ptae_lite.language import SIDES
from ptae_lite.robot import arm, scene
from ptae_lite.robot.urdf import LINK_INERTIA_KG_M2, LINK_MASS_KG

MARGIN_M = 0.001  # PyBullet's, of shapes from a URDF
ROTOR_KG_M2 = 0.1
# Time constant in seconds and damping ratio of the arm's touch: a cube that is pinched between hand
# and table is not thrown.
TOUCH = (0.02, 3)
TURNING = (0.005, 1e-4, 1e-4)  # friction against spinning and rolling: MuJoCo's defaults
# An elliptic cone is Coulomb's law; with a stiff friction, things at rest do not creep.
SOLVER = {"cone": "elliptic", "impratio": "10", "integrator": "Euler"}


def _numbers(values) -> str:
    return " ".join(f"{v:g}" for v in values)


def _geom(parent, name: str, shape: arm.Shape, **more) -> None:
    if shape.kind == "box":
        size = [edge / 2 for edge in shape.size]
    elif shape.kind == "cylinder":
        size = [shape.size[0], shape.size[1] / 2]
    else:
        size = shape.size
    xml.SubElement(
        parent, "geom", name=name, type=shape.kind, size=_numbers(size), pos=_numbers(shape.xyz),
        euler=_numbers(shape.rpy), contype="0", conaffinity="0", **more,
    )  # fmt: skip


def _add_arm(world) -> list[str]:
    """The links, each inside its parent, with their solid shapes; returns the shapes' names."""
    parent, names = world, []
    for joint in (*arm.JOINTS, None):
        link = joint.link if joint else "hand"
        origin_m = joint.origin_m if joint else arm.WRIST_X_ORIGIN_M
        turned = (0, 0, 0) if joint else (arm.WRIST_X_RAD, 0, 0)
        parent = xml.SubElement(parent, "body", name=link, pos=_numbers(origin_m),
                                euler=_numbers(turned))  # fmt: skip
        if joint:
            xml.SubElement(
                parent, "joint", name=joint.name, axis=_numbers(joint.axis),
                range=_numbers([joint.lower_rad, joint.upper_rad]), armature=f"{ROTOR_KG_M2:g}",
            )  # fmt: skip
        xml.SubElement(parent, "inertial", pos="0 0 0", mass=f"{LINK_MASS_KG:g}",
                       diaginertia=" ".join([LINK_INERTIA_KG_M2] * 3))  # fmt: skip
        for shape in arm.SHAPES:
            if shape.link == link and shape.solid:
                names.append(f"{link} {len(names)}")
                _geom(parent, names[-1], shape, mass="0")
    return names


def nico_mjcf() -> str:
    """The scene as MJCF: the left arm in its zero pose, the table, and two cubes at the origin.

    The joints come first, in the order of `arm.JOINTS`, then the left and the right cube.
    """
    model = xml.Element("mujoco", model="nico_at_the_table")
    xml.SubElement(model, "compiler", angle="radian", eulerseq="XYZ", autolimits="true")
    step_s = 1 / (scene.FRAMES_PER_S * scene.SUBSTEPS)
    xml.SubElement(model, "option", SOLVER, timestep=f"{step_s:g}",
                   gravity=_numbers(scene.GRAVITY_M_S2))  # fmt: skip
    world = xml.SubElement(model, "worldbody")
    friction = {}
    for i, shape in enumerate(scene.TABLE_SHAPES):
        _geom(world, f"table {i}", shape)
        friction[f"table {i}"] = scene.TABLE_FRICTION
    tables, links = list(friction), _add_arm(world)
    friction |= dict.fromkeys(links, scene.HAND_FRICTION)
    cube = arm.Shape("cube", "box", (scene.CUBE_EDGE_M,) * 3)
    for side in SIDES:
        body = xml.SubElement(world, "body", name=side)
        xml.SubElement(body, "freejoint")
        _geom(body, side, cube, mass=f"{scene.CUBE_MASS_KG:g}")
        friction[side] = scene.CUBE_FRICTION
    contact = xml.SubElement(model, "contact")
    groups = [tables, links, *([side] for side in SIDES)]  # no two of a group can touch
    for ours, others in combinations(groups, 2):
        for a, b in product(ours, others):
            sliding = friction[a] * friction[b]
            made = xml.SubElement(contact, "pair", geom1=a, geom2=b,
                                  friction=_numbers([sliding, sliding, *TURNING]))  # fmt: skip
            if a in links:
                made.attrib |= {"margin": f"{MARGIN_M:g}", "solref": _numbers(TOUCH)}
    motors = xml.SubElement(model, "actuator")
    for joint in arm.JOINTS:
        most = scene.MOTOR_FORCE_N_M
        xml.SubElement(motors, "motor", joint=joint.name, forcerange=_numbers([-most, most]))
    xml.indent(model)
    return xml.tostring(model, encoding="unicode")

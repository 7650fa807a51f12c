"""The arm of `arm.py` written as URDF, the format that simulators read."""

from __future__ import annotations

import xml.etree.ElementTree as xml

from ptae_lite.robot import arm

LINK_MASS_KG = 0.3  # motors hold the arm, so its mass hardly matters
LINK_INERTIA_KG_M2 = "1e-4"  # about each axis; text, as the recording's fingerprint is of text


def _numbers(values) -> str:
    return " ".join(f"{v:g}" for v in values)


def _origin(parent, xyz, rpy=(0, 0, 0)):
    xml.SubElement(parent, "origin", xyz=_numbers(xyz), rpy=_numbers(rpy))


def _geometry(parent, shape: arm.Shape):
    geometry = xml.SubElement(parent, "geometry")
    if shape.kind == "box":
        xml.SubElement(geometry, "box", size=_numbers(shape.size))
    elif shape.kind == "cylinder":
        radius, length = shape.size
        xml.SubElement(geometry, "cylinder", radius=f"{radius:g}", length=f"{length:g}")
    else:
        xml.SubElement(geometry, "sphere", radius=f"{shape.size[0]:g}")


def _link(robot, name: str):
    link = xml.SubElement(robot, "link", name=name)
    inertial = xml.SubElement(link, "inertial")
    xml.SubElement(inertial, "mass", value=f"{LINK_MASS_KG:g}")
    about = dict.fromkeys(("ixx", "iyy", "izz"), LINK_INERTIA_KG_M2)
    xml.SubElement(inertial, "inertia", about | dict.fromkeys(("ixy", "ixz", "iyz"), "0"))
    for shape in arm.SHAPES:
        if shape.link != name:
            continue
        if shape.drawn:
            visual = xml.SubElement(link, "visual")
            _origin(visual, shape.xyz, shape.rpy)
            _geometry(visual, shape)
            material = xml.SubElement(visual, "material", name="rgba " + _numbers(shape.rgba))
            xml.SubElement(material, "color", rgba=_numbers(shape.rgba))
        if shape.solid:
            collision = xml.SubElement(link, "collision")
            _origin(collision, shape.xyz, shape.rpy)
            _geometry(collision, shape)


def _joint(robot, name, kind, parent, child, xyz, rpy=(0, 0, 0)):
    joint = xml.SubElement(robot, "joint", name=name, type=kind)
    xml.SubElement(joint, "parent", link=parent)
    xml.SubElement(joint, "child", link=child)
    _origin(joint, xyz, rpy)
    return joint


def nico_urdf() -> str:
    """NICO's upper body as URDF text: `torso`, `head`, and the left arm down to the `hand`."""
    robot = xml.Element("robot", name="nico_upper_body")
    _link(robot, "torso")
    _link(robot, "head")
    head_rpy = (0.0, arm.HEAD_PITCH_RAD, arm.HEAD_YAW_RAD)
    _joint(robot, "neck", "fixed", "torso", "head", arm.HEAD_ORIGIN_M, head_rpy)
    parent = "torso"
    for j in arm.JOINTS:
        _link(robot, j.link)
        joint = _joint(robot, j.name, "revolute", parent, j.link, j.origin_m)
        xml.SubElement(joint, "axis", xyz=_numbers(j.axis))
        xml.SubElement(
            joint, "limit", lower=f"{j.lower_rad:g}", upper=f"{j.upper_rad:g}",
            effort="50", velocity="10",
        )  # fmt: skip
        parent = j.link
    _link(robot, "hand")
    wrist_x_rpy = (arm.WRIST_X_RAD, 0, 0)
    _joint(robot, "wrist_x", "fixed", parent, "hand", arm.WRIST_X_ORIGIN_M, wrist_x_rpy)
    xml.indent(robot)
    return xml.tostring(robot, encoding="unicode")

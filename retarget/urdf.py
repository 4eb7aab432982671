"""The humanoid as URDF, from the one description in `body.py`."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from kinemimic.pipeline.skeleton import NODE_INDEX
from kinemimic.retarget.body import BODIES, BODY_INDEX, Body, node_offsets


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _geometry(parent: ET.Element, body: Body) -> None:
    geometry = ET.SubElement(parent, "geometry")
    x, _, z = body.size
    if body.shape == "sphere":
        ET.SubElement(geometry, "sphere", radius=_numbers(0.5 * x))
    elif body.shape == "box":
        ET.SubElement(geometry, "box", size=_numbers(*body.size))
    else:
        # Bullet has no ellipsoid: the capsule that lies inside it end to end (length without the caps).
        ET.SubElement(geometry, "capsule", radius=_numbers(0.5 * x), length=_numbers(z - x))


def _link(robot: ET.Element, body: Body) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(*body.center), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=_numbers(body.mass))
    ixx, iyy, izz = body.inertia
    ET.SubElement(
        inertial, "inertia", ixx=_numbers(ixx), iyy=_numbers(iyy), izz=_numbers(izz), ixy="0", ixz="0", iyz="0"
    )
    for role in ("visual", "collision"):
        element = ET.SubElement(link, role)
        ET.SubElement(element, "origin", xyz=_numbers(*body.center), rpy="0 0 0")
        _geometry(element, body)


def humanoid_urdf(joint_type: str = "spherical") -> str:
    """URDF text of the Table 1 humanoid.

    joint_type: "spherical" for Bullet, whose extension of URDF it is; "floating" for readers of plain URDF.
    For Bullet, a massless base carries the pelvis: its stable PD takes joints in that layout only.
    """
    robot = ET.Element("robot", name="kinemimic_humanoid")
    base = ET.SubElement(ET.SubElement(robot, "link", name="base"), "inertial")
    ET.SubElement(base, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(base, "mass", value="0.0001")
    ET.SubElement(base, "inertia", ixx="0.0001", iyy="0.0001", izz="0.0001", ixy="0", ixz="0", iyz="0")
    offsets = node_offsets()
    for body in BODIES:
        _link(robot, body)
        root = body.parent == ""
        joint = ET.SubElement(robot, "joint", name=body.node, type="fixed" if root else joint_type)
        ET.SubElement(joint, "parent", link="base" if root else body.parent)
        ET.SubElement(joint, "child", link=body.name)
        ET.SubElement(joint, "origin", xyz=_numbers(*offsets[NODE_INDEX[body.node]]), rpy="0 0 0")
        if not root and BODIES[BODY_INDEX[body.name]].torque_limit:
            ET.SubElement(joint, "limit", effort=_numbers(body.torque_limit), velocity="100")
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"

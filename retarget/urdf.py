"""The humanoid as URDF, from the one description in `body.py`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from xml.etree import ElementTree as ET

from kinemimic.pipeline.skeleton import NODE_INDEX
from kinemimic.retarget.body import BODIES, Body, node_offsets

# The massless link within the pelvis that pybullet wants as its base.
BASE_MASS = 1e-4  # kg
BASE_INERTIA = 1e-4  # kg·m²


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _axes(vector: Iterable[float], y_up: bool) -> str:
    """A vector's components in the file's axes: ours, or the cyclic (left, up, forward)."""
    x, y, z = vector
    return _numbers(y, z, x) if y_up else _numbers(x, y, z)


def _shapes(body: Body, plain: bool) -> Iterator[tuple[str, Iterable[float], dict[str, str]]]:
    """Kind, centre and size attributes of the shapes that make up a body."""
    x, _, z = body.size
    radius, length = {"radius": _numbers(0.5 * x)}, {"length": _numbers(z - x)}
    if body.shape == "sphere":
        yield "sphere", body.center, radius
    elif body.shape == "box":
        yield "box", body.center, {}
    elif not plain:
        # Bullet has no ellipsoid: the capsule that lies inside it end to end (length without the caps).
        yield "capsule", body.center, radius | length
    else:
        # Plain URDF has no capsule either: a cylinder and its two caps.
        yield "cylinder", body.center, radius | length
        for end in (-0.5, 0.5):
            yield "sphere", (body.center[0], body.center[1], body.center[2] + end * (z - x)), radius


def _link(robot: ET.Element, body: Body, plain: bool, y_up: bool) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_axes(body.center, y_up), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=_numbers(body.mass))
    ixx, iyy, izz = _axes(body.inertia, y_up).split()
    ET.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    # URDF's capsule and cylinder lie along Z, the limbs of a Y-up file along Y.
    along_limb = f"{_numbers(-0.5 * math.pi)} 0 0" if y_up else "0 0 0"
    for role in ("visual", "collision"):
        for kind, center, size in _shapes(body, plain):
            element = ET.SubElement(link, role)
            turn = along_limb if kind in ("capsule", "cylinder") else "0 0 0"
            ET.SubElement(element, "origin", xyz=_axes(center, y_up), rpy=turn)
            ET.SubElement(ET.SubElement(element, "geometry"), kind, size or {"size": _axes(body.size, y_up)})


def humanoid_urdf(joint_type: str = "floating", *, y_up: bool = False) -> str:
    """URDF text of the Table 1 humanoid.

    joint_type: "spherical" for Bullet, whose extension of URDF it is; "floating" for readers of plain URDF
    (rerun, Foxglove), which know neither ball joints nor capsules: a cylinder and two spheres
    stand for these.
    y_up: axes X left, Y up, Z forward instead of ours. Bullet's stable PD builds its mass matrix from the
    collision shapes and takes every capsule to lie along Y; with limbs along Z it is unstable.
    A massless base carries the pelvis: that controller takes joints in this layout only.
    """
    robot = ET.Element("robot", name="kinemimic_humanoid")
    base = ET.SubElement(ET.SubElement(robot, "link", name="base"), "inertial")
    ET.SubElement(base, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(base, "mass", value=_numbers(BASE_MASS))
    moment = _numbers(BASE_INERTIA)
    ET.SubElement(base, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")
    offsets = node_offsets()
    for body in BODIES:
        _link(robot, body, joint_type != "spherical", y_up)
        root = body.parent == ""
        joint = ET.SubElement(robot, "joint", name=body.node, type="fixed" if root else joint_type)
        ET.SubElement(joint, "parent", link="base" if root else body.parent)
        ET.SubElement(joint, "child", link=body.name)
        ET.SubElement(joint, "origin", xyz=_axes(offsets[NODE_INDEX[body.node]], y_up), rpy="0 0 0")
        if not root:
            # Unused by ball joints, but its absence is warned about.
            ET.SubElement(joint, "axis", xyz="1 0 0")
            ET.SubElement(joint, "limit", effort=_numbers(body.torque_limit), velocity="100")
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"

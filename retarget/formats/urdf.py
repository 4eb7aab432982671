"""The humanoid as URDF, generated from `humanoid.body`, for Bullet, other simulators and viewers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from xml.etree import ElementTree as ET

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.number_text import number_text
from kinemimic.retarget.humanoid.body import BODIES, Body, node_offsets

# Auxiliary links: the base inside the pelvis that pybullet needs, and the links between the hinges of a
# joint. Simulators reject moving links without mass.
SMALL_MASS = 1e-4  # kg
SMALL_INERTIA = 1e-4  # kg·m²
HINGE_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def _axes(vector: Iterable[float], y_up: bool) -> str:
    """A vector's components in the file's axes: (forward, left, up), or (left, up, forward) if y_up."""
    x, y, z = vector
    return number_text(y, z, x) if y_up else number_text(x, y, z)


def _geometries(body: Body, plain: bool) -> Iterator[tuple[str, Iterable[float], dict[str, str]]]:
    """Kind, centre and size attributes of the geometries of a body."""
    x, _, z = body.size
    radius, length = {"radius": number_text(0.5 * x)}, {"length": number_text(z - x)}
    if body.shape == "sphere":
        yield "sphere", body.center, radius
    elif body.shape == "box":
        yield "box", body.center, {}
    elif not plain:
        # Bullet has no ellipsoid: the inscribed capsule of the same length (URDF's excludes the caps).
        yield "capsule", body.center, radius | length
    else:
        # Standard URDF has no capsule either: a cylinder and two spheres.
        yield "cylinder", body.center, radius | length
        for end in (-0.5, 0.5):
            yield "sphere", (body.center[0], body.center[1], body.center[2] + end * (z - x)), radius


def _link(robot: ET.Element, body: Body, plain: bool, y_up: bool) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_axes(body.center, y_up), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=number_text(body.mass))
    ixx, iyy, izz = _axes(body.inertia, y_up).split()
    ET.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    # URDF capsules and cylinders lie along Z, the limbs of a Y-up file along Y.
    along_limb = f"{number_text(-0.5 * math.pi)} 0 0" if y_up else "0 0 0"
    for role in ("visual", "collision"):
        for kind, center, size in _geometries(body, plain):
            element = ET.SubElement(link, role)
            turn = along_limb if kind in ("capsule", "cylinder") else "0 0 0"
            ET.SubElement(element, "origin", xyz=_axes(center, y_up), rpy=turn)
            ET.SubElement(ET.SubElement(element, "geometry"), kind, size or {"size": _axes(body.size, y_up)})


def _small_link(robot: ET.Element, name: str) -> None:
    inertial = ET.SubElement(ET.SubElement(robot, "link", name=name), "inertial")
    ET.SubElement(inertial, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=number_text(SMALL_MASS))
    moment = number_text(SMALL_INERTIA)
    ET.SubElement(inertial, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    origin: str,
    axis: str = "",
    effort: str = "",
) -> None:
    """Add a joint; axis, effort (N·m): of a movable joint."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=origin, rpy="0 0 0")
    if not axis:
        return
    # Ball joints do not use them, but parsers warn if they are missing.
    ET.SubElement(joint, "axis", xyz=axis)
    limit = ET.SubElement(joint, "limit", effort=effort, velocity="100")
    if kind == "revolute":
        limit.set("lower", number_text(-math.pi))
        limit.set("upper", number_text(math.pi))


def humanoid_urdf(joint_type: str = "floating", *, y_up: bool = False) -> str:
    """URDF text of the Table 1 humanoid.

    joint_type: "spherical" for Bullet (its extension of URDF, as are capsules);
        "revolute" for any simulator: each ball joint NODE becomes three hinges NODE_x, NODE_y, NODE_z from
        the parent outwards, which rotate the child by Rx Ry Rz (intrinsic x, y, z); "floating" for viewers
        (rerun, Foxglove), which take the pose of every body from elsewhere.
    y_up: axes X left, Y up, Z forward. Bullet's stable PD builds its mass matrix from the collision shapes
        and assumes that every capsule lies along Y; with limbs along Z it is unstable.

    A massless base carries the pelvis, because that controller accepts joints in this layout only.
    """
    robot = ET.Element("robot", name="kinemimic_humanoid")
    _small_link(robot, "base")
    offsets = node_offsets()
    for body in BODIES:
        origin, effort = _axes(offsets[NODE_INDEX[body.node]], y_up), number_text(body.torque_limit)
        parent = body.parent or "base"
        if joint_type == "revolute" and body.parent:
            for name, axis in HINGE_AXES.items():
                child = f"{body.name}_{name}" if name != "z" else body.name
                _joint(
                    robot, f"{body.node}_{name}", joint_type, parent, child, origin, _axes(axis, y_up), effort
                )
                if name != "z":
                    _small_link(robot, child)
                parent, origin = child, "0 0 0"
        elif body.parent:
            _joint(robot, body.node, joint_type, parent, body.name, origin, "1 0 0", effort)
        else:
            _joint(robot, body.node, "fixed", parent, body.name, origin)
        _link(robot, body, joint_type != "spherical", y_up)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"

"""The humanoid as MJCF, MuJoCo's own format, generated from `humanoid.body`."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.number_text import number_text
from kinemimic.retarget.humanoid.body import BODIES, STANDING_HEIGHT, Body, node_offsets
from kinemimic.retarget.humanoid.limits import LIMITS

HINGE_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def humanoid_mjcf(*, time_step: float, gravity: float, friction: float) -> str:
    """MJCF text of the Table 1 humanoid, standing on a floor; Z up, X forward.

    time_step: s; gravity: m/s²; friction: coefficient between the humanoid and the floor.

    The pelvis is free; each of the 14 ball joints NODE is three hinges NODE_x, NODE_y, NODE_z, which rotate
    the child by Rx Ry Rz (intrinsic x, y, z), as in the URDF. Every hinge has a position actuator of its
    name, with the gains and the torque limit of the simulation; the control is the angle, rad. Bodies touch
    the floor, not each other. A hinge's range is that of a person's joint: stated, but not enforced
    (limited="false"), because the simulation does not enforce it either.
    """
    root = ET.Element("mujoco", model="kinemimic_humanoid")
    ET.SubElement(root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
    ET.SubElement(
        root, "option", timestep=f"{time_step:.12g}", gravity=f"0 0 {-gravity:.9g}", integrator="implicitfast"
    )
    default = ET.SubElement(root, "default")
    slide = f"{friction:.9g} 0.005 0.0001"
    # Contacts between a geom of type 1 and one of affinity 1: humanoid and floor, but no two bodies.
    ET.SubElement(
        default, "geom", friction=slide, contype="1", conaffinity="0", condim="3", rgba="1 0.59 0.2 1"
    )
    ET.SubElement(default, "joint", limited="false")
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0 -2 4", dir="0 0.45 -0.9", directional="true")
    ET.SubElement(
        world, "geom", name="floor", type="plane", size="0 0 1", contype="0", conaffinity="1", friction=slide,
        rgba="0.94 0.95 0.96 1",
    )  # fmt: skip
    actuator = ET.SubElement(root, "actuator")
    offsets, elements = node_offsets(), {"": world}
    for body in BODIES:
        place = offsets[NODE_INDEX[body.node]] if body.parent else np.array([0.0, 0.0, STANDING_HEIGHT])
        element = ET.SubElement(elements[body.parent], "body", name=body.name, pos=number_text(*place))
        elements[body.name] = element
        if not body.parent:
            ET.SubElement(element, "freejoint", name="root")
        else:
            _hinges(element, actuator, body)
        ET.SubElement(
            element, "inertial", pos=number_text(*body.center), mass=number_text(body.mass),
            diaginertia=number_text(*body.inertia),
        )  # fmt: skip
        kind, size = _shape(body)
        ET.SubElement(element, "geom", name=body.name, type=kind, size=size, pos=number_text(*body.center))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _hinges(element: ET.Element, actuator: ET.Element, body: Body) -> None:
    """The three hinges of a body's ball joint, from the parent outwards, and their actuators."""
    kp, kv = number_text(body.stiffness), number_text(body.damping)
    torque = number_text(-body.torque_limit, body.torque_limit)
    for (name, axis), (least, most) in zip(HINGE_AXES.items(), LIMITS[body.node].tolist(), strict=True):
        joint = ET.SubElement(element, "joint", name=f"{body.node}_{name}", type="hinge", axis=axis)
        if least < most:  # a knee bends about y alone; MuJoCo refuses an empty range
            joint.set("range", number_text(least, most))
        ET.SubElement(
            actuator, "position", name=f"{body.node}_{name}", joint=f"{body.node}_{name}", kp=kp, kv=kv,
            forcelimited="true", forcerange=torque,
        )  # fmt: skip


def _shape(body: Body) -> tuple[str, str]:
    """Type and size of the geom that is simulated; an ellipsoid is the capsule of its length."""
    x, y, z = (0.5 * side for side in body.size)
    if body.shape == "box":
        return "box", number_text(x, y, z)
    return ("sphere", number_text(x)) if body.shape == "sphere" else ("capsule", number_text(x, z - x))

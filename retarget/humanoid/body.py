"""The simulated body: Table 1's 15 rigid bodies, their 14 ball joints and the nodes that carry them.

A body's frame is that of its node: X forward, Y left, Z up in a neutral standing pose (arms hanging), in
which every joint rotation is the identity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import content_hash
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES


@dataclass(frozen=True)
class Body:
    """One rigid body of Table 1.

    node: the node at its joint; parent: name of the body it is jointed to, "" for the root;
    shape: "sphere", "box" or "ellipsoid"; size: (x, y, z) outer dimensions, metres; mass: kg;
    center: (x, y, z) of its centre of mass in the node's frame, metres;
    stiffness, damping: of the stable PD, N·m/rad and N·m·s/rad; torque_limit: N·m. A correction by the policy
        takes effect with a delay of damping over stiffness, 0.05 s in trunk and legs. With the usual 0.1 s,
        the same training ends farther from its reference (see the changelog).
    """

    name: str
    node: str
    parent: str
    shape: str
    size: tuple[float, float, float]
    mass: float
    center: tuple[float, float, float]
    stiffness: float = 0.0
    damping: float = 0.0
    torque_limit: float = 0.0

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Principal moments about the centre, kg·m² (solid ellipsoid: m/5 of the squared semi-axes)."""
        x, y, z = (0.5 * s for s in self.size)
        scale = self.mass / (3.0 if self.shape == "box" else 5.0)
        return scale * (y * y + z * z), scale * (x * x + z * z), scale * (x * x + y * y)


def _arm(side: str) -> tuple[Body, ...]:
    return (
        Body(f"upper_arm_{side}", f"shoulder_{side}", "torso", "ellipsoid", (0.10, 0.10, 0.30), 1.6,
             (0, 0, -0.15), 400, 40, 100),
        Body(f"forearm_{side}", f"elbow_{side}", f"upper_arm_{side}", "ellipsoid", (0.08, 0.08, 0.25), 1.0,
             (0, 0, -0.125), 300, 30, 60),
        Body(f"hand_{side}", f"wrist_{side}", f"forearm_{side}", "sphere", (0.08, 0.08, 0.08), 0.8,
             (0, 0, -0.04), 50, 5, 20),
    )  # fmt: skip


def _leg(side: str) -> tuple[Body, ...]:
    return (
        Body(f"thigh_{side}", f"hip_{side}", "pelvis", "ellipsoid", (0.10, 0.10, 0.40), 5.2,
             (0, 0, -0.20), 500, 25, 200),
        Body(f"shin_{side}", f"knee_{side}", f"thigh_{side}", "ellipsoid", (0.08, 0.08, 0.38), 2.8,
             (0, 0, -0.19), 500, 25, 150),
        Body(f"foot_{side}", f"ankle_{side}", f"shin_{side}", "box", (0.16, 0.07, 0.05), 1.2,
             (0.04, 0, -0.025), 400, 20, 90),
    )  # fmt: skip


# Table 1 gives length, width and height but no axes. Here torso and hip take the length as height, the height
# as width and the width as depth; limbs hang along their length.
BODIES: tuple[Body, ...] = (
    Body("pelvis", "hip_center", "", "box", (0.12, 0.26, 0.15), 5.8, (0, 0, 0)),
    Body("torso", "spine", "pelvis", "box", (0.10, 0.28, 0.40), 15.0, (0, 0, 0.20), 1000, 50, 200),
    Body("head", "shoulder_center", "torso", "sphere", (0.15, 0.15, 0.15), 2.2, (0, 0, 0.115), 100, 10, 50),
    *_arm("left"),
    *_arm("right"),
    *_leg("left"),
    *_leg("right"),
)
BODY_NAMES: tuple[str, ...] = tuple(body.name for body in BODIES)
BODY_INDEX: dict[str, int] = {name: index for index, name in enumerate(BODY_NAMES)}
BODY_PARENTS: tuple[int, ...] = tuple(BODY_INDEX.get(body.parent, -1) for body in BODIES)
FEET: list[int] = [BODY_INDEX[f"foot_{side}"] for side in SIDES]
# Node that carries each body, (15,); the 14 joints are those of BODIES[1:], in this order.
BODY_NODES: NDArray[np.intp] = np.array([NODE_INDEX[body.node] for body in BODIES])
BODY_MASSES: Array = np.array([body.mass for body in BODIES])  # kg
BODY_INERTIAS: Array = np.array([body.inertia for body in BODIES])  # (15, 3) kg m², about the centre of mass
BODY_CENTERS: Array = np.array([body.center for body in BODIES])  # (15, 3) m, of mass, in the bodies' frames
TOTAL_MASS: float = sum(body.mass for body in BODIES)


def node_offsets() -> Array:
    """Rest offsets (20, 3) of the nodes from their parents on the Table 1 body, metres.

    The table has no neck: 4 cm are left between torso and head. Hip joints are 17 cm apart at the lower face
    of the pelvis, shoulder joints beside the torso, so that a hanging arm touches neither.
    """
    offsets: dict[str, tuple[float, float, float]] = {
        "hip_center": (0, 0, 0),
        "spine": (0, 0, 0.075),
        "shoulder_center": (0, 0, 0.40),
        "head": (0, 0, 0.115),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        offsets |= {
            f"shoulder_{side}": (0, 0.19 * sign, 0.36),
            f"elbow_{side}": (0, 0, -0.30),
            f"wrist_{side}": (0, 0, -0.25),
            f"hand_{side}": (0, 0, -0.04),
            f"hip_{side}": (0, 0.085 * sign, -0.075),
            f"knee_{side}": (0, 0, -0.40),
            f"ankle_{side}": (0, 0, -0.38),
            f"foot_{side}": (0.12, 0, -0.025),
        }
    return np.array([offsets[node] for node in NODES], dtype=np.float64)


def body_identity() -> str:
    """Content hash of the body that a policy controls: lengths, masses, actuators."""
    numbers = [
        (*body.size, body.mass, *body.center, body.stiffness, body.damping, body.torque_limit)
        for body in BODIES
    ]
    return content_hash({"bodies": np.array(numbers, dtype=np.float64), "offsets": node_offsets()})


def sole_corners() -> Array:
    """The four lower corners (4, 3) of the foot box in the ankle node's frame, metres."""
    foot = BODIES[BODY_INDEX["foot_left"]]
    (x, y, z), (cx, cy, cz) = (0.5 * s for s in foot.size), foot.center
    return np.array([[cx + a * x, cy + b * y, cz - z] for a in (-1, 1) for b in (-1, 1)])


LEG_LENGTH: float = 0.40 + 0.38
STANDING_HEIGHT: float = 0.075 + LEG_LENGTH + 0.05  # of the hip centre over the ground, standing upright

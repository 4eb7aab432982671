"""The known walk as tracks of an OpenSim model's bodies, X forward, Y up, Z right."""

from __future__ import annotations

import json

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import RigidWalk, rigid_walk

RATE = 100.0
FILE_FROM_WORLD = from_axis_angle("X", -0.5 * np.pi)
# Body -> the nodes at its origin and of its rotation.
BODIES: dict[str, tuple[str, str]] = {
    "pelvis": ("hip_center", "hip_center"),
    "torso": ("spine", "spine"),
    **{
        f"{body}_{side[0]}": (f"{node}_{side}", f"{node}_{side}")
        for side in ("right", "left")
        for body, node in (
            ("femur", "hip"), ("tibia", "knee"), ("talus", "ankle"), ("toes", "foot"),
            ("humerus", "shoulder"), ("ulna", "elbow"), ("hand", "wrist"),
        )
    },
}  # fmt: skip


def tracks(shown: RigidWalk) -> dict[str, tuple[Array, Array]]:
    """Body -> rotations (T, 3), angles about its own X, Y, Z, and translations (T, 3) metres."""
    world = forward_kinematics(shown.skeleton, np.zeros((*shown.rotations.shape[:2], 3)), shown.rotations)[1]
    found = {}
    for body, (origin, node) in BODIES.items():
        turn = multiply(multiply(FILE_FROM_WORLD, world[:, NODE_INDEX[node]]), conjugate(FILE_FROM_WORLD))
        place = rotate(FILE_FROM_WORLD, shown.joints[:, NODE_INDEX[origin]])
        found[body] = Rotation.from_quat(turn).as_euler("XYZ"), place
    return found


def files(frames: int = 90) -> dict[str, bytes]:
    """One object."""
    shown = rigid_walk(frames, RATE)
    bodies = {
        name: {
            "attachedGeometries": [f"{name}.vtp"],
            "scaleFactors": [1.0, 1.0, 1.0],
            "rotation": rotation.round(9).tolist(),
            "translation": place.round(9).tolist(),
        }
        for name, (rotation, place) in tracks(shown).items()
    }
    content = {"time": shown.times.round(6).tolist(), "bodies": bodies}
    return {"walk.json": json.dumps(content, indent=1).encode()}

"""An archive of a simulated humanoid's bodies on the known walk, in the names and arrays of Isaac Lab."""

from __future__ import annotations

import io

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from samples.motion import in_sight, walk

RATE = 60.0
BODIES: dict[str, str] = {
    "pelvis": "hip_center", "torso": "spine", "head": "head",
    **{
        f"{side}_{body}": f"{node}_{side}"
        for side in ("right", "left")
        for body, node in (
            ("upper_arm", "shoulder"), ("lower_arm", "elbow"), ("hand", "wrist"),
            ("thigh", "hip"), ("shin", "knee"), ("foot", "ankle"),
        )
    },
}  # fmt: skip


def files(frames: int = 90) -> dict[str, bytes]:
    """walk.npz: metres, Z up; velocities and rotations of the same shapes are zeros."""
    joints = in_sight(walk(frames, RATE)).joints[:, [NODE_INDEX[node] for node in BODIES.values()]]
    buffer = io.BytesIO()
    np.savez(
        buffer,
        fps=np.array(RATE),
        dof_names=np.array(["abdomen_x", "abdomen_y", "abdomen_z"]),
        body_names=np.array(list(BODIES)),
        body_positions=joints.astype(np.float32),
        body_rotations=np.zeros((*joints.shape[:2], 4), np.float32),
        body_linear_velocities=np.zeros(joints.shape, np.float32),
        body_angular_velocities=np.zeros(joints.shape, np.float32),
    )
    return {"walk.npz": buffer.getvalue()}

"""The 32 joints of the Azure Kinect's body tracking, in the order of its SDK (k4abt_joint_id_t).

Names and parents: "Azure Kinect body tracking joints", learn.microsoft.com, Azure Kinect DK documentation. A
joint's position and orientation are absolute in the depth camera's axes (X to the camera's right, Y down, Z
forward, right-handed), in millimetres and unit quaternions. A joint's own frame is NOT a Kinect v2's:
according to the figure there, X, not +Y, lies along the limb, and the frames of the left and right side are
mirrored, so that the same angle moves both sides symmetrically.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.kinematics.rotations import from_matrix
from kinemimic.pipeline.kinematics.skeleton import INFERRED, TRACKED, Skeleton

_ARM: tuple[tuple[str, str], ...] = (
    ("CLAVICLE_{}", "SPINE_CHEST"),
    ("SHOULDER_{}", "CLAVICLE_{}"),
    ("ELBOW_{}", "SHOULDER_{}"),
    ("WRIST_{}", "ELBOW_{}"),
    ("HAND_{}", "WRIST_{}"),
    ("HANDTIP_{}", "HAND_{}"),
    ("THUMB_{}", "WRIST_{}"),
)
_LEG: tuple[tuple[str, str], ...] = (
    ("HIP_{}", "PELVIS"),
    ("KNEE_{}", "HIP_{}"),
    ("ANKLE_{}", "KNEE_{}"),
    ("FOOT_{}", "ANKLE_{}"),
)
_FACE: tuple[str, ...] = ("NOSE", "EYE_LEFT", "EAR_LEFT", "EYE_RIGHT", "EAR_RIGHT")
# Joint and its parent.
_TREE: tuple[tuple[str, str], ...] = (
    ("PELVIS", ""),
    ("SPINE_NAVEL", "PELVIS"),
    ("SPINE_CHEST", "SPINE_NAVEL"),
    ("NECK", "SPINE_CHEST"),
    *(
        (joint.format(side), parent.format(side))
        for limb in (_ARM, _LEG)
        for side in ("LEFT", "RIGHT")
        for joint, parent in limb
    ),
    ("HEAD", "NECK"),
    *((joint, "HEAD") for joint in _FACE),
)
AZURE_JOINTS: tuple[str, ...] = tuple(name for name, _ in _TREE)
# State for each confidence of the SDK (the index): 0 out of range, 1 predicted, 2 seen (3 is reserved).
STATE_OF_CONFIDENCE = np.array([0, INFERRED, TRACKED, TRACKED], dtype=np.uint8)
# Spelling in the first versions of the SDK and, to this day, on Microsoft's page.
OLD_NAMES: dict[str, str] = {"SPINE_NAVAL": "SPINE_NAVEL"}
# The camera's axes in ours, as for a Kinect v2: away from the camera is our X, the camera's right our -Y.
WORLD_FROM_CAMERA: NDArray[np.float64] = from_matrix(
    np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
)


def azure_skeleton() -> Skeleton:
    """The 32 joints of AZURE_JOINTS; rest offsets are unknown (zeros)."""
    parents = tuple(AZURE_JOINTS.index(parent) if parent else -1 for _, parent in _TREE)
    return Skeleton(AZURE_JOINTS, parents, np.zeros((len(AZURE_JOINTS), 3)))

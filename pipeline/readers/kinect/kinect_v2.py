"""The 25 joints of a Kinect v2, in the order of its SDK's JointType, in which v2 recorders write them."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import Skeleton

# Joint and its parent.
_TREE: tuple[tuple[str, str], ...] = (
    ("SpineBase", ""),
    ("SpineMid", "SpineBase"),
    ("Neck", "SpineShoulder"),
    ("Head", "Neck"),
    ("ShoulderLeft", "SpineShoulder"),
    ("ElbowLeft", "ShoulderLeft"),
    ("WristLeft", "ElbowLeft"),
    ("HandLeft", "WristLeft"),
    ("ShoulderRight", "SpineShoulder"),
    ("ElbowRight", "ShoulderRight"),
    ("WristRight", "ElbowRight"),
    ("HandRight", "WristRight"),
    ("HipLeft", "SpineBase"),
    ("KneeLeft", "HipLeft"),
    ("AnkleLeft", "KneeLeft"),
    ("FootLeft", "AnkleLeft"),
    ("HipRight", "SpineBase"),
    ("KneeRight", "HipRight"),
    ("AnkleRight", "KneeRight"),
    ("FootRight", "AnkleRight"),
    ("SpineShoulder", "SpineMid"),
    ("HandTipLeft", "HandLeft"),
    ("ThumbLeft", "HandLeft"),
    ("HandTipRight", "HandRight"),
    ("ThumbRight", "HandRight"),
)
# In the order of the files.
SDK_JOINTS: tuple[str, ...] = tuple(name for name, _ in _TREE)
SDK_PARENTS: tuple[str, ...] = tuple(parent for _, parent in _TREE)
# In the order of our skeletons, parents first: SpineShoulder, the 21st joint of a file, moves behind
# SpineMid.
KINECT_V2_JOINTS: tuple[str, ...] = ("SpineBase", "SpineMid", "SpineShoulder", *(
    name for name in SDK_JOINTS if name not in ("SpineBase", "SpineMid", "SpineShoulder")
))  # fmt: skip
# positions_in_our_order = positions_of_the_file[:, FROM_SDK]
FROM_SDK: tuple[int, ...] = tuple(SDK_JOINTS.index(name) for name in KINECT_V2_JOINTS)


def kinect_v2_skeleton() -> Skeleton:
    """The 25 joints of KINECT_V2_JOINTS; rest offsets are unknown (zeros)."""
    parents = tuple(
        KINECT_V2_JOINTS.index(parent) if (parent := SDK_PARENTS[SDK_JOINTS.index(name)]) else -1
        for name in KINECT_V2_JOINTS
    )
    return Skeleton(KINECT_V2_JOINTS, parents, np.zeros((len(KINECT_V2_JOINTS), 3)))

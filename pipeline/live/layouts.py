"""The joint sets of live senders, told apart by their number of joints.

20: a Kinect v1's, our nodes; 25: a Kinect v2's; 32: the Azure Kinect's; 33: MediaPipe's pose landmarks.
"""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS

# "Pose landmark detection guide", ai.google.dev/edge/mediapipe: the landmarks in the order of their numbers.
LANDMARKS: tuple[str, ...] = (
    "nose",
    *(f"{side}_eye_{part}" for side in ("left", "right") for part in ("inner", "middle", "outer")),
    *(
        f"{side}_{part}"
        for part in (
            "ear",
            "mouth",
            "shoulder",
            "elbow",
            "wrist",
            "pinky",
            "index",
            "thumb",
            "hip",
            "knee",
            "ankle",
            "heel",
            "foot_index",
        )
        for side in ("left", "right")
    ),
)
# Nodes that the names of the landmarks do not give.
_BY_LANDMARK = {
    "head": "nose",
    **{f"hand_{side}": f"{side}_index" for side in ("left", "right")},
    **{f"foot_{side}": f"{side}_foot_index" for side in ("left", "right")},
}


@dataclass(frozen=True)
class Layout:
    """A joint set. nodes: the joint of every node that it shows; the others are derived."""

    name: str
    joints: tuple[str, ...]
    nodes: dict[str, int]


def _layout(name: str, joints: tuple[str, ...], also: dict[str, str] | None = None) -> Layout:
    nodes = joints_by_name(joints) | {node: joints.index(joint) for node, joint in (also or {}).items()}
    return Layout(name, joints, nodes)


_LAYOUTS = (
    Layout("Kinect v1", NODES, {node: k for k, node in enumerate(NODES)}),
    _layout("Kinect v2", SDK_JOINTS),
    _layout("Azure Kinect", AZURE_JOINTS),
    _layout("MediaPipe", LANDMARKS, _BY_LANDMARK),
)
LAYOUTS: dict[int, Layout] = {len(layout.joints): layout for layout in _LAYOUTS}

"""The 20-node skeleton (the Kinect v1 set of the paper's Fig. 4) and skeletons in general."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array

# Order of the Kinect v1 SDK (NUI_SKELETON_POSITION_INDEX).
NODES: tuple[str, ...] = (
    "hip_center",
    "spine",
    "shoulder_center",
    "head",
    "shoulder_left",
    "elbow_left",
    "wrist_left",
    "hand_left",
    "shoulder_right",
    "elbow_right",
    "wrist_right",
    "hand_right",
    "hip_left",
    "knee_left",
    "ankle_left",
    "foot_left",
    "hip_right",
    "knee_right",
    "ankle_right",
    "foot_right",
)
NODE_INDEX: dict[str, int] = {name: index for index, name in enumerate(NODES)}
# Left comes first in every array with one entry per side, such as the contacts of the feet.
SIDES: tuple[str, str] = ("left", "right")

# Skeletal layers of Fig. 4; the JSON is grouped by them.
LAYERS: dict[str, tuple[str, ...]] = {
    "torso": ("shoulder_center", "spine", "hip_center"),
    "head": ("head",),
    "arm_left": ("shoulder_left", "elbow_left", "wrist_left", "hand_left"),
    "arm_right": ("shoulder_right", "elbow_right", "wrist_right", "hand_right"),
    "leg_left": ("hip_left", "knee_left", "ankle_left", "foot_left"),
    "leg_right": ("hip_right", "knee_right", "ankle_right", "foot_right"),
}

# A node's rotation is that of the segment below it. The neck turns at shoulder_center and must not carry
# the arms along, so both shoulders hang from the spine node (whose segment is the torso).
NODE_PARENTS: tuple[int, ...] = (-1, 0, 1, 2, 1, 4, 5, 6, 1, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18)

# The bones of Fig. 4, for drawing.
BONES: tuple[tuple[str, str], ...] = (
    ("hip_center", "spine"),
    ("spine", "shoulder_center"),
    ("shoulder_center", "head"),
    *(
        (a.format(side), b.format(side))
        for side in SIDES
        for a, b in (
            ("shoulder_center", "shoulder_{}"),
            ("shoulder_{}", "elbow_{}"),
            ("elbow_{}", "wrist_{}"),
            ("wrist_{}", "hand_{}"),
            ("hip_center", "hip_{}"),
            ("hip_{}", "knee_{}"),
            ("knee_{}", "ankle_{}"),
            ("ankle_{}", "foot_{}"),
        )
    ),
)

# States of a joint in a frame.
MISSING, INFERRED, TRACKED = 0, 1, 2


@dataclass(frozen=True)
class Skeleton:
    """A tree of named joints.

    names: (J,) unique; parents: (J,) index of the parent, -1 for the root, every parent before its children;
    offsets: (J, 3) rest position in the parent's frame, metres.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            raise ValueError("joint names must be unique")
        if len(self.parents) != len(self.names) or self.offsets.shape != (len(self.names), 3):
            raise ValueError("names, parents and offsets must have one row per joint")
        if any(parent >= index for index, parent in enumerate(self.parents)):
            raise ValueError("every parent must come before its children")

    def index(self, name: str) -> int:
        """Index of a joint; the KeyError of an unknown one lists the joints."""
        try:
            return self.names.index(name)
        except ValueError:
            raise KeyError(f"no joint {name!r}; there are {', '.join(self.names)}") from None


def node_skeleton(offsets: Array | None = None) -> Skeleton:
    """The 20-node skeleton, with rest offsets (20, 3) in metres if known."""
    return Skeleton(NODES, NODE_PARENTS, np.zeros((len(NODES), 3)) if offsets is None else offsets)

"""The known walk as AMASS stores it: SMPL+H's joints, axis-angle, at 120 Hz."""

from __future__ import annotations

import io

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.orientation.trunk import swing
from kinemimic.pipeline.kinematics.rotations import (
    Y_UP_TO_Z_UP,
    conjugate,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES
from kinemimic.pipeline.readers.segments.smpl_clip import JOINTS, STATURES, smpl_skeleton
from samples.motion import RigidWalk, rigid_walk

RATE = 120.0
# Joint -> the node whose segment it turns, and that segment's end as a joint and as a node.
_SEGMENTS: dict[str, tuple[str, str, str]] = {
    "pelvis": ("hip_center", "", ""),
    **dict.fromkeys(("spine1", "spine2", "spine3", "left_collar", "right_collar"), ("spine", "", "")),
    "neck": ("shoulder_center", "head", "head"),
    "head": ("shoulder_center", "", ""),
    **{
        f"{side}_{joint}": (f"{joint}_{side}", f"{side}_{end}" if end else "", f"{end}_{side}" if end else "")
        for side in ("left", "right")
        for joint, end in (
            ("hip", "knee"), ("knee", "ankle"), ("ankle", "foot"), ("shoulder", "elbow"), ("elbow", "wrist"),
            ("wrist", ""),
        )
    },
    **{f"{side}_foot": (f"ankle_{side}", "", "") for side in ("left", "right")},
}  # fmt: skip


def poses(shown: RigidWalk) -> Array:
    """Axis-angle (T, 22, 3): every bone of a limb points as the walk's does."""
    rest = smpl_skeleton(STATURES["male"])
    world = forward_kinematics(shown.skeleton, np.zeros((*shown.rotations.shape[:2], 3)), shown.rotations)[1]
    turned = np.empty((len(world), len(JOINTS), 4))
    for number, joint in enumerate(JOINTS):
        node, end, end_node = _SEGMENTS[joint]
        # From the rest pose's axes (X left, Y up, Z forward) to ours, then from its bone to the walk's.
        own = Y_UP_TO_Z_UP
        if end:
            bone = rotate(Y_UP_TO_Z_UP, rest.offsets[JOINTS.index(end)])
            offset = shown.skeleton.offsets[NODE_INDEX[end_node]]
            own = multiply(
                swing(bone / np.linalg.norm(bone), (offset / np.linalg.norm(offset))[None], np.pi)[0], own
            )
        turned[:, number] = multiply(world[:, NODE_INDEX[node]], own)
    local = turned.copy()
    for number, parent in enumerate(rest.parents):
        if parent >= 0:
            local[:, number] = multiply(conjugate(turned[:, parent]), turned[:, number])
    return to_rotvec(local)


def arrays(frames: int = 90) -> dict[str, Array]:
    """What AMASS's files hold, without the markers."""
    shown = rigid_walk(frames, RATE)
    assert shown.skeleton.names == NODES
    assert shown.skeleton.parents == NODE_PARENTS
    whole = np.zeros((frames, 156))
    whole[:, : 3 * len(JOINTS)] = poses(shown).reshape(frames, -1)
    return {
        "poses": whole,
        "trans": shown.root,
        "gender": np.array("male"),
        "mocap_framerate": np.array(RATE),
        "betas": np.zeros(16),
        "dmpls": np.zeros((frames, 8)),
    }


def packed(content: dict[str, Array]) -> bytes:
    """The archive."""
    stream = io.BytesIO()
    np.savez(stream, **content)  # type: ignore[arg-type]
    return stream.getvalue()


def files(frames: int = 90) -> dict[str, bytes]:
    """One archive."""
    return {"walk_poses.npz": packed(arrays(frames))}

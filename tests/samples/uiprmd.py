"""UI-PRMD's Kinect files: local offsets in cm and local Euler angles in degrees, from the known walk."""

from __future__ import annotations

import gzip

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.public_datasets.uiprmd import PARENTS, UIPRMD_JOINTS
from samples.motion import Walk, in_sight, walk, y_up

_NODES = {
    "Waist": "hip_center",
    "Spine": "spine",
    "Chest": "shoulder_center",
    "HeadTip": "head",
    **{
        f"{side[0].upper()}{word}": f"{joint}_{side}"
        for side in ("left", "right")
        for word, joint in (
            ("UpperArm", "shoulder"),
            ("Forearm", "elbow"),
            ("Hand", "wrist"),
            ("UpperLeg", "hip"),
            ("LowerLeg", "knee"),
            ("Foot", "ankle"),
            ("Toes", "foot"),
        )
    },
}
# The bone that a joint's frame lies along: its own axis, and the joint at the other end.
_ALONG = {
    **{f"{side}{joint}": ("-Y", f"{side}{end}") for side in "LR"
       for joint, end in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"))},
    **{f"{side}Foot": ("+Z", f"{side}Toes") for side in "LR"},
    **{f"{side}{joint}": (axis, f"{side}{end}") for side, axis in (("L", "+X"), ("R", "-X"))
       for joint, end in (("UpperArm", "Forearm"), ("Forearm", "Hand"))},
    "Spine": ("+Y", "Chest"),
    "Waist": ("+Y", "Spine"),
}  # fmt: skip


def joints(walk: Walk) -> Array:
    """World positions (T, 22, 3), metres, Y up, of the joints in the file's sequence."""
    points = {name: y_up(walk.joints[:, NODE_INDEX[node]]) for name, node in _NODES.items()}
    points["Neck"] = points["Chest"]
    points["Head"] = 0.7 * points["Chest"] + 0.3 * points["HeadTip"]
    for side in "LR":
        points[f"{side}Collar"] = 0.9 * points["Chest"] + 0.1 * points[f"{side}UpperArm"]
    return np.stack([points[name] for name in UIPRMD_JOINTS], axis=1)


def frames_of(world: Array) -> list[Rotation]:
    """World frames of the joints whose bones define one; others stand as their parents do."""
    frames: list[Rotation] = []
    lateral = world[:, UIPRMD_JOINTS.index("LUpperLeg")] - world[:, UIPRMD_JOINTS.index("RUpperLeg")]
    for joint, name in enumerate(UIPRMD_JOINTS):
        if name not in _ALONG:
            frames.append(frames[PARENTS[joint]])
            continue
        sign, end = _ALONG[name]
        bone = (1.0 if sign[0] == "+" else -1.0) * (world[:, UIPRMD_JOINTS.index(end)] - world[:, joint])
        bone /= np.linalg.norm(bone, axis=-1, keepdims=True)
        k = "XYZ".index(sign[1])
        other = lateral if k else np.broadcast_to([0.0, 0.0, 1.0], bone.shape)
        second = other - np.sum(other * bone, axis=-1, keepdims=True) * bone
        second /= np.linalg.norm(second, axis=-1, keepdims=True)
        axes = np.empty((len(bone), 3, 3))
        m = 0 if k else 2
        axes[..., k], axes[..., m] = bone, second
        n = 3 - k - m
        axes[..., n] = np.cross(axes[..., (n + 1) % 3], axes[..., (n + 2) % 3])
        frames.append(Rotation.from_matrix(axes))
    return frames


def channels(walk: Walk) -> tuple[Array, Array]:
    """Local offsets (T, 22, 3) in cm and local angles (T, 22, 3) in degrees, x y z, of R = Rz Rx Ry."""
    world = joints(walk)
    frames = frames_of(world)
    offsets, angles = np.empty_like(world), np.empty_like(world)
    for joint, parent in enumerate(PARENTS):
        local = frames[joint] if parent < 0 else frames[parent].inv() * frames[joint]
        z, x, y = local.as_euler("ZXY", degrees=True).T
        angles[:, joint] = np.stack([x, y, z], axis=-1)
        apart = (
            world[:, joint] if parent < 0 else frames[parent].inv().apply(world[:, joint] - world[:, parent])
        )
        offsets[:, joint] = 100.0 * apart
    return offsets, angles


def files(frames: int = 90) -> dict[str, bytes]:
    """Positions, and the angles beside them, packed as published."""
    offsets, angles = channels(in_sight(walk(frames, 30.0)))
    return {
        f"kinect_m01_s01_e01_{word}.txt.gz": gzip.compress(
            "".join(",".join(f"{x:.6f}" for x in row.ravel()) + "\n" for row in values).encode(), mtime=0
        )
        for word, values in (("positions", offsets), ("angles", angles))
    }

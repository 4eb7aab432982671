"""The known walk as a joint array, in the order and axes of any joint set."""

from __future__ import annotations

import io

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.landmarks.joint_sets import SETS, JointSet
from samples.motion import Walk, walk


def joints(shown: Walk, joint_set: JointSet) -> Array:
    """(T, J, 3) metres in the set's usual axes; joints that are no node's are at the head."""
    head = shown.joints[:, [NODE_INDEX["head"]]]
    points = np.repeat(head, len(joint_set.joints), axis=1)
    for node, numbers in joint_set.nodes.items():
        points[:, numbers] = shown.joints[:, [NODE_INDEX[node]]]
    return rotate(conjugate(joint_set.world_from_file), points)


def saved(array: object) -> bytes:
    """As an .npy file."""
    buffer = io.BytesIO()
    np.save(buffer, array)  # type: ignore[arg-type]
    return buffer.getvalue()


def archive(**arrays: object) -> bytes:
    """As an .npz file."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def files(frames: int = 90) -> dict[str, bytes]:
    """17 joints about the pelvis, in single precision, as networks give them."""
    points = joints(walk(frames), SETS[0])
    return {"joints.npy": saved((points - points[:, :1]).astype(np.float32))}

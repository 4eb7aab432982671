"""Weigh the joints of the limbs by the lengths of their bones: where a length changes, a joint is off.

A tracker that loses a limb for some frames puts a knee or an elbow elsewhere along it or beside it, and the
bones at that joint become shorter or longer. White noise changes them too, so the weight falls gradually with
the deviation. The trunk is fitted as a whole: weights that differ between its joints would turn it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import Skeleton

# The nodes that are weighed, each by the bone that ends there and the one that begins there.
LIMBS: tuple[str, ...] = ("elbow", "wrist", "knee", "ankle")
# Deviations of a bone's length, relative to it, that are noise: in Kinect v1 walks their scatter is 0.06 to
# 0.12 (quality/rules/limb_lengths.py).
TOLERANCE = 0.05


@dataclass(frozen=True)
class BoneWeights:
    """Weights (T, J) from 0 to 1 per joint.

    bones: of the bone that ends at the joint; rotations: of the joint's own rotation, the least of the bones
    that it turns; positions: of the joint's position, the least of its bones, 1 at the trunk.
    """

    bones: Array
    rotations: Array
    positions: Array


def bone_weights(positions: Array, skeleton: Skeleton, passes: NDArray[np.int32]) -> BoneWeights:
    """The weights of positions (T, J, 3) in metres.

    For a length that deviates from the bone's median over all passes by d, relative to it, the weight is that
    of the pseudo-Huber loss, 1 / sqrt(1 + (d / TOLERANCE)^2); it is 1 where an end is missing.
    """
    nodes = joints_by_name(skeleton.names)
    limbs = [
        joint for node, joint in nodes.items() if node.startswith(LIMBS) and skeleton.parents[joint] >= 0
    ]
    bones, rotations = np.ones(positions.shape[:2]), np.ones(positions.shape[:2])
    for joint in limbs:
        parent = skeleton.parents[joint]
        length = np.linalg.norm(positions[:, joint] - positions[:, parent], axis=-1)
        seen = np.isfinite(length) & (passes >= 0)
        usual = float(np.median(length[seen])) if seen.any() else 0.0
        if usual > 0.0:
            bones[seen, joint] = 1.0 / np.hypot(1.0, (length[seen] / usual - 1.0) / TOLERANCE)
            rotations[:, parent] = np.minimum(rotations[:, parent], bones[:, joint])
    whole = bones.copy()
    whole[:, limbs] = np.minimum(bones[:, limbs], rotations[:, limbs])
    return BoneWeights(bones, rotations, whole)

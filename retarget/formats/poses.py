"""Motions as poses for the writers of animation formats, and captured poses as motions."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.pipeline.writers.poses import Poses
from kinemimic.retarget.humanoid.motion import Motion


def poses_of_motion(motion: Motion, *, closed: bool = False) -> Poses:
    """The poses of a motion; closed: repeat a cycle's first frame at its end, displaced by a cycle."""
    root, rotations = motion.root, motion.rotations
    if closed and motion.cyclic:
        root = np.concatenate([root, root[:1] + motion.cycle_offset])
        rotations = np.concatenate([rotations, rotations[:1]])
    return Poses.rigid(node_skeleton(motion.offsets), motion.rate, root, rotations)


def motion_of_poses(poses: Poses) -> Motion:
    """Poses of the 20 nodes as a non-cyclic motion with their median bone lengths.

    No foot is in contact; the root stays where it was captured.
    """
    return Motion(
        rate=poses.rate,
        root=poses.translations[:, 0],
        rotations=poses.rotations,
        contacts=np.zeros((len(poses.rotations), 2), dtype=np.bool_),
        cyclic=False,
        offsets=poses.skeleton.offsets,
        provenance=poses.provenance,
    )

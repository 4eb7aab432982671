"""Motions as poses, which the writers of animation formats take, and captured poses as motions."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.pipeline.writers.poses import Poses
from kinemimic.retarget.humanoid.motion import Motion


def poses_of_motion(motion: Motion, *, closed: bool = False) -> Poses:
    """A motion's frames; closed: a cycle's first frame comes once more at its end, moved on by a cycle."""
    root, rotations = motion.root, motion.rotations
    if closed and motion.cyclic:
        root = np.concatenate([root, root[:1] + motion.cycle_offset])
        rotations = np.concatenate([rotations, rotations[:1]])
    return Poses.rigid(node_skeleton(motion.offsets), motion.rate, root, rotations)


def motion_of_poses(poses: Poses) -> Motion:
    """Poses of the 20 nodes as a motion that is no cycle, its bones as long as they mostly were.

    Nothing is said of contacts: no foot counts as planted. The root stays where it was captured.
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

"""Convert the joint orientations of a sensor's SDK, in camera axes, to rotations from child to parent.

A Kinect v2 gives each joint a frame in camera space whose +Y axis runs along the bone that ENDS at the joint;
an Azure Kinect uses other frames (kinect/azure_joints.py). The difference does not matter here: the rotations
stay between the sensor's own frames, and multiplying them down the tree gives the orientations back.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, continuous, multiply
from kinemimic.pipeline.kinematics.skeleton import Skeleton


def child_to_parent(absolute: Array, skeleton: Skeleton, world_from_file: Array) -> Array:
    """Sign-continuous rotations (T, J, 4) as in Clip: q_parent* q_j for joint j, w q_root for the root.

    absolute: (T, J, 4) quaternions (x, y, z, w) from a joint's frame to the file's axes, in the order of the
    skeleton's joints; zeros or NaN where the sensor gave none. world_from_file: (4,) rotation from the file's
    axes to ours. The result is NaN where the joint or its parent has no orientation, so always at a Kinect
    v2's leaves (head, feet, thumbs, hand tips), for which its SDK writes zeros.
    """
    squared = np.einsum("...i,...i->...", absolute, absolute)
    length = np.sqrt(np.where(np.isfinite(squared) & (squared > 0.0), squared, np.nan))
    unit = absolute / length[..., None]
    parents = np.array(skeleton.parents)
    # A root's parent is the world: in the file's axes its orientation is the inverse of world_from_file.
    parent_orientation = unit[:, parents]
    parent_orientation[:, parents < 0] = conjugate(world_from_file)
    return continuous(multiply(conjugate(parent_orientation), unit))

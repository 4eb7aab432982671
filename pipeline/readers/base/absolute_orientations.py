"""Joint orientations that a sensor's SDK gives in its camera's axes, as rotations from child to parent.

A Kinect v2 gives each joint a frame of its own in camera space whose +Y axis runs along the bone that ENDS at
the joint; an Azure Kinect has other frames (captures/azure_joints.py). Which it is does not matter here: the
rotations stay between the sensor's own frames, and multiplied down the tree give the orientations back.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, continuous, multiply
from kinemimic.pipeline.kinematics.skeleton import Skeleton


def child_to_parent(absolute: Array, skeleton: Skeleton, world_from_file: Array) -> Array:
    """Rotations (T, J, 4) as Clip has them: joint j's q_parent* q_j, the root's w q_root; sign-continuous.

    absolute: (T, J, 4) quaternions (x, y, z, w) from a joint's frame to the file's axes, in the skeleton's
    sequence; zeros or NaN where the sensor gave none. world_from_file: (4,) the file's axes in ours.
    NaN where the joint or its parent has none, so always at a Kinect v2's leaves (head, feet, thumbs, hand
    tips), whose orientations its SDK leaves at zero.
    """
    squared = np.einsum("...i,...i->...", absolute, absolute)
    length = np.sqrt(np.where(np.isfinite(squared) & (squared > 0.0), squared, np.nan))
    unit = absolute / length[..., None]
    parents = np.array(skeleton.parents)
    # A root's parent is the world, whose axes in the file's are the inverse of world_from_file.
    above = unit[:, parents]
    above[:, parents < 0] = conjugate(world_from_file)
    return continuous(multiply(conjugate(above), unit))

"""Joints of HumanML3D's and KIT-ML's vectors, which text-to-motion networks are trained on and give.

Guo et al. 2022, "Generating diverse and natural 3D human motions from text" (CVPR). The 12 J - 1 numbers of a
frame with J joints are: half the pelvis' turn about +Y to the next frame, its velocity along X and Z per
frame, its height, the other joints' places, and rotations, velocities and contacts, which repeat what is
before. Velocity and places are in axes that turn with the pelvis, X and Z from below it.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_rotvec, rotate

JOINTS: dict[int, int] = {12 * joints - 1: joints for joints in (22, 21)}  # by the width of a vector
_TURN, _VELOCITY, _HEIGHT, _PLACES = 0, slice(1, 3), 3, 4
_UP = np.array([0.0, 1.0, 0.0])


def joints_of(vectors: Array) -> Array:
    """(T, J, 3) positions, Y up, of vectors (T, 12 J - 1), not normalised; the pelvis begins above the
    origin."""
    others_count = JOINTS[vectors.shape[1]] - 1
    turned = np.concatenate([[0.0], 2.0 * np.cumsum(vectors[:-1, _TURN])])
    to_world = from_rotvec(-turned[:, None] * _UP)
    steps = np.zeros((len(vectors), 3))
    steps[1:, [0, 2]] = vectors[:-1, _VELOCITY]
    pelvis = np.cumsum(rotate(to_world, steps), axis=0)
    places = vectors[:, _PLACES : _PLACES + 3 * others_count].reshape(len(vectors), others_count, 3)
    others = rotate(to_world[:, None], places)
    joints: Array = np.concatenate([np.zeros((len(vectors), 1, 3)), others], axis=1)
    joints += pelvis[:, None]
    joints[:, 0, 1] = vectors[:, _HEIGHT]
    return joints

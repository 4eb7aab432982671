"""Joints of HumanML3D's vectors, which networks that turn text into motion are trained on and give.

Guo et al. 2022, "Generating diverse and natural 3D human motions from text" (CVPR). A frame's 263 numbers
are: half the pelvis' turn about +Y to the next frame, its velocity along X and Z per frame, its height, the
21 other joints' places, and rotations, velocities and contacts, which repeat what is before. Velocity and
places are in axes that turn with the pelvis, X and Z from below it.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_rotvec, rotate

WIDTH = 263
JOINTS = 22
_TURN, _VELOCITY, _HEIGHT, _PLACES = 0, slice(1, 3), 3, slice(4, 4 + 3 * (JOINTS - 1))
_UP = np.array([0.0, 1.0, 0.0])


def joints_of(vectors: Array) -> Array:
    """(T, 22, 3) positions, Y up, of vectors (T, 263) in metres, not normalised; the pelvis begins above the
    origin."""
    turned = np.concatenate([[0.0], 2.0 * np.cumsum(vectors[:-1, _TURN])])
    to_world = from_rotvec(-turned[:, None] * _UP)
    steps = np.zeros((len(vectors), 3))
    steps[1:, [0, 2]] = vectors[:-1, _VELOCITY]
    pelvis = np.cumsum(rotate(to_world, steps), axis=0)
    others = rotate(to_world[:, None], vectors[:, _PLACES].reshape(len(vectors), JOINTS - 1, 3))
    joints: Array = np.concatenate([np.zeros((len(vectors), 1, 3)), others], axis=1)
    joints += pelvis[:, None]
    joints[:, 0, 1] = vectors[:, _HEIGHT]
    return joints

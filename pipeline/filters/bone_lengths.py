"""Weigh measurements by the lengths of bones, which do not change: where one does, a joint is off.

A tracker that loses a limb for some frames puts a joint elsewhere along or beside it, and the bones at that
joint become shorter or longer. White noise changes them too, so a deviation lowers the weight gradually.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

# Deviations of a bone's length, relative to it, that are noise: in Kinect v1 walks their scatter is 0.06 to
# 0.12 (quality/rules/limb_lengths.py).
TOLERANCE = 0.05
# Metres. Of a shorter bone, noise changes the length more than a lost joint does.
SHORTEST = 0.20


def bone_weights(positions: Array, parents: Sequence[int], passes: NDArray[np.int32]) -> Array:
    """Weights (T, J) from 0 to 1 of the bone that ends at each joint.

    positions: (T, J, 3) metres. The weights are those of the pseudo-Huber loss, 1 / sqrt(1 + (d / TOLERANCE)^2)
    for a deviation d from the median length over all passes, relative to it. The weight is 1 at the root, where an end is missing, and for bones that are never seen or shorter than SHORTEST.
    """
    weights = np.ones(positions.shape[:2])
    for joint, parent in enumerate(parents):
        if parent < 0:
            continue
        length = np.linalg.norm(positions[:, joint] - positions[:, parent], axis=-1)
        seen = np.isfinite(length) & (passes >= 0)
        usual = float(np.median(length[seen])) if seen.any() else 0.0
        if usual >= SHORTEST:
            deviation = (length[seen] / usual - 1.0) / TOLERANCE
            weights[seen, joint] = 1.0 / np.sqrt(1.0 + deviation**2)
    return weights


def rotation_weights(bones: Array, parents: Sequence[int]) -> Array:
    """Weights (T, J) of the joints' own rotations: the least of the bones that a joint turns, its children's.

    bones: (T, J) as from `bone_weights`.
    """
    weights = np.ones_like(bones)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            weights[:, parent] = np.minimum(weights[:, parent], bones[:, joint])
    return weights


def joint_weights(bones: Array, parents: Sequence[int]) -> Array:
    """Weights (T, J) of the joints' positions: the least of all bones that end at a joint or begin there.

    bones: (T, J) as from `bone_weights`.
    """
    return np.minimum(bones, rotation_weights(bones, parents))

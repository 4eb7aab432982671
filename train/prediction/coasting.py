"""The next poses of a person on the spot, whose motion no network knows: it comes to rest.

Exercises do not repeat as strides do. Half a second ahead, the newest pose is nearer to what they do than a
prediction learned from walks, and a velocity that decays is nearer for the first tenth of a second.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_rotvec, multiply, to_rotvec

DECAY = 0.7  # of the velocity, per frame
SPAN = 3  # frames over which the velocity is taken


def coasted(root: Array, rotations: Array, count: int) -> tuple[Array, Array]:
    """The newest frame and the `count` that follow, root (1 + count, 3) and rotations (1 + count, 20, 4).

    root, rotations: (F, 3), (F, 20, 4), the frames until now, more than SPAN.
    """
    way = np.concatenate([[0.0], np.cumsum(DECAY ** np.arange(1.0, 1.0 + count))])
    velocity = (root[-1] - root[-1 - SPAN]) / SPAN
    turn = to_rotvec(multiply(conjugate(rotations[-1 - SPAN]), rotations[-1])) / SPAN
    turned = multiply(rotations[-1], from_rotvec(way[:, None, None] * turn))
    return root[-1] + way[:, None] * velocity, turned

"""Is this table of bare numbers a body? What tells a headerless file of joints from any other table."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

# Within these, height of trunk over height of leg, and of thigh over shank: sitting is allowed, lying is not.
_TRUNK, _THIGH = (0.3, 3.0), (0.2, 4.0)


def upright(points: Array) -> bool:
    """True if most frames stand or sit upright: head, neck, hips, knees and ankles one below the other.

    points: (T, 20, 3) in the sequence of the nodes, in any unit, the second axis upward or (a picture's)
    downward.
    """
    if not len(points) or not np.isfinite(points).all() or np.abs(points).max() > 1e6:
        return False
    height = points[..., 1]
    trunk_heights = [height[:, N[joint]] for joint in ("head", "shoulder_center", "hip_center")]
    leg_heights = [
        0.5 * (height[:, N[f"{joint}_left"]] + height[:, N[f"{joint}_right"]]) for joint in ("knee", "ankle")
    ]
    column = np.stack(trunk_heights + leg_heights, axis=1)
    steps = -np.diff(column, axis=1)
    steps = steps * np.sign(np.median(steps))
    _, trunk, thigh, shank = steps.T
    one_below_the_other = (steps > 0).all(axis=1)
    trunk_of_leg, thigh_of_shank = (
        np.divide(a, b, out=np.zeros_like(a), where=one_below_the_other)
        for a, b in ((trunk, thigh + shank), (thigh, shank))
    )
    like_a_body = (trunk_of_leg > _TRUNK[0]) & (trunk_of_leg < _TRUNK[1])
    like_a_body &= (thigh_of_shank > _THIGH[0]) & (thigh_of_shank < _THIGH[1])
    # Joints of one side that lie on those of the other are no body, nor are they as far apart as it is tall.
    tall = np.abs(column[:, 0] - column[:, -1])
    for joint in ("shoulder", "hip"):
        apart = np.linalg.norm(
            points[:, N[f"{joint}_left"], :2] - points[:, N[f"{joint}_right"], :2], axis=-1
        )
        like_a_body &= apart < tall
    return float(np.mean(like_a_body)) > 0.5

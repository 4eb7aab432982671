"""Tests whether a table of bare numbers is a human body, for formats without a header."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

# Limits of trunk height over leg height, and of thigh height over shank height. Sitting passes, lying does
# not.
_TRUNK_OVER_LEG, _THIGH_OVER_SHANK = (0.3, 3.0), (0.2, 4.0)


def is_upright_body(points: Array) -> bool:
    """True if most frames stand or sit upright, with head, neck, hips, knees and ankles in descending order.

    points: (T, 20, 3) in the order of NODES, in any unit. The second axis points up, or down as in an image.
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
    descending = (steps > 0).all(axis=1)
    trunk_over_leg, thigh_over_shank = (
        np.divide(a, b, out=np.zeros_like(a), where=descending)
        for a, b in ((trunk, thigh + shank), (thigh, shank))
    )
    plausible = (trunk_over_leg > _TRUNK_OVER_LEG[0]) & (trunk_over_leg < _TRUNK_OVER_LEG[1])
    plausible &= (thigh_over_shank > _THIGH_OVER_SHANK[0]) & (thigh_over_shank < _THIGH_OVER_SHANK[1])
    # Shoulders or hips that coincide, or are as far apart as the body is tall, do not belong to a body.
    height_of_body = np.abs(column[:, 0] - column[:, -1])
    for joint in ("shoulder", "hip"):
        apart = np.linalg.norm(
            points[:, N[f"{joint}_left"], :2] - points[:, N[f"{joint}_right"], :2], axis=-1
        )
        plausible &= apart < height_of_body
    return float(np.mean(plausible)) > 0.5

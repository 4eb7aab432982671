"""Off-axis knee rotation: what is left of the shank's turn against the thigh when flexion is taken away.

A knee's rotation q is divided into a turn about its hinge axis n (flexion) and the swing of that axis:
q = swing · twist, where twist keeps the part of q's vector along n. The swing's angle, 2 atan2(|v - (v·n) n|,
√(w² + (v·n)²)), is abduction and inward rotation in one number; it is 0 for a pure hinge.

It takes rotations, or markers on both segments. Three points, hip, knee and ankle, always lie in one plane,
and that plane's normal passes for their hinge axis: they show no turn of the shank about its length, and no
sideways bend that would not look like a turn of the whole leg. From positions alone there is no such number.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, continuous, multiply, to_rotvec

LATERAL: Array = np.array([0.0, 1.0, 0.0])
# Radians that a knee must turn, as the standard deviation along its axis, before it shows one.
_SHOWN = np.radians(3.0)


def off_axis(knee: Array, axis: Array = LATERAL) -> Array:
    """Angle (T,) in radians of the swing in rotations (T, 4) about a unit axis (3,); NaN where missing.

    knee: shank to thigh, the identity in a straight leg whose axes agree, as on the 20 nodes.
    """
    along = knee[..., :3] @ axis
    across = np.linalg.norm(knee[..., :3] - along[..., None] * axis, axis=-1)
    return np.asarray(2.0 * np.arctan2(across, np.hypot(knee[..., 3], along)))


def off_axis_of_fitted_hinge(knee: Array) -> Array | None:
    """`off_axis` (T,) of a knee in axes of its own: about the hinge that fits its rotations (T, 4) best.

    The axis is the direction of largest spread of the rotation vectors about their mean, so that neither the
    file's axes nor its rest pose matter; a constant offset is not seen. None where the knee hardly moves.
    """
    seen = np.isfinite(knee).all(axis=-1)
    if seen.sum() < 4:
        return None
    q = knee[seen]
    mean = np.linalg.eigh(q.T @ q)[1][:, -1]
    turns = to_rotvec(multiply(conjugate(mean), q))
    spread, axes = np.linalg.eigh(np.cov(turns.T))
    if np.sqrt(spread[-1]) < _SHOWN:
        return None
    result = np.full(len(knee), np.nan)
    result[seen] = off_axis(multiply(conjugate(mean), continuous(q)), axes[:, -1])
    return result

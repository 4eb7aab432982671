"""Off-axis knee rotation: the rotation of the shank relative to the thigh without flexion.

A knee's rotation q is split into a twist about its hinge axis n (flexion) and the swing of that axis:
q = swing · twist, where twist keeps the part of q's vector along n. The swing's angle, 2 atan2(|v - (v·n) n|,
√(w² + (v·n)²)), combines abduction and internal rotation in one number; it is 0 for a pure hinge.

It needs rotations, or markers on both segments. Hip, knee and ankle always lie in one plane, whose normal is
taken for the hinge axis: three points show no twist of the shank, and no sideways bend that could not be a
twist of the whole leg. So it cannot be computed from positions alone.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, continuous, multiply, to_rotvec

LATERAL: Array = np.array([0.0, 1.0, 0.0])
# Smallest standard deviation (radians) about its axis from which a knee shows one.
_SHOWN = np.radians(3.0)


def off_axis(knee: Array, axis: Array = LATERAL) -> Array:
    """Angle (T,) in radians of the swing in rotations (T, 4) about a unit axis (3,); NaN where missing.

    knee: shank to thigh, the identity in a straight leg whose axes agree, as on the 20 nodes.
    """
    along = knee[..., :3] @ axis
    across = np.linalg.norm(knee[..., :3] - along[..., None] * axis, axis=-1)
    return np.asarray(2.0 * np.arctan2(across, np.hypot(knee[..., 3], along)))


def off_axis_of_fitted_hinge(knee: Array) -> Array | None:
    """`off_axis` (T,) about the hinge that fits a knee's rotations (T, 4) best; None if it hardly moves.

    The axis is the direction of largest variance of the rotation vectors about their mean, so neither the
    file's axes nor its rest pose matter; a constant offset is not detected.
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

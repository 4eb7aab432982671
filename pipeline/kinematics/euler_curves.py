"""Euler angles of a motion as curves without jumps."""

from __future__ import annotations

import warnings
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array


def principal_angles(rotations: Array, order: str) -> Array:
    """Intrinsic angles (..., 3) in radians of quaternions (..., 4), the middle one within a right angle.

    order: three different axes, as "XYZ".
    """
    with warnings.catch_warnings():
        # At exact gimbal lock scipy picks one of the equivalent triples and warns; the rotation is right.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_quat(rotations.reshape(-1, 4)).as_euler(cast(Any, order))
    return np.asarray(angles).reshape(*rotations.shape[:-1], 3)


def euler_curves(rotations: Array, order: str) -> Array:
    """Intrinsic angles (T, 3) in radians of quaternions (T, 4), without jumps from frame to frame.

    order: as in `principal_angles`. Each rotation has two triples, (a, b, c) and (a + π, π - b, c + π), apart
    from full turns. A joint that bends by more than a right angle about the middle axis would change from one
    to the other, and two angles jump by half a turn. Here the first frame has the triple that is nearer to
    zero, and every other frame the one that is nearer to the frame before.
    """
    one = principal_angles(rotations, order)
    other = _within_half_a_turn(np.stack([one[:, 0] + np.pi, np.pi - one[:, 1], one[:, 2] + np.pi], axis=-1))
    stays, changes = (_squared(later - one[:-1]) for later in (one[1:], other[1:]))
    changed = np.concatenate([_squared(other[:1]) < _squared(one[:1]), changes < stays])
    takes_other = np.cumsum(changed) % 2 == 1
    return np.unwrap(np.where(takes_other[:, None], other, one), axis=0)


def _within_half_a_turn(angles: Array) -> Array:
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def _squared(angles: Array) -> Array:
    """Sums of squares (T,) of triples of angles (T, 3), without full turns."""
    return np.asarray(np.square(_within_half_a_turn(angles)).sum(axis=-1))

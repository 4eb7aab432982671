"""Feet and ground: sole heights, planted feet, slip."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.rotations import rotate
from kinemimic.pipeline.skeleton import NODE_INDEX as N
from kinemimic.retarget.body import sole_corners

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ANKLES = (N["ankle_left"], N["ankle_right"])
NEAR = 0.025  # m above the ground at which a sole can be planted
MOVES = 0.5  # of the speed of walking: a planted foot moves slower over the ground


def soles(positions: Array, frames: Array) -> Array:
    """World positions (T, 2, 4, 3) of the sole corners, left then right, from `Motion.kinematics()`."""
    corners = sole_corners()
    return np.stack(
        [positions[:, None, a] + rotate(frames[:, None, a], corners[None]) for a in ANKLES], axis=1
    )


def corner_velocity(corners: Array, rate: float, cycle_offset: Array | None) -> Array:
    """Central differences (T, 2, 4, 3) in m/s; a cyclic motion continues moved by `cycle_offset`."""
    if cycle_offset is None:
        return np.asarray(np.gradient(corners, 1.0 / rate, axis=0))
    before = np.concatenate([corners[-1:] - cycle_offset, corners[:-1]])
    after = np.concatenate([corners[1:], corners[:1] + cycle_offset])
    return np.asarray(0.5 * rate * (after - before))


def lowest(corners: Array, values: Array) -> Array:
    """Of values (T, 2, 4, ...), those at each foot's lowest corner: (T, 2, ...)."""
    pick = corners[..., 2].argmin(axis=-1)
    t, f = np.indices(pick.shape)
    return np.asarray(values[t, f, pick])


def planted(corners: Array, velocity: Array, speed: float) -> Mask:
    """True (T, 2) where a foot's lowest corner is near the ground and hardly moves over it."""
    height = corners[..., 2].min(axis=-1)
    slide = lowest(corners, velocity)
    return np.asarray((height < NEAR) & (np.linalg.norm(slide[..., :2], axis=-1) < max(MOVES * speed, 0.2)))

"""Where up is, from balance: over a stride the centre of mass stays between the feet.

A sensor that tilts, or whose floor was not found, shows a walker who leans. Nobody leans to the side over a
whole stride without falling, so on average the centre of mass is above the feet that carry it. Forward lean
is not a tilt: runners and old people lean.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.rotations import normalize
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.path.heading import along_heading

# Shares of the body's mass, and the two nodes between whose middles each segment's centre lies (Dempster 1955
# in Winter 2009, Biomechanics and Motor Control of Human Movement, table 4.1; trunk and head in one line).
_SEGMENTS: tuple[tuple[float, str, str], ...] = (
    (0.497, "hip_center", "shoulder_center"),
    (0.081, "shoulder_center", "head"),
    *(
        (share, f"{start}_{side}", f"{end}_{side}")
        for side in SIDES
        for share, start, end in (
            (0.028, "shoulder", "elbow"),
            (0.022, "elbow", "wrist"),
            (0.100, "hip", "knee"),
            (0.047, "knee", "ankle"),
            (0.014, "ankle", "foot"),
        )
    ),
)
# Own phase, since the foot was farthest ahead, from which a foot carries the body, for half a stride.
LOADED = 0.06
MIN_WALKING = 0.9  # share of a stride's frames
# A tilt below this (radians) is within the error of the method, 0.6 degrees on optical walks and 2 on a depth
# sensor's: up stays as recorded.
MIN_TILT = np.radians(2.0)
SMOOTHING_STRIDES = 3.0  # standard deviation of the mean over strides
_RIDGE = 0.3  # strides that speak for up as recorded, where no heading shows the tilt


def center_of_mass(positions: Array) -> Array:
    """Centre of mass (T, 3) of positions (T, 20, 3): in each frame that of the segments whose nodes are seen,
    NaN without any.
    """
    total, mass = np.zeros((len(positions), 3)), np.zeros((len(positions), 1))
    for share, start, end in _SEGMENTS:
        middle = 0.5 * (positions[:, N[start]] + positions[:, N[end]])
        seen = np.isfinite(middle).all(axis=1, keepdims=True)
        total += np.where(seen, share * middle, 0.0)
        mass += np.where(seen, share, 0.0)
    return np.asarray(np.divide(total, mass, out=np.full_like(total, np.nan), where=mass > 0.0))


def upright_axis(positions: Array, heading: Array, phase: Array, walking: Mask) -> Array:
    """Up (T, 3), unit vectors in the axes of positions (T, 20, 3), slowly varying.

    heading: (T,) radians; phase: (T,) cycles, integer where the left ankle is farthest ahead; walking: (T,)
    frames of walking or running. Each stride gives the lean to the left of its heading; strides under
    different headings give both components. (0, 0, 1) where nobody walks or the tilt is within the method's
    error.
    """
    up = np.tile([0.0, 0.0, 1.0], (len(positions), 1))
    strides = np.floor(phase - LOADED).astype(np.intp)
    left_loaded = np.mod(phase - LOADED, 1.0) < 0.5
    foot = np.where(left_loaded[:, None], positions[:, N["ankle_left"]], positions[:, N["ankle_right"]])
    carried = along_heading(center_of_mass(positions) - foot, heading)
    numbers = [k for k in np.unique(strides[walking]) if walking[strides == k].mean() > MIN_WALKING]
    if not numbers:
        return up
    means = np.array([carried[strides == k].mean(axis=0) for k in numbers])
    headings = np.array([np.angle(np.mean(np.exp(1j * heading[strides == k]))) for k in numbers])
    leans = np.arctan2(means[:, 1], means[:, 2])
    tilts = _smooth_tilts(np.stack([-np.sin(headings), np.cos(headings)], axis=1), leans)
    if np.median(np.linalg.norm(tilts, axis=1)) < MIN_TILT:
        return up
    middles = [float(np.flatnonzero(strides == k).mean()) for k in numbers]
    up[:, :2] = np.stack([np.interp(np.arange(len(up)), middles, column) for column in tilts.T], axis=1)
    return np.asarray(up / np.linalg.norm(up, axis=1, keepdims=True))


def levelling(up: Array) -> Array:
    """The shortest rotations (T, 4) that turn unit vectors up (T, 3) to +Z."""
    axis = np.cross(up, np.array([0.0, 0.0, 1.0]))
    return normalize(np.concatenate([axis, 1.0 + up[:, 2:]], axis=1))


def _smooth_tilts(left: Array, leans: Array) -> Array:
    """Horizontal components (K, 2) of up for K consecutive strides.

    left: (K, 2) unit vectors to the left of each stride's heading; leans: (K,) radians to that side. Weighted
    least squares over the neighbouring strides, without outliers.
    """
    number = np.arange(len(leans))
    weights = np.ones(len(leans))
    tilts = np.zeros((len(leans), 2))
    for _ in range(3):
        near = np.exp(-0.5 * ((number[:, None] - number) / SMOOTHING_STRIDES) ** 2) * weights
        square = np.einsum("jk,ka,kb->jab", near, left, left) + _RIDGE * np.eye(2)
        tilts = np.linalg.solve(square, np.einsum("jk,ka,k->ja", near, left, leans)[..., None])[..., 0]
        residual = np.abs(np.sum(tilts * left, axis=1) - leans)
        scale = max(4.0 * float(np.median(residual)), MIN_TILT)
        weights = np.clip(1.0 - (residual / scale) ** 2, 0.0, 1.0)
    return np.asarray(tilts)

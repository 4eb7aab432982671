"""Markers that were hidden for a while, from others on the same segment of the body.

Three markers of a rigid segment show where its others are. Skin moves over the bone, so the difference of a
marker from where the others put it is interpolated over the gap: the filled path joins the measured one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import all_finite
from kinemimic.pipeline.readers.optical.marker_names import SIDES

# The landmarks whose markers are on one bone.
_SEGMENTS: tuple[tuple[str, ...], ...] = (
    ("asis_left", "asis_right", "psis_left", "psis_right", "sacrum"),
    ("head",),
    *((f"thigh_{side}", f"knee_lateral_{side}", f"knee_medial_{side}") for side in SIDES),
    *((f"shank_{side}", f"ankle_lateral_{side}", f"ankle_medial_{side}") for side in SIDES),
)
_ENOUGH = 3
# Metres (root sum of squares) by which markers must lie off one line to show a rotation.
_OFF_LINE = 0.02


def fill_rigid(points: Array, found: Mapping[str, tuple[int, ...]]) -> tuple[Array, Mask]:
    """The points (T, M, 3) with the gaps of rigid segments filled, and a mask (T, M) of what was filled.

    points: metres, NaN where missing; found: landmark -> indices of its markers.
    """
    filled = points.copy()
    for segment in _SEGMENTS:
        markers = sorted({marker for landmark in segment for marker in found.get(landmark, ())})
        if len(markers) > _ENOUGH:
            filled[:, markers] = _fill_segment(points[:, markers])
    return filled, all_finite(filled) & ~all_finite(points)


def _fill_segment(points: Array) -> Array:
    """The markers (T, n, 3) of one segment, filled; as they are if they were never all seen at once."""
    seen = all_finite(points)
    whole = points[seen.all(axis=1)]
    if not len(whole):
        return points
    shape = _shape(whole)
    result = points.copy()
    for marker in np.flatnonzero(~seen.all(axis=0)).tolist():
        others = seen.copy()
        others[:, marker] = False
        rotation, place = _placed(shape, points, others, marker)
        known = np.flatnonzero(seen[:, marker] & all_finite(place))
        hidden = np.flatnonzero(~seen[:, marker] & all_finite(place))
        if len(known) and len(hidden):
            on_bone = np.einsum("tij,tj->ti", rotation[known], points[known, marker] - place[known])
            off = np.stack([np.interp(hidden, known, axis) for axis in on_bone.T], axis=1)
            result[hidden, marker] = place[hidden] + np.einsum("tij,ti->tj", rotation[hidden], off)
    return result


def _shape(whole: Array) -> Array:
    """The median shape (n, 3) of complete frames (K, n, 3), in the axes of the middle one."""
    rotation, centre = _pose(whole[len(whole) // 2], whole)
    return np.asarray(np.median(np.einsum("tij,tnj->tni", rotation, whole - centre[:, None]), axis=0))


def _placed(shape: Array, points: Array, used: Mask, marker: int) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) of the segment and places (T, 3) of one of its markers, from those used (T, n).

    NaN in frames in which too few are used, or only markers in one line.
    """
    rotation, place = np.full((len(points), 3, 3), np.nan), np.full((len(points), 3), np.nan)
    for choice in np.unique(used[used.sum(axis=1) >= _ENOUGH], axis=0):
        middle = shape[choice].mean(axis=0)
        if np.linalg.svd(shape[choice] - middle, compute_uv=False)[1] < _OFF_LINE:
            continue
        frames = (used == choice).all(axis=1)
        rotation[frames], centre = _pose(shape[choice], points[frames][:, choice])
        place[frames] = centre + np.einsum("tij,i->tj", rotation[frames], shape[marker] - middle)
    return rotation, place


def _pose(shape: Array, points: Array) -> tuple[Array, Array]:
    """Rotations (T, 3, 3), from the axes of `points` to those of `shape`, and centroids (T, 3) of points.

    shape: (n, 3); points: (T, n, 3). The least squares of Kabsch 1976 (Acta Cryst. A32, 922-923).
    """
    centre = points.mean(axis=1)
    covariance = np.einsum("ni,tnj->tij", shape - shape.mean(axis=0), points - centre[:, None])
    u, _, vt = np.linalg.svd(covariance)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[:, None]  # a rotation, not a reflection
    return u @ vt, centre

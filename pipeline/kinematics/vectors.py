"""Vectors and values with gaps: unit vectors, components, medians."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array


def unit(vectors: Array) -> Array:
    """Unit vectors (..., 3); NaN for zero vectors."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, np.nan))


def perpendicular(vectors: Array, axis: Array) -> Array:
    """The component (..., 3) of the vectors at right angles to a unit axis."""
    return np.asarray(vectors - np.sum(vectors * axis, axis=-1, keepdims=True) * axis)


def median(values: Array) -> float:
    """Median of the finite values; NaN without any."""
    seen = values[np.isfinite(values)]
    return float(np.median(seen)) if len(seen) else float("nan")


def distances(one: Array, other: Array) -> Array:
    """Distances (…) between points (…, 3)."""
    # Written out per axis: numpy takes five times as long to reduce an axis of three.
    x, y, z = np.moveaxis(one - other, -1, 0)
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def median_distance(one: Array, other: Array) -> float:
    """Median distance of points (..., 3) over those that are finite in both; infinite if there are none."""
    middle = median(np.linalg.norm(one - other, axis=-1))
    return middle if np.isfinite(middle) else np.inf

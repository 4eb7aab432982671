"""Vectors of the world in the frame of a humanoid's heading."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array


def in_heading_frame(vectors: Array, heading: Array) -> Array:
    """Vectors (E, ..., 3) of the world in the frame of the headings (E,), radians about the vertical."""
    shape = (-1, *(1,) * (vectors.ndim - 2))
    cosine, sine = np.cos(heading).reshape(shape), np.sin(heading).reshape(shape)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    turned = np.empty(vectors.shape)
    turned[..., 0] = cosine * x + sine * y
    turned[..., 1] = cosine * y - sine * x
    turned[..., 2] = z
    return turned

"""The lowest point of each of the body's 15 collision shapes, as the engines define them."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_NODES, Body

_CORNERS = np.array([[a, b, c] for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (-0.5, 0.5)])


def _hull_spheres(body: Body) -> tuple[Array, float]:
    """Points (K, 3) in the node's frame and a radius: the shape is the hull of spheres around them.

    The corners of a box, the centre of a sphere, or both ends of the capsule that replaces an ellipsoid (see
    urdf.py).
    """
    size, center = np.array(body.size), np.array(body.center)
    if body.shape == "box":
        return center + _CORNERS * size, 0.0
    half = 0.5 * (size[2] - size[0])
    return center + np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), 0.5 * float(size[0])


def lowest_points(positions: Array, frames: Array) -> Array:
    """World positions (T, 15, 3) of the lowest point of each of BODIES, from `Motion.kinematics()`."""
    out = np.empty((len(positions), len(BODIES), 3))
    for index, (body, node) in enumerate(zip(BODIES, BODY_NODES, strict=True)):
        knobs, radius = _hull_spheres(body)
        world = positions[:, None, node] + rotate(frames[:, None, node], knobs[None])
        pick = world[..., 2].argmin(axis=1)
        out[:, index] = world[np.arange(len(world)), pick] - [0.0, 0.0, radius]
    return out

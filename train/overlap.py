"""Whether an obstacle lies where a figure is."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.rotations import conjugate, rotate
from kinemimic.retarget.body import BODIES, Body
from kinemimic.train.world import BodyStates, Obstacle

Array = NDArray[np.float64]

_GRID = (-1.0, -0.5, 0.0, 0.5, 1.0)  # of a box, along each of its axes


def _samples(body: Body) -> tuple[Array, float]:
    """Points (P, 3) in a body's frame, and the radius of the balls around them that fill its shape."""
    x, y, z = (0.5 * side for side in body.size)
    if body.shape == "box":
        return np.array([(a * x, b * y, c * z) for a, b, c in itertools.product(_GRID, repeat=3)]), 0.0
    if body.shape == "sphere":
        return np.zeros((1, 3)), x
    return np.array([(0.0, 0.0, share * (z - x)) for share in np.linspace(-1.0, 1.0, 9)]), x


_SAMPLES = [_samples(body) for body in BODIES]
_OWNER = np.concatenate([np.full(len(points), k) for k, (points, _) in enumerate(_SAMPLES)])
_POINTS = np.concatenate([points for points, _ in _SAMPLES])
_RADII = np.concatenate([np.full(len(points), radius) for points, radius in _SAMPLES])


def distance(item: Obstacle, points: Array) -> Array:
    """Signed distances (P,) from an obstacle's surface to points (P, 3) of the world, negative inside."""
    turn = np.broadcast_to(item.rotation, (len(points), 4))
    local = np.abs(rotate(conjugate(turn), points - np.array(item.position)))
    half = 0.5 * np.array(item.size)
    if item.shape == "sphere":
        return np.asarray(np.linalg.norm(local, axis=-1) - half[0])
    if item.shape == "cylinder":
        beyond = np.stack([np.hypot(local[:, 0], local[:, 1]) - half[0], local[:, 2] - half[2]], axis=-1)
    else:
        beyond = local - half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0))


def overlapped(item: Obstacle, bodies: BodyStates) -> str | None:
    """Name of the body of one figure, arrays (15, ...), that an obstacle reaches into deepest, or None.

    Bodies are taken as balls and grids of points in them: an obstacle thinner than 3 cm may slip through.
    """
    arms = rotate(bodies.rotations[_OWNER], _POINTS)
    gaps = distance(item, bodies.positions[_OWNER] + arms) - _RADII
    deepest = int(gaps.argmin())
    return BODIES[_OWNER[deepest]].name if gaps[deepest] < 0.0 else None

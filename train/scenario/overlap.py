"""Overlap of obstacles with the humanoid and with each other."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.retarget.humanoid.body import BODIES, Body
from kinemimic.train.sim.world import BodyStates, Obstacle

_TOUCH = 1e-3  # m
_SPACING = 0.03  # m between points in a box


def _samples(body: Body) -> tuple[Array, float]:
    """Points (P, 3) in a body's frame, and the radius of the balls around them that fill its shape."""
    x, y, z = (0.5 * side for side in body.size)
    if body.shape == "box":
        axes = (np.linspace(-half, half, 1 + int(np.ceil(2.0 * half / _SPACING))) for half in (x, y, z))
        return np.array(list(itertools.product(*axes))), 0.0
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


def obstacles_overlap(a: Obstacle, b: Obstacle) -> bool:
    """Whether two obstacles, both rotated about the vertical only, overlap by more than _TOUCH."""
    if abs(a.position[2] - b.position[2]) > 0.5 * (_height(a) + _height(b)) - _TOUCH:
        return False
    if a.shape == "box" and b.shape == "box":
        first, second = _corners(a), _corners(b)
        # Separating axis theorem: convex shapes are apart if their projections on a side's normal are.
        sides = np.concatenate([np.diff(first[:3], axis=0), np.diff(second[:3], axis=0)])
        shadows = ((first @ side, second @ side) for side in sides / np.linalg.norm(sides, axis=1)[:, None])
        return all(
            min(one.max(), other.max()) - max(one.min(), other.min()) > _TOUCH for one, other in shadows
        )
    if a.shape == "box":
        a, b = b, a
    # A round shape overlaps if its axis is closer than its radius.
    center = np.array([[a.position[0], a.position[1], b.position[2]]])
    upright = replace(b, shape="cylinder") if b.shape == "sphere" else b
    return bool(distance(upright, center)[0] < 0.5 * a.size[0] - _TOUCH)


def _height(item: Obstacle) -> float:
    return item.size[0] if item.shape == "sphere" else item.size[2]


def _corners(box: Obstacle) -> Array:
    """Corners (4, 2) of its outline, in order."""
    x, y = 0.5 * box.size[0], 0.5 * box.size[1]
    corners = np.array([(x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0)])
    return (np.array(box.position) + rotate(np.broadcast_to(box.rotation, (4, 4)), corners))[:, :2]


def overlapping_body(item: Obstacle, bodies: BodyStates) -> str | None:
    """Name of the body that an obstacle overlaps most, or None; bodies: of one humanoid, arrays (15, ...).

    Bodies are balls and grids of points: the overlap with an obstacle smaller than 6 cm may be missed.
    """
    arms = rotate(bodies.rotations[_OWNER], _POINTS)
    gaps = distance(item, bodies.positions[_OWNER] + arms) - _RADII
    deepest = int(gaps.argmin())
    return BODIES[_OWNER[deepest]].name if gaps[deepest] < 0.0 else None

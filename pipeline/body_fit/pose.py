"""Poses of the body over a clip: forward kinematics and its derivatives, for all frames at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import (
    LENGTHS,
    MOVES,
    POINT_OFFSETS,
    POINTS,
    SEGMENT_OFFSETS,
    SEGMENTS,
    UNKNOWNS,
)


@dataclass(frozen=True)
class Poses:
    """The body in T frames.

    root: (T, 3) metres, the middle of the hips in the world; turns: (T, S, 3, 3) rotation of each segment in
    its parent's frame (the pelvis in the world), of a hinge made from its angle; hinges: (T, S) radians, zero
    for ball joints.
    """

    root: Array
    turns: Array
    hinges: Array

    def moved(self, step: Array) -> Poses:
        """The poses after a step (T, K) of the unknowns: rotation vectors in each segment's own frame."""
        turns, hinges = self.turns.copy(), self.hinges.copy()
        for k, segment in enumerate(SEGMENTS):
            first, width = UNKNOWNS.first[k], UNKNOWNS.width[k]
            part = step[:, first : first + width]
            if segment.hinge is None:
                turns[:, k] = turns[:, k] @ rotation_of(part)
            else:
                hinges[:, k] += part[:, 0]
                turns[:, k] = rotation_of(hinges[:, k, None] * np.array(segment.hinge))
        return Poses(self.root + step[:, :3], turns, hinges)

    def __getitem__(self, frames: slice) -> Poses:
        return Poses(self.root[frames], self.turns[frames], self.hinges[frames])


@dataclass(frozen=True)
class Placed:
    """Where the body is, and how it moves with the unknowns.

    points: (T, P, 3) metres in the world, in the order of POINTS; frames: (T, S, 3, 3) rotations of the
    segments in the world; by_unknowns: (T, P, 3, K); by_lengths: (T, P, 3, L), per logarithm of a factor.
    """

    points: Array
    frames: Array
    by_unknowns: Array
    by_lengths: Array


def place(poses: Poses, factors: Array, height: float) -> Placed:
    """Forward kinematics with its derivatives; factors: (L,) of the lengths, about 1; height: metres."""
    T, S = poses.turns.shape[:2]
    sizes = factors * height
    frames = np.empty((T, S, 3, 3))
    origins, origins_by = np.empty((T, S, 3)), np.zeros((T, S, 3, len(LENGTHS)))
    for k, segment in enumerate(SEGMENTS):
        if segment.parent < 0:
            frames[:, k], origins[:, k] = poses.turns[:, k], poses.root
            continue
        above = frames[:, segment.parent]
        by = above @ (SEGMENT_OFFSETS[k] * sizes[:, None]).T  # (T, 3, L)
        origins_by[:, k] = origins_by[:, segment.parent] + by
        origins[:, k] = origins[:, segment.parent] + by.sum(axis=-1)
        frames[:, k] = above @ poses.turns[:, k]
    of = [point.segment for point in POINTS]
    local = frames[:, of] @ (POINT_OFFSETS * sizes[:, None]).swapaxes(-1, -2)  # (T, P, 3, L)
    by_lengths = origins_by[:, of] + local
    points = origins[:, of] + local.sum(axis=-1)
    by_unknowns = np.zeros((T, len(POINTS), 3, UNKNOWNS.count))
    by_unknowns[..., :3] = np.eye(3)
    for k, segment in enumerate(SEGMENTS):
        moved = [p for p, s in enumerate(of) if MOVES[s, k]]
        arm = points[:, moved] - origins[:, None, k]
        axes = frames[:, k]  # columns: the axes of the segment in the world
        if segment.hinge is not None:
            axes = (axes @ np.array(segment.hinge))[..., None]
        for column in range(axes.shape[-1]):
            turned = np.cross(axes[:, None, :, column], arm)
            by_unknowns[..., UNKNOWNS.first[k] + column][:, moved] = turned
    return Placed(points, frames, by_unknowns, by_lengths)


def rotation_of(vectors: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), by Rodrigues' formula."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0, np.sin(safe) / safe)
    second = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def vector_of(rotations: Array) -> Array:
    """Rotation vectors (..., 3) of matrices (..., 3, 3), of turns well below half a turn."""
    skew = rotations - rotations.swapaxes(-1, -2)
    twice = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    cosine = np.clip((np.trace(rotations, axis1=-2, axis2=-1) - 1.0) / 2.0, -1.0, 1.0)
    angle = np.arccos(cosine)
    sine = np.sin(angle)
    ratio = np.where(angle < 1e-6, 0.5, angle / np.maximum(2.0 * sine, 1e-9))
    return np.asarray(twice * ratio[..., None])

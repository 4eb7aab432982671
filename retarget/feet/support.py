"""The area of the soles that bears weight: the convex hull of the corners that are on the ground."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.feet.contact import corner_velocity, sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.motion import Motion

# Corners of the soles that can bear weight: height above the ground, m, and speed over it, m/s.
LOW, SLOW = 0.03, 0.7
CORNERS = 3  # the fewest that span an area
_PAIRS = np.array(list(combinations(range(8), 2))).T
_ON_LINE = 1e-12  # m²: beyond it, a corner is on the other side of a line than the point


@dataclass(frozen=True)
class Support:
    """The soles' corners that bear weight.

    frames: (K,) with enough of them for an area; corners: (K, 8, 2) m, some of them more than once.
    """

    frames: NDArray[np.intp]
    corners: Array

    @classmethod
    def of(cls, motion: Motion, sole: tuple[float, float] = (1.0, 1.0)) -> Support:
        """The support of a loop; sole: the share of its length and of its width that counts as sole, around
        its middle."""
        corners = sole_positions(*body_kinematics(motion.rotations, motion.root))
        speed = np.linalg.norm(corner_velocity(corners, motion.rate, motion.cycle_offset)[..., :2], axis=-1)
        bearing = ((corners[..., 2] < LOW) & (speed < SLOW)).reshape(-1, 8)
        frames = np.flatnonzero(bearing.sum(axis=1) >= CORNERS)
        bearing, places = bearing[frames], _inside(corners[frames, ..., :2], sole).reshape(-1, 8, 2)
        # The first that bears weight stands for those that do not: it changes no hull.
        first = np.take_along_axis(places, bearing.argmax(axis=1)[:, None, None], axis=1)
        return cls(frames, np.where(bearing[..., None], places, first))

    def outside(self, points: Array) -> Array:
        """Vector (K, 2) from the support to the points (T, 2) of the frames, m; zero inside."""
        points = points[self.frames]
        start, edge = self.corners[:, _PAIRS[0]], self.corners[:, _PAIRS[1]] - self.corners[:, _PAIRS[0]]
        # Nearest point of every line between two corners: one of them is the nearest of the hull's edge.
        length = np.maximum(np.square(edge).sum(axis=-1), np.finfo(np.float64).tiny)
        share = np.clip(((points[:, None] - start) * edge).sum(axis=-1) / length, 0.0, 1.0)
        apart = points[:, None] - start - share[..., None] * edge
        nearest = np.square(apart).sum(axis=-1).argmin(axis=1)
        apart = np.take_along_axis(apart, nearest[:, None, None], axis=1)[:, 0]
        # A point is outside if no corner lies on its side of the line through its nearest point.
        beyond = ((self.corners - (points - apart)[:, None]) * apart[:, None]).sum(axis=-1)
        found: Array = np.where((beyond <= _ON_LINE).all(axis=1)[:, None], apart, 0.0)
        return found


def _inside(corners: Array, sole: tuple[float, float]) -> Array:
    """Corners (K, 2, 4, 2), heel and toe of either side, of a sole that is shorter and narrower."""
    middle = corners.mean(axis=2, keepdims=True)
    ends = np.repeat(corners.reshape(len(corners), 2, 2, 2, 2).mean(axis=3), 2, axis=2)
    found: Array = middle + sole[0] * (ends - middle) + sole[1] * (corners - ends)
    return found

"""Least-squares terms that keep all bodies except the feet above the ground.

In a roll the back touches the ground, in a cartwheel a hand, on all fours the knees. Such contacts lift or
tilt the root; the joints keep their pose.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.optimise.leg_chain import ROOT_COLUMNS, ROOT_ROTATION, apply_corrections
from kinemimic.retarget.optimise.one_sided import OneSided

NEAR_GROUND = 0.05  # m: bodies that never come this low are left out
RELEASE = 0.005  # m, see OneSided
_UP = np.array([0.0, 0.0, 1.0])


class BodyGroundTerms:
    """Ground terms of a motion's bodies, except the feet, that come near the ground."""

    def __init__(self, motion: Motion) -> None:
        heights = lowest_points(*motion.kinematics())[..., 2].min(axis=0)
        self._motion = motion
        self._bodies = [
            index
            for index, body in enumerate(BODIES)
            if not body.name.startswith("foot") and heights[index] < NEAR_GROUND
        ]
        self._heights = np.zeros((len(motion.root), len(self._bodies)))
        self._levers = np.zeros((len(motion.root), len(self._bodies), 3))
        self._ground = OneSided(self._heights.shape, RELEASE)

    def update(self, x: Array) -> None:
        """Compute the lowest points under corrections x (T, 20)."""
        if not self._bodies:
            return
        motion = apply_corrections(self._motion, x)
        points = lowest_points(*motion.kinematics())[:, self._bodies]
        self._heights = points[..., 2]
        # A small rotation w of the root, in its own frame, lifts a point at r from it by w · R'(r × up).
        around = np.cross(points - motion.root[:, None], _UP)
        self._levers = rotate(conjugate(motion.rotations[:, :1]), around)

    def terms(self, window: slice, deviation: float) -> tuple[Array, Array]:
        """J'WJ (t, 6, 6) and J'Wr (t, 6) of the root's six unknowns for the points of the last `update`.

        deviation: expected penetration in metres.
        """
        heights = self._heights[window]
        rows = np.zeros((*heights.shape, ROOT_COLUMNS.stop))
        rows[..., 2] = 1.0
        rows[..., ROOT_ROTATION] = self._levers[window]
        weighted = rows * (self._ground.weight(heights, window) / deviation**2)[..., None]
        return np.swapaxes(weighted, -1, -2) @ rows, np.einsum("tpi,tp->ti", weighted, heights)

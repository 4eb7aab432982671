"""Least-squares terms of root and legs: soles in contact, knees and ankles, the ground, joint limits."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.contact import find_stances
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.gauss_newton import huber
from kinemimic.retarget.optimise.ground_terms import RELEASE, BodyGroundTerms
from kinemimic.retarget.optimise.leg_chain import (
    JOINT_COLUMNS,
    KNEE_AND_ANKLE,
    ROOT_COLUMNS,
    ROOT_POSITION,
    SOLE,
    UNKNOWNS,
    chain_root,
    leg_chain,
    leg_jacobian,
    leg_points,
    normal_equations,
)
from kinemimic.retarget.optimise.limit_terms import JointLimitTerms, near_limits
from kinemimic.retarget.optimise.one_sided import OneSided

# Expected deviations (metres), by which residuals are scaled.
NODE_DEVIATION = 0.03  # knees and ankles, from the root
CONTACT_DEVIATION = 0.002  # a sole corner in contact, from its place on the ground
PENETRATION_DEVIATION = 0.002


class LegTerms:
    """Terms of the corrections of root and legs (`leg_chain`) over T frames of a motion in closed form.

    `update` is called before each step of `gauss_newton`, `terms` for each window of a step.
    """

    def __init__(self, motion: Motion, seen: Array) -> None:
        """seen: (T, 20) visibility of each node, above 0 to 1."""
        frames = len(motion.root)
        self._motion = motion
        self._chain = leg_chain(motion.root, motion.rotations)
        points = leg_points(self._chain, np.zeros((frames, UNKNOWNS)))
        self._from_root = points[:, :, KNEE_AND_ANKLE] - motion.root[:, None, None]
        self._node_weights = np.empty((frames, 2, 2, 1))
        for leg, side in enumerate(SIDES):
            nodes = [N[f"knee_{side}"], N[f"ankle_{side}"]]
            self._node_weights[:, leg, :, 0] = seen[:, nodes] / NODE_DEVIATION**2
        self._stances = find_stances(
            motion.contacts, points[:, :, SOLE], rate=motion.rate, cyclic=motion.cyclic
        )
        self._anchors = np.zeros((frames, 2, 4, 2))
        self._ground = OneSided((frames, 2, 4), RELEASE)
        self._bodies = BodyGroundTerms(motion)
        self._limits = {joint: JointLimitTerms(joint, frames) for joint in near_limits(motion, JOINT_COLUMNS)}

    def update(self, x: Array) -> None:
        """Find where soles in contact stand, and the lowest points of the bodies, under x (T, 20)."""
        self._bodies.update(x)
        soles = leg_points(self._chain, x)[:, :, SOLE]
        self._anchors = self._stances.anchors(soles, self._motion.cycle_offset)

    def terms(self, x: Array, window: slice) -> tuple[Array, Array]:
        """J'WJ (t, 20, 20) and J'Wr (t, 20) under corrections x (t, 20) of a window's frames."""
        chain = self._chain.window(window)
        points, jacobian = leg_jacobian(chain, x)
        # Knees and ankles keep their place relative to the root, so they do not pull on its position.
        jacobian[:, :, KNEE_AND_ANKLE, :, ROOT_POSITION] = 0.0
        residual, weight = np.empty_like(points), np.empty_like(points)
        nodes = points[:, :, KNEE_AND_ANKLE] - chain_root(chain, x)[:, None, None] - self._from_root[window]
        residual[:, :, KNEE_AND_ANKLE] = nodes
        weight[:, :, KNEE_AND_ANKLE] = self._node_weights[window] * huber(nodes / NODE_DEVIATION)
        residual[:, :, SOLE], weight[:, :, SOLE] = self._soles(points[:, :, SOLE], window)
        square, right = normal_equations(jacobian, residual, weight)
        for joint, limit in self._limits.items():
            columns = JOINT_COLUMNS[joint]
            block, gradient = limit.terms(self._motion.rotations[window, N[joint]], x[:, columns], window)
            square[:, columns, columns] += block
            right[:, columns] += gradient
        block, gradient = self._bodies.terms(window, PENETRATION_DEVIATION)
        square[:, ROOT_COLUMNS, ROOT_COLUMNS] += block
        right[:, ROOT_COLUMNS] += gradient
        return square, right

    def _soles(self, corners: Array, window: slice) -> tuple[Array, Array]:
        """Residuals and weights, both (t, 2, 4, 3), of sole corners (t, 2, 4, 3).

        A corner in contact stays at its anchor on the ground; no corner penetrates the ground.
        """
        residual, weight = corners.copy(), np.empty_like(corners)
        residual[..., :2] -= self._anchors[window]
        weight[:] = self._stances.weight[window][..., None] / CONTACT_DEVIATION**2
        penetration = self._ground.weight(corners[..., 2], window) / PENETRATION_DEVIATION**2
        weight[..., 2] = np.maximum(weight[..., 2], penetration)
        return residual, weight

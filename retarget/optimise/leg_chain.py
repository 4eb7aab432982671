"""Forward kinematics of root and legs with 20 unknowns per frame, and its Jacobian.

The unknowns x are corrections to a motion: x[0:3] metres added to the root; x[3:6] a rotation vector applied
after the root's rotation; then for each leg the hip (3), knee (1, a hinge about Y) and ankle (3), applied
after the joint's rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, multiply, to_matrix
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.body import node_offsets, sole_corners
from kinemimic.retarget.humanoid.limits import HINGE_JOINTS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.tangent import exponential

UNKNOWNS = 20
ROOT_POSITION, ROOT_ROTATION, ROOT_COLUMNS = slice(0, 3), slice(3, 6), slice(0, 6)
_LEG_UNKNOWNS = 7
# Columns of each leg in x, left then right, and of each joint.
LEG_COLUMNS = (slice(6, 13), slice(13, 20))
JOINT_COLUMNS: dict[str, slice] = {
    f"{joint}_{side}": slice(leg.start + first, leg.start + first + size)
    for joint, first, size in (("hip", 0, 3), ("knee", 3, 1), ("ankle", 4, 3))
    for side, leg in zip(SIDES, LEG_COLUMNS, strict=True)
}
# The points of a leg: knee, ankle and the four sole corners.
LEG_POINTS = 6
KNEE_AND_ANKLE, SOLE = slice(0, 2), slice(2, 6)


def apply_corrections(motion: Motion, x: Array) -> Motion:
    """The motion with corrections x (T, 20) of root and legs, as defined in this module."""
    rotations = motion.rotations.copy()
    rotations[:, 0] = multiply(rotations[:, 0], from_rotvec(x[:, ROOT_ROTATION]))
    for joint, columns in JOINT_COLUMNS.items():
        own = x[:, columns]
        turn = from_axis_angle("Y", own[:, 0]) if joint in HINGE_JOINTS else from_rotvec(own)
        rotations[:, N[joint]] = multiply(rotations[:, N[joint]], turn)
    return replace(motion, root=motion.root + x[:, ROOT_POSITION], rotations=rotations)


@dataclass(frozen=True)
class LegChain:
    """T frames of root and legs: root (T, 3), its rotation `turn` (T, 3, 3), and local rotations (T, 2, 3, 3)
    of hips, knees and ankles, left then right.
    """

    root: Array
    turn: Array
    hip: Array
    knee: Array
    ankle: Array

    def window(self, frames: slice) -> LegChain:
        """The chain of some of the frames."""
        return LegChain(
            self.root[frames], self.turn[frames], self.hip[frames], self.knee[frames], self.ankle[frames]
        )


def leg_chain(root: Array, rotations: Array) -> LegChain:
    """The chain of root positions (T, 3) and local rotations (T, 20, 4)."""
    hip, knee, ankle = (
        to_matrix(rotations[:, [N[f"{joint}_{side}"] for side in SIDES]])
        for joint in ("hip", "knee", "ankle")
    )
    return LegChain(root, to_matrix(rotations[:, N["hip_center"]]), hip, knee, ankle)


def leg_points(chain: LegChain, x: Array) -> Array:
    """World positions (T, 2, 6, 3) of each leg's knee, ankle and sole corners under corrections x (T, 20)."""
    return _forward(chain, x)[0]


def leg_jacobian(chain: LegChain, x: Array) -> tuple[Array, Array]:
    """`leg_points` and its Jacobian (T, 2, 6, 3, 13) by the root's six unknowns and the leg's seven.

    A rotation of joint j about the column m of M_j moves a point p below it by m × (p - p_j).
    """
    points, joints, turns = _forward(chain, x)
    jacobian = np.zeros((*points.shape, 6 + _LEG_UNKNOWNS))
    at = np.arange(3)
    jacobian[..., at, at] = 1.0
    hip, knee, ankle = joints
    by_root, by_hip, by_knee, by_ankle = turns
    _cross(by_root[:, None, None], points - chain_root(chain, x)[:, None, None], jacobian[..., 3:6])
    _cross(by_hip[:, :, None], points - hip[:, :, None], jacobian[..., 6:9])
    _cross(by_knee[:, :, None], points - knee[:, :, None], jacobian[..., 9:10])
    # A joint's own position does not move with its rotation: that lever is zero.
    _cross(by_ankle[:, :, None], points[:, :, 1:] - ankle[:, :, None], jacobian[:, :, 1:, :, 10:13])
    return points, jacobian


def chain_root(chain: LegChain, x: Array) -> Array:
    """The root's corrected position (T, 3)."""
    return chain.root + x[:, ROOT_POSITION]


def _forward(chain: LegChain, x: Array) -> tuple[Array, tuple[Array, Array, Array], tuple[Array, ...]]:
    """Points (T, 2, 6, 3); hips, knees and ankles (T, 2, 3); and for root, hip, knee and ankle the world axes
    M (T, [2,] 3, k) about which the unknowns rotate the chain below."""
    offsets, corners = node_offsets(), sole_corners()
    own = x[:, 6:].reshape(-1, 2, _LEG_UNKNOWNS)
    root = chain_root(chain, x)
    turn, tangent = exponential(x[:, ROOT_ROTATION])
    pelvis = chain.turn @ turn
    by_root = pelvis @ tangent
    hip = root[:, None] + np.einsum("tij,sj->tsi", pelvis, offsets[[N["hip_left"], N["hip_right"]]])
    turn, tangent = exponential(own[..., 0:3])
    thigh = pelvis[:, None] @ chain.hip @ turn
    by_hip = thigh @ tangent
    # Knees and ankles lie straight below: only the third column of the bone's frame matters.
    knee = hip + thigh[..., 2] * offsets[N["knee_left"], 2]
    shank = thigh @ chain.knee
    by_knee = shank[..., 1:2].copy()
    cosine, sine = np.cos(own[..., 3:4]), np.sin(own[..., 3:4])
    front, up = shank[..., 0], shank[..., 2]
    shank = np.stack([cosine * front - sine * up, shank[..., 1], sine * front + cosine * up], axis=-1)
    ankle = knee + shank[..., 2] * offsets[N["ankle_left"], 2]
    turn, tangent = exponential(own[..., 4:7])
    foot = shank @ chain.ankle @ turn
    by_ankle = foot @ tangent
    points = np.empty((len(x), 2, LEG_POINTS, 3))
    points[:, :, 0], points[:, :, 1] = knee, ankle
    points[:, :, SOLE] = ankle[:, :, None] + np.einsum("tsij,cj->tsci", foot, corners)
    return points, (hip, knee, ankle), (by_root, by_hip, by_knee, by_ankle)


def _cross(axes: Array, lever: Array, out: Array) -> None:
    """Write the columns of axes (..., 3, k) × lever (..., 3) into out (..., 3, k)."""
    lx, ly, lz = (lever[..., k, None] for k in range(3))
    ax, ay, az = (axes[..., k, :] for k in range(3))
    out[..., 0, :] = ay * lz - az * ly
    out[..., 1, :] = az * lx - ax * lz
    out[..., 2, :] = ax * ly - ay * lx


def normal_equations(jacobian: Array, residual: Array, weights: Array) -> tuple[Array, Array]:
    """J'WJ (T, 20, 20) and J'Wr (T, 20) of point residuals (T, 2, 6, 3) with weights of the same shape."""
    frames = len(jacobian)
    rows = jacobian.reshape(frames, 2, 3 * LEG_POINTS, 6 + _LEG_UNKNOWNS)
    weighted = rows * weights.reshape(frames, 2, 3 * LEG_POINTS, 1)
    legs = np.swapaxes(weighted, -1, -2) @ rows
    pulls = (residual.reshape(frames, 2, 1, 3 * LEG_POINTS) @ weighted)[:, :, 0]
    square, right = np.zeros((frames, UNKNOWNS, UNKNOWNS)), np.zeros((frames, UNKNOWNS))
    for side, own in enumerate(LEG_COLUMNS):
        square[:, :6, :6] += legs[:, side, :6, :6]
        square[:, own, own] = legs[:, side, 6:, 6:]
        square[:, own, :6] = legs[:, side, 6:, :6]
        square[:, :6, own] = legs[:, side, :6, 6:]
        right[:, :6] += pulls[:, side, :6]
        right[:, own] = pulls[:, side, 6:]
    return square, right

"""Refinement of a whole motion: feet in contact stay in place, nothing penetrates, joints keep their limits.

The closed form retargets each frame separately. Here all frames are corrected together, as little as needed,
by Gauss-Newton on one sum of squares: soles in contact stay in place on the ground; neither soles nor other
bodies penetrate it; no joint exceeds its limits; legs and joints stay near the closed form, weighted by
visibility; corrections (and the poses of a motion kept as recorded) are smooth. Frames are coupled by second
differences only, so the normal equations are banded and the cost is linear in the number of frames. Root and
legs form one chain; arms and trunk, which have no contact, are refined joint by joint beforehand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.filters.low_pass import zero_phase
from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    continuous,
    from_axis_angle,
    from_rotvec,
    multiply,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.retarget.feet.contact import find_stances
from kinemimic.retarget.humanoid.limits import HINGE_JOINTS, LIMITS, clamp_to_limits, swing_twist
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.banded import MIN_CYCLE_FRAMES, second_differences
from kinemimic.retarget.optimise.gauss_newton import gauss_newton, huber
from kinemimic.retarget.optimise.ground_terms import RELEASE, BodyGroundTerms, apply_corrections
from kinemimic.retarget.optimise.leg_chain import (
    JOINT_COLUMNS,
    ROOT_POSITION,
    ROOT_ROTATION,
    UNKNOWNS,
    leg_chain,
    leg_jacobian,
    leg_points,
    normal_equations,
)
from kinemimic.retarget.optimise.limit_terms import JointLimitTerms
from kinemimic.retarget.optimise.one_sided import OneSided

# Expected deviations (metres, radians), by which residuals are scaled.
ROOT_DEVIATION = (0.02, 0.02, 0.03)
ROOT_ROTATION_DEVIATION = np.radians(1.5)
_LEG_DEVIATIONS = {"hip": np.radians(4.0), "knee": np.radians(4.0), "ankle": np.radians(8.0)}
UPPER_BODY_DEVIATION = np.radians(4.0)
NODE_DEVIATION = 0.03  # knees and ankles, from the root
CONTACT_DEVIATION = 0.002  # a sole corner in contact, from its place on the ground
PENETRATION_DEVIATION = 0.002
MIN_WEIGHT = 0.05  # weight of a joint that was not seen at all
LIMIT_PROXIMITY = np.radians(15.0)  # joints that stay farther from their limits get no limit terms


def refine(motion: Motion, seen: Array | None = None) -> Motion:
    """The motion corrected for foot contact, ground and joint limits.

    motion: in closed form, with contacts; seen: (T, 20) visibility of each node, 0 to 1, by default 1.
    Frames, contacts and cycle_offset stay the same; a cycle stays closed. Motions of fewer than
    MIN_CYCLE_FRAMES frames are returned unchanged.
    """
    frames = len(motion.root)
    if frames < MIN_CYCLE_FRAMES:
        return motion
    weights = np.maximum(np.ones((frames, len(NODES))) if seen is None else seen, MIN_WEIGHT)
    rotations = motion.rotations.copy()
    for joint in LIMITS:
        if joint not in JOINT_COLUMNS:
            node = N[joint]
            rotations[:, node] = _refine_joint(motion, joint, weights[:, node])
    upper = replace(motion, rotations=rotations)
    refined = apply_corrections(upper, _refine_legs(upper, weights))
    return replace(refined, rotations=continuous(refined.rotations))


def _refine_legs(motion: Motion, seen: Array) -> Array:
    """Corrections (T, 20) of root and legs."""
    chain = leg_chain(motion.root, motion.rotations)
    frames, cyclic = len(motion.root), motion.cyclic
    uncorrected = leg_points(chain, np.zeros((frames, UNKNOWNS)))
    standing = find_stances(motion.contacts, uncorrected[:, :, 2:], rate=motion.rate, cyclic=cyclic)
    below_root = uncorrected[:, :, :2] - motion.root[:, None, None]
    deviation = np.empty(UNKNOWNS)
    deviation[ROOT_POSITION], deviation[ROOT_ROTATION] = ROOT_DEVIATION, ROOT_ROTATION_DEVIATION
    weights = np.ones((frames, UNKNOWNS))
    bending = np.zeros((frames, UNKNOWNS))
    if not cyclic:
        bending[:, ROOT_POSITION] = second_differences(motion.root, cyclic=False)
    bending[:, ROOT_ROTATION] = _rotation_differences(motion.rotations[:, N["hip_center"]], cyclic=cyclic)
    node_weights = np.empty((frames, 2, 2, 1))
    for joint, columns in JOINT_COLUMNS.items():
        node = N[joint]
        deviation[columns], weights[:, columns] = (
            _LEG_DEVIATIONS[joint.partition("_")[0]],
            seen[:, node, None],
        )
        turn = _rotation_differences(motion.rotations[:, node], cyclic=cyclic)
        bending[:, columns] = turn[:, 1:2] if joint in HINGE_JOINTS else turn
    for k, side in enumerate(SIDES):
        node_weights[:, k, :, 0] = seen[:, [N[f"knee_{side}"], N[f"ankle_{side}"]]] / NODE_DEVIATION**2
    near_limits = _near_limits(motion, list(JOINT_COLUMNS))
    limits = {joint: JointLimitTerms(joint, frames) for joint in near_limits}
    anchors = np.zeros((frames, 2, 4, 2))
    ground, bodies = OneSided((frames, 2, 4), RELEASE), BodyGroundTerms(motion)

    def terms(x: Array, window: slice) -> tuple[Array, Array]:
        points, jacobian = leg_jacobian(chain.window(window), x)
        root = chain.root[window] + x[:, ROOT_POSITION]
        # Knees and ankles keep their place relative to the root, so they do not pull on its position.
        jacobian[:, :, :2, :, ROOT_POSITION] = 0.0
        residual, weight = np.empty_like(points), np.empty_like(points)
        residual[:, :, :2] = points[:, :, :2] - root[:, None, None] - below_root[window]
        weight[:, :, :2] = node_weights[window] * huber(residual[:, :, :2] / NODE_DEVIATION)
        corners, contact = points[:, :, 2:], standing.weight[window]
        residual[:, :, 2:, :2] = corners[..., :2] - anchors[window]
        residual[:, :, 2:, 2] = corners[..., 2]
        penetration = ground.weight(corners[..., 2], window) / PENETRATION_DEVIATION**2
        weight[:, :, 2:] = contact[..., None] / CONTACT_DEVIATION**2
        weight[:, :, 2:, 2] = np.maximum(weight[:, :, 2:, 2], penetration)
        square, right = normal_equations(jacobian, residual, weight)
        for joint in near_limits:
            own = JOINT_COLUMNS[joint]
            block, gradient = limits[joint].terms(motion.rotations[window, N[joint]], x[:, own], window)
            square[:, own, own] += block
            right[:, own] += gradient
        block, gradient = bodies.terms(window, PENETRATION_DEVIATION)
        square[:, :6, :6] += block
        right[:, :6] += gradient
        return square, right

    def update(x: Array) -> None:
        bodies.update(x)
        corners = leg_points(chain, x)[:, :, 2:]
        anchors[:] = standing.anchors(corners, motion.cycle_offset)

    return gauss_newton(
        terms,
        deviation,
        weights,
        bending,
        rate=motion.rate,
        cyclic=cyclic,
        root_smoothing=_root_smoothing(motion),
        before_step=update,
    )


def _root_smoothing(motion: Motion) -> tuple[Array, Array]:
    """Extra smoothing of the root of a motion kept as recorded; zero for a cycle.

    Returns the share (UNKNOWNS,) of extra stiffness per unknown, and the second differences (T, UNKNOWNS) of
    the recording's jitter, which need not be kept. A foot that lands or leaves pulls at the root within a few
    frames, with accelerations that no ground could give a body of 48 kg: the legs have to yield instead. The
    root's recorded path without its jitter has the accelerations of the person.
    """
    share, jitter = np.zeros(UNKNOWNS), np.zeros((len(motion.root), UNKNOWNS))
    if motion.cyclic:
        return share, jitter
    share[ROOT_POSITION] = 1.0
    if (smooth := zero_phase(motion.rate)) is not None:
        jitter[:, ROOT_POSITION] = second_differences(motion.root - smooth(motion.root), cyclic=False)
    return share, jitter


def _refine_joint(motion: Motion, joint: str, seen: Array) -> Array:
    """Refined local rotations (T, 4) of one joint of arms or trunk."""
    q = clamp_to_limits(joint, motion.rotations[:, N[joint]])
    hinge = joint in HINGE_JOINTS
    size = 1 if hinge else 3
    near_limits = _near_limits(motion, [joint])
    if motion.cyclic and not near_limits:
        return q

    limit = JointLimitTerms(joint, len(q))

    def terms(x: Array, window: slice) -> tuple[Array, Array]:
        if near_limits:
            return limit.terms(q[window], x, window)
        return np.zeros((*x.shape, size)), np.zeros_like(x)

    turn = _rotation_differences(q, cyclic=motion.cyclic)
    x = gauss_newton(
        terms,
        np.full(size, UPPER_BODY_DEVIATION),
        np.repeat(seen[:, None], size, axis=1),
        turn[:, 1:2] if hinge else turn,
        rate=motion.rate,
        cyclic=motion.cyclic,
    )
    # A hand in an arbitrary pose may still exceed its limits after a few steps: clamp them.
    return clamp_to_limits(joint, multiply(q, from_axis_angle("Y", x[:, 0]) if hinge else from_rotvec(x)))


def _rotation_differences(q: Array, *, cyclic: bool) -> Array:
    """Second differences (T, 3) of rotations q (T, 4) in the joint's own frame; zero for a cycle.

    To first order, the second differences of corrected rotations are these plus those of the corrections x.
    """
    if cyclic:
        return np.zeros((len(q), 3))
    turns = to_rotvec(multiply(conjugate(q[:-1]), q[1:]))
    out = np.zeros((len(q), 3))
    out[1:-1] = turns[1:] - turns[:-1]
    return out


def _near_limits(motion: Motion, joints: list[str]) -> list[str]:
    """The joints that come near a limit in any frame."""
    near = []
    for joint in joints:
        angles, limits = swing_twist(motion.rotations[:, N[joint]]), LIMITS[joint]
        free = limits[:, 1] > limits[:, 0]
        inside = np.minimum(angles - limits[:, 0], limits[:, 1] - angles)[:, free]
        if (inside < LIMIT_PROXIMITY).any():
            near.append(joint)
    return near

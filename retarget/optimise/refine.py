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
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.humanoid.limits import HINGE_JOINTS, LIMITS, clamp_to_limits
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.banded import MIN_CYCLE_FRAMES, second_differences
from kinemimic.retarget.optimise.gauss_newton import gauss_newton
from kinemimic.retarget.optimise.leg_chain import (
    JOINT_COLUMNS,
    ROOT_POSITION,
    ROOT_ROTATION,
    UNKNOWNS,
    apply_corrections,
)
from kinemimic.retarget.optimise.leg_terms import LegTerms
from kinemimic.retarget.optimise.limit_terms import JointLimitTerms, near_limits

# Expected deviations (metres, radians) from the closed form.
ROOT_DEVIATION = (0.02, 0.02, 0.03)
ROOT_ROTATION_DEVIATION = np.radians(1.5)
_LEG_DEVIATIONS = {"hip": np.radians(4.0), "knee": np.radians(4.0), "ankle": np.radians(8.0)}
UPPER_BODY_DEVIATION = np.radians(4.0)
MIN_WEIGHT = 0.05  # weight of a joint that was not seen at all


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
    terms = LegTerms(motion, seen)
    deviation, weights = _leg_deviations(seen)
    return gauss_newton(
        terms.terms,
        deviation,
        weights,
        _leg_bending(motion),
        rate=motion.rate,
        cyclic=motion.cyclic,
        root_smoothing=_root_smoothing(motion),
        before_step=terms.update,
    )


def _leg_deviations(seen: Array) -> tuple[Array, Array]:
    """Expected deviations (UNKNOWNS,) of root and legs from the closed form, and weights (T, UNKNOWNS)."""
    deviation, weights = np.empty(UNKNOWNS), np.ones((len(seen), UNKNOWNS))
    deviation[ROOT_POSITION], deviation[ROOT_ROTATION] = ROOT_DEVIATION, ROOT_ROTATION_DEVIATION
    for joint, columns in JOINT_COLUMNS.items():
        deviation[columns] = _LEG_DEVIATIONS[joint.partition("_")[0]]
        weights[:, columns] = seen[:, N[joint], None]
    return deviation, weights


def _leg_bending(motion: Motion) -> Array:
    """Second differences (T, UNKNOWNS) of root and legs before correction; zero for a cycle."""
    cyclic = motion.cyclic
    bending = np.zeros((len(motion.root), UNKNOWNS))
    if not cyclic:
        bending[:, ROOT_POSITION] = second_differences(motion.root, cyclic=False)
    bending[:, ROOT_ROTATION] = _rotation_differences(motion.rotations[:, N["hip_center"]], cyclic=cyclic)
    for joint, columns in JOINT_COLUMNS.items():
        turn = _rotation_differences(motion.rotations[:, N[joint]], cyclic=cyclic)
        bending[:, columns] = turn[:, 1:2] if joint in HINGE_JOINTS else turn
    return bending


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
    limited = bool(near_limits(motion, [joint]))
    if motion.cyclic and not limited:
        return q

    limit = JointLimitTerms(joint, len(q))

    def terms(x: Array, window: slice) -> tuple[Array, Array]:
        if limited:
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

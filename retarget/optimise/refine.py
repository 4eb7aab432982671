"""The whole clip at once: feet that stay where they stand, on the ground, within the joints' limits.

A closed form puts each frame on the body by itself. Here all frames are moved together, as little as it
takes, by Gauss-Newton on one sum of squares: the soles of standing feet at their place on the ground; no
corner below it, nor any other part of the body; no joint beyond its limits; legs and joints as the closed
form has them, to the degree that they were seen; corrections (and for a recording as it was, the poses)
without jerks. Frames feel each other through second differences only, so that the normal equations are banded
and cost the same for each frame. Root and legs are one chain; arms and trunk, which no ground holds, are
refined joint by joint, before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
from kinemimic.retarget.feet.contact import find_stances
from kinemimic.retarget.humanoid.limits import HINGE_JOINTS, LIMITS, clamp_to_limits, swing_twist
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.banded import MIN_CYCLE_FRAMES, adjoint, second_differences, solve_blocks
from kinemimic.retarget.optimise.ground_terms import RELEASE, BodyGroundTerms, apply_corrections
from kinemimic.retarget.optimise.leg_chain import (
    ANKLE_COLUMNS,
    HIP_COLUMNS,
    KNEE_COLUMNS,
    ROOT_POSITION,
    ROOT_ROTATION,
    SIDES,
    UNKNOWNS,
    leg_chain,
    leg_jacobian,
    leg_points,
    normal_equations,
)
from kinemimic.retarget.optimise.limit_terms import JointLimitTerms
from kinemimic.retarget.optimise.one_sided import OneSided

# Of frames of a window, with corrections x (t, n): J'WJ (t, n, n) and J'Wr (t, n).
Terms = Callable[[Array, slice], tuple[Array, Array]]

# Of a loop, whose closed form is near; and of a recording as it was, which rolls, kneels and lands.
LOOP_ITERATIONS, ITERATIONS = 5, 8
# How far each is expected to be off (metres, radians): what the squares are measured by.
ROOT_DEVIATION = (0.02, 0.02, 0.03)
ROOT_ROTATION_DEVIATION = np.radians(1.5)
HIP_DEVIATION, KNEE_DEVIATION, ANKLE_DEVIATION = np.radians(4.0), np.radians(4.0), np.radians(8.0)
UPPER_BODY_DEVIATION = np.radians(4.0)
NODE_DEVIATION = 0.03  # knees and ankles, from the root
CONTACT_DEVIATION = 0.002  # a standing corner from its place on the ground
PENETRATION_DEVIATION = 0.002
HUBER_THRESHOLD = 2.0  # expected deviations, beyond which a correction counts linearly (Huber)
MIN_WEIGHT = 0.05  # weight of a joint that was not seen at all
# Hz, up to which change is free. A loop is a smooth series: its corrections shall be smooth too. A
# recording as it was trembles: its poses shall be smooth, whatever correction that takes.
CORRECTION_CUTOFF, POSE_CUTOFF = 3.5, 8.0
# Frames solved together, and how far beyond them a window looks: a correction is forgotten by then.
WINDOW, OVERLAP = 1500, 60
LIMIT_PROXIMITY = np.radians(15.0)  # joints that stay farther than this from their limits need no care


def refine(motion: Motion, seen: Array | None = None) -> Motion:
    """The motion with feet, ground and joint limits kept.

    motion: as the closed form has it, feet standing where `contacts` says; seen: (T, 20) 0 to 1, how well
    each node was, by default 1. Same frames, contacts and cycle_offset; a cycle stays closed. Cycles and
    clips of fewer than SHORTEST_CYCLE frames are returned as they are.
    """
    frames = len(motion.root)
    if frames < MIN_CYCLE_FRAMES:
        return motion
    weights = np.maximum(np.ones((frames, len(NODES))) if seen is None else seen, MIN_WEIGHT)
    rotations = motion.rotations.copy()
    for joint in LIMITS:
        if joint.partition("_")[0] not in ("hip", "knee", "ankle"):
            node = N[joint]
            rotations[:, node] = _refine_joint(motion, joint, weights[:, node])
    upper = replace(motion, rotations=rotations)
    found = apply_corrections(upper, _refine_legs(upper, weights))
    return replace(found, rotations=continuous(found.rotations))


def _refine_legs(motion: Motion, seen: Array) -> Array:
    """Corrections (T, 20) of root and legs."""
    chain = leg_chain(motion.root, motion.rotations)
    frames, cyclic = len(motion.root), motion.cyclic
    as_it_is = leg_points(chain, np.zeros((frames, UNKNOWNS)))
    standing = find_stances(motion.contacts, as_it_is[:, :, 2:], rate=motion.rate, cyclic=cyclic)
    hanging = as_it_is[:, :, :2] - motion.root[:, None, None]
    off = np.empty(UNKNOWNS)
    off[ROOT_POSITION], off[ROOT_ROTATION] = ROOT_DEVIATION, ROOT_ROTATION_DEVIATION
    weights = np.ones((frames, UNKNOWNS))
    bending = np.zeros((frames, UNKNOWNS))
    if not cyclic:
        bending[:, ROOT_POSITION] = second_differences(motion.root, cyclic=False)
    bending[:, ROOT_ROTATION] = _rotation_differences(motion.rotations[:, N["hip_center"]], cyclic=cyclic)
    node_weights = np.empty((frames, 2, 2, 1))
    for k, side in enumerate(SIDES):
        for joint, begin, size, expected in (
            ("hip", HIP_COLUMNS[k], 3, HIP_DEVIATION),
            ("knee", KNEE_COLUMNS[k], 1, KNEE_DEVIATION),
            ("ankle", ANKLE_COLUMNS[k], 3, ANKLE_DEVIATION),
        ):
            node, own = N[f"{joint}_{side}"], slice(begin, begin + size)
            off[own], weights[:, own] = expected, seen[:, node, None]
            turn = _rotation_differences(motion.rotations[:, node], cyclic=cyclic)
            bending[:, own] = turn[:, 1:2] if size == 1 else turn
        node_weights[:, k, :, 0] = seen[:, [N[f"knee_{side}"], N[f"ankle_{side}"]]] / NODE_DEVIATION**2
    watched = _near_limits(
        motion, [f"{joint}_{side}" for joint in ("hip", "knee", "ankle") for side in SIDES]
    )
    limits = {joint: JointLimitTerms(joint, frames) for joint in watched}
    anchors = np.zeros((frames, 2, 4, 2))
    ground, rest = OneSided((frames, 2, 4), RELEASE), BodyGroundTerms(motion)

    def terms(x: Array, window: slice) -> tuple[Array, Array]:
        points, jacobian = leg_jacobian(chain.window(window), x)
        root = chain.root[window] + x[:, ROOT_POSITION]
        # Knees and ankles are asked for where they hang from the root, wherever that goes.
        jacobian[:, :, :2, :, ROOT_POSITION] = 0.0
        residual, weight = np.empty_like(points), np.empty_like(points)
        residual[:, :, :2] = points[:, :, :2] - root[:, None, None] - hanging[window]
        weight[:, :, :2] = node_weights[window] * _huber(residual[:, :, :2] / NODE_DEVIATION)
        corners, hold = points[:, :, 2:], standing.hold[window]
        residual[:, :, 2:, :2] = corners[..., :2] - anchors[window]
        residual[:, :, 2:, 2] = corners[..., 2]
        sinks = ground.weight(corners[..., 2], window) / PENETRATION_DEVIATION**2
        weight[:, :, 2:] = hold[..., None] / CONTACT_DEVIATION**2
        weight[:, :, 2:, 2] = np.maximum(weight[:, :, 2:, 2], sinks)
        square, right = normal_equations(jacobian, residual, weight)
        for joint in watched:
            side = SIDES.index(joint.rpartition("_")[2])
            begin = {"hip": HIP_COLUMNS, "knee": KNEE_COLUMNS, "ankle": ANKLE_COLUMNS}[
                joint.partition("_")[0]
            ][side]
            own = slice(begin, begin + (1 if joint in HINGE_JOINTS else 3))
            held, pull = limits[joint].terms(motion.rotations[window, N[joint]], x[:, own], window)
            square[:, own, own] += held
            right[:, own] += pull
        held, pull = rest.terms(window, PENETRATION_DEVIATION)
        square[:, :6, :6] += held
        right[:, :6] += pull
        return square, right

    def place(x: Array) -> None:
        rest.look(x)
        corners = leg_points(chain, x)[:, :, 2:]
        anchors[:] = standing.anchors(corners, motion.cycle_offset)

    return _gauss_newton(
        terms,
        off,
        weights,
        bending,
        rate=motion.rate,
        cyclic=cyclic,
        calm=_root_smoothing(motion),
        before=place,
    )


def _root_smoothing(motion: Motion) -> tuple[Array, Array]:
    """Of a recording as it was: by how much each correction (SIZE,) shall be calmer than it is already, and
    what of the recording (T, SIZE), in second differences, is not to be kept. Of a cycle, nothing.

    A foot that lands or leaves pulls at the root in a few frames, and a body of 48 kg is thrown by that as no
    ground could: the legs shall give way instead. The root's path in the recording, without its tremor, has
    the accelerations that the person had.
    """
    share, tremor = np.zeros(UNKNOWNS), np.zeros((len(motion.root), UNKNOWNS))
    if motion.cyclic:
        return share, tremor
    share[ROOT_POSITION] = 1.0
    if (smooth := zero_phase(motion.rate)) is not None:
        tremor[:, ROOT_POSITION] = second_differences(motion.root - smooth(motion.root), cyclic=False)
    return share, tremor


def _refine_joint(motion: Motion, joint: str, seen: Array) -> Array:
    """Refined local rotations (T, 4) of one joint that no ground holds."""
    q = clamp_to_limits(joint, motion.rotations[:, N[joint]])
    hinge = joint in HINGE_JOINTS
    size = 1 if hinge else 3
    watched = _near_limits(motion, [joint])
    if motion.cyclic and not watched:
        return q

    limit = JointLimitTerms(joint, len(q))

    def terms(x: Array, window: slice) -> tuple[Array, Array]:
        if watched:
            return limit.terms(q[window], x, window)
        return np.zeros((*x.shape, size)), np.zeros_like(x)

    turn = _rotation_differences(q, cyclic=motion.cyclic)
    x = _gauss_newton(
        terms,
        np.full(size, UPPER_BODY_DEVIATION),
        np.repeat(seen[:, None], size, axis=1),
        turn[:, 1:2] if hinge else turn,
        rate=motion.rate,
        cyclic=motion.cyclic,
    )
    # A hand that points anywhere is still somewhat beyond: what no few steps bring back is cut off.
    return clamp_to_limits(joint, multiply(q, from_axis_angle("Y", x[:, 0]) if hinge else from_rotvec(x)))


def _gauss_newton(
    terms: Terms,
    off: Array,
    weights: Array,
    bending: Array,
    *,
    rate: float,
    cyclic: bool,
    calm: tuple[Array, Array] | None = None,
    before: Callable[[Array], None] | None = None,
) -> Array:
    """Corrections x (T, n) with the least sum of `terms`, of x / off, weighted (T, n), and of second
    differences.

    bending: (T, n) second differences of what must be smooth besides x; calm: see `_root_smoothing`; `before`
    is called with x ahead of each step. A long clip is solved in windows that overlap: far from its ends a
    window's solution is that of the whole, and what is left of the difference the next step takes.
    """
    frames, n = weights.shape
    x = np.zeros((frames, n))
    stiffness = _stiffness(CORRECTION_CUTOFF if cyclic else POSE_CUTOFF, rate) / off**2
    share, tremor = (np.zeros(n), np.zeros((frames, n))) if calm is None else calm
    calming = _stiffness(CORRECTION_CUTOFF, rate) * share / off**2
    at = np.arange(n)
    for _ in range(LOOP_ITERATIONS if cyclic else ITERATIONS):
        if before is not None:
            before(x)
        step = np.empty_like(x)
        for window, core in _windows(frames, cyclic=cyclic):
            now = x[window]
            square, right = terms(now, window)
            rest = weights[window] * _huber(now / off) / off**2
            square[:, at, at] += rest
            own = second_differences(now, cyclic=cyclic)
            bend = (own + bending[window]) * stiffness + (own + tremor[window]) * calming
            right += rest * now + adjoint(bend, cyclic=cyclic)
            found = solve_blocks(square, stiffness + calming, -right, cyclic=cyclic)
            step[core] = found[core.start - window.start : core.stop - window.start]
        x += step
    return x


def _windows(frames: int, *, cyclic: bool) -> Iterator[tuple[slice, slice]]:
    """Windows over a clip, and the part of each whose solution counts; a cycle is one."""
    length = frames if cyclic else WINDOW
    for start in range(0, frames, length):
        # However short the last part is: it looks back into the one before.
        stop = min(start + length, frames)
        yield slice(max(0, start - OVERLAP), min(frames, stop + OVERLAP)), slice(start, stop)


def _stiffness(band: float, rate: float) -> float:
    """What second differences weigh so that a sine of `band` Hz is halved: 1 / (2 sin(π band / rate))⁴."""
    return float((2.0 * np.sin(np.pi * min(band / rate, 0.5))) ** -4)


def _huber(ratio: Array) -> Array:
    return 1.0 / np.maximum(1.0, np.abs(ratio) / HUBER_THRESHOLD)


def _rotation_differences(q: Array, *, cyclic: bool) -> Array:
    """Of a recording, second differences (T, 3) of rotations q (T, 4), in the joint's own frame; 0 of a loop.

    To first order in small corrections x those of the corrected rotations are these and those of x.
    """
    if cyclic:
        return np.zeros((len(q), 3))
    turns = to_rotvec(multiply(conjugate(q[:-1]), q[1:]))
    out = np.zeros((len(q), 3))
    out[1:-1] = turns[1:] - turns[:-1]
    return out


def _near_limits(motion: Motion, joints: list[str]) -> list[str]:
    """The joints that somewhere come near a limit."""
    near = []
    for joint in joints:
        angles, limits = swing_twist(motion.rotations[:, N[joint]]), LIMITS[joint]
        free = limits[:, 1] > limits[:, 0]
        inside = np.minimum(angles - limits[:, 0], limits[:, 1] - angles)[:, free]
        if (inside < LIMIT_PROXIMITY).any():
            near.append(joint)
    return near

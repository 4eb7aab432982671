"""Orientations of the 20 nodes from their positions alone.

A node's rotation is that of the body which hangs from it; the identity everywhere is a figure that stands
upright with hanging arms and looks along +X (Y left, Z up). Points do not show the twist of a single bone:
it is taken from the bend of the next joint. So that knees and elbows stay pure hinges about their local Y
(knee: flexion turns about +Y and takes the shank backward; elbow: about -Y, the forearm forward), that
twist belongs to the thigh and the upper arm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.angles import pelvis_frame
from kinemimic.pipeline.rotations import (
    IDENTITY,
    conjugate,
    continuous,
    from_axis_angle,
    from_two_axes,
    multiply,
    normalize,
    rotate,
)
from kinemimic.pipeline.skeleton import NODE_INDEX as N
from kinemimic.pipeline.skeleton import NODE_PARENTS, NODES

Array = NDArray[np.float64]

# Sine of the bend below which the hinge axis fades from the bend's own normal to the parent's lateral axis:
# near straight the normal is mere noise, and at straight it does not exist.
BEND_FADE = 0.15
# Angle below the horizontal of the line from ankle to toe of a foot that stands flat.
FOOT_DROP = 0.205
_DOWN = np.array([0.0, 0.0, -1.0])
_UP = -_DOWN
_LEFT = np.array([0.0, 1.0, 0.0])
# No field of frames is continuous over all directions of a bone. Swinging by way of a direction somewhat in
# front puts the one singular direction opposite to it, where neither a thigh nor an upper arm can point.
_BY_WAY_OF = {
    "leg": np.array([np.sin(0.8), 0.0, -np.cos(0.8)]),
    "arm": np.array([np.sin(0.5), 0.0, -np.cos(0.5)]),
}


def node_rotations(positions: Array) -> Array:
    """Local rotations (T, 20, 4), child to parent, sign-continuous, from positions (T, 20, 3) in metres.

    End nodes (head, hands, feet) get the identity. A rotation that hangs on a missing (NaN) or coinciding
    node is NaN, the others are not.
    """
    return local_rotations(node_frames(positions))


def node_frames(positions: Array, *, pelvis: Array | None = None, torso: Array | None = None) -> Array:
    """World frames (T, 20, 4) of the bodies at the nodes; end nodes have their parent's.

    pelvis, torso: (T, 4) world frames to use in place of the measured ones; knees, elbows and the
    continuity of thighs and upper arms are then taken relative to them.
    """
    p = np.asarray(positions, dtype=np.float64)
    frames = np.full((len(p), len(NODES), 4), np.nan)

    def vector(start: str, end: str) -> Array:
        v = p[:, N[end]] - p[:, N[start]]
        v[np.linalg.norm(v, axis=-1) < 1e-6] = np.nan
        return v

    frames[:, N["hip_center"]] = _measured_pelvis(p) if pelvis is None else pelvis
    trunk = _frame(vector("spine", "shoulder_center"), vector("shoulder_right", "shoulder_left"), "ZY")
    frames[:, N["spine"]] = trunk if torso is None else torso
    lateral = rotate(frames[:, N["spine"]], _LEFT)
    frames[:, N["shoulder_center"]] = _frame(vector("shoulder_center", "head"), lateral, "ZY")
    for side in ("left", "right"):
        for limb, parent, joints in (
            ("leg", "hip_center", ("hip", "knee", "ankle", "foot")),
            ("arm", "spine", ("shoulder", "elbow", "wrist", "hand")),
        ):
            first, hinge, last, end = (f"{joint}_{side}" for joint in joints)
            upper, lower = vector(first, hinge), vector(hinge, last)
            frames[:, N[first]] = _upper_limb(frames[:, N[parent]], upper, lower, limb, side)
            frames[:, N[hinge]] = _below_hinge(frames[:, N[first]], lower)
            axis = rotate(frames[:, N[hinge]], _LEFT)
            if limb == "leg":
                toe = _frame(vector(last, end), axis, "XY")
                frames[:, N[last]] = multiply(toe, from_axis_angle("Y", -FOOT_DROP))
            else:
                frames[:, N[last]] = _frame(-vector(last, end), axis, "ZY")
            frames[:, N[end]] = frames[:, N[last]]
    frames[:, N["head"]] = frames[:, N["shoulder_center"]]
    return frames


def local_rotations(frames: Array) -> Array:
    """Rotations (T, 20, 4) of each body relative to its parent's, from world frames (T, 20, 4)."""
    local = frames.copy()
    for node, parent in enumerate(NODE_PARENTS):
        if parent >= 0:
            local[:, node] = multiply(conjugate(frames[:, parent]), frames[:, node])
    local[:, [N["head"], N["hand_left"], N["hand_right"], N["foot_left"], N["foot_right"]]] = IDENTITY
    return continuous(local)


def _frame(primary: Array, secondary: Array, names: str) -> Array:
    """`from_two_axes` where both vectors are there and not parallel, NaN elsewhere."""
    frames = np.full((len(primary), 4), np.nan)
    across = np.linalg.norm(np.cross(primary, secondary), axis=-1)
    good = across > 1e-9 * np.linalg.norm(primary, axis=-1) * np.linalg.norm(secondary, axis=-1)
    if good.any():
        frames[good] = from_two_axes(primary[good], secondary[good], names)
    return frames


def _measured_pelvis(p: Array) -> Array:
    joints = [p[:, N[name]] for name in ("hip_left", "hip_right", "hip_center", "spine")]
    lateral, up = joints[0] - joints[1], joints[3] - joints[2]
    frames = np.full((len(p), 4), np.nan)
    across = np.linalg.norm(np.cross(lateral, up), axis=-1)
    good = across > 1e-9
    if good.any():
        frames[good] = pelvis_frame(*(joint[good] for joint in joints))
    return frames


def _shortest(start: Array, end: Array) -> Array:
    """The turn (..., 4) by the smallest angle that takes unit vector start to unit vector end."""
    q = np.concatenate([np.cross(start, end), 1.0 + np.sum(start * end, axis=-1, keepdims=True)], axis=-1)
    return normalize(np.where(q[..., 3:] > 1e-9, q, [0.0, 1.0, 0.0, 0.0]))


def _upper_limb(parent: Array, upper: Array, lower: Array, limb: str, side: str) -> Array:
    """World frames (T, 4) of thigh or upper arm: -Z along the bone, Y along the hinge axis of the next joint.

    The bone's direction alone gives an untwisted frame (the shortest swing from the parent); the bend of the
    next joint then gives the twist, to the degree that there is a bend.
    """
    direction = upper / np.linalg.norm(upper, axis=-1, keepdims=True)
    middle = _BY_WAY_OF[limb]
    to_middle = _shortest(_DOWN, middle)
    local = rotate(conjugate(parent), direction)
    swing = multiply(parent, multiply(_shortest(np.broadcast_to(middle, local.shape), local), to_middle))
    below = rotate(conjugate(swing), lower / np.linalg.norm(lower, axis=-1, keepdims=True))
    if limb == "leg":
        # Along: the bend about the lateral axis, backward positive; a knee also bends somewhat to the front
        # (by noise or hyperextension), where its axis must not turn over: odd in `along`, so it does not.
        along, across = -below[:, 0], below[:, 1]
        twist = np.arctan(across * along / (along**2 + BEND_FADE**2))
        # The shank's sideways part goes to the left (+Y) when the thigh, knee bent, is turned about its
        # axis so that "backward" looks left: clockwise from above.
        return multiply(swing, from_axis_angle("Z", -twist))
    # A forearm bends to one side only, but the upper arm turns inward far enough to put the hand behind the
    # back: count its turn from 60 degrees inward, so that the cut lies outward, where no forearm points.
    inward = 1.0 if side == "right" else -1.0
    centre = inward * np.pi / 3.0
    bend = np.hypot(below[:, 0], below[:, 1])
    turn = np.arctan2(below[:, 1], below[:, 0])
    turn = centre + np.mod(turn - centre + np.pi, 2.0 * np.pi) - np.pi
    return multiply(swing, from_axis_angle("Z", turn * bend**2 / (bend**2 + BEND_FADE**2)))


def _below_hinge(above: Array, lower: Array) -> Array:
    """World frames (T, 4) of shank or forearm: turned about the Y of the bone above, -Z towards `lower`."""
    local = rotate(conjugate(above), lower)
    return multiply(above, from_axis_angle("Y", np.arctan2(-local[:, 0], -local[:, 2])))

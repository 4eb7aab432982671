"""Orientations of the 20 nodes from their positions alone.

A node's rotation is that of the body segment below it. The identity everywhere is a person who stands
upright with hanging arms and looks along +X (Y left, Z up). Points do not show the twist of a single bone;
it is taken from the bend of the next joint. The twist belongs to the thigh and the upper arm, so that knees
and elbows stay pure hinges about their local Y (knee: flexion about +Y, the shank backward; elbow: about -Y,
the forearm forward).
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.orientation.trunk import direction, pelvis_frames, swing, torso_frames
from kinemimic.pipeline.kinematics.orientation.twist import follow_twist
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    conjugate,
    continuous,
    from_axis_angle,
    multiply,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES, SIDES

# Radians by which the line from ankle to toe of a flat foot points below the horizontal.
FOOT_DROP = 0.205
_DOWN = np.array([0.0, 0.0, -1.0])
_UP = -_DOWN
# A bone is swung in two steps, through a direction in the middle of its range: the one direction at which
# the swing is undefined is then opposite to it, behind and above the hip or behind the shoulder, where no
# bone can point.
_BY_WAY_OF = {
    "leg": np.array([np.sin(0.8), 0.0, -np.cos(0.8)]),
    "arm": np.array([np.sin(1.2), 0.0, -np.cos(1.2)]),
}
# Largest angle of a limb from that direction, and of a head, hand, foot or trunk from its rest direction.
_LIMB, _END = np.radians(150.0), np.radians(120.0)
_TOE = np.array([np.cos(FOOT_DROP), 0.0, -np.sin(FOOT_DROP)])
# Sine of the bend above which any twist of the thigh is accepted, for example of a person sitting
# cross-legged; a straighter knee may also appear beside the leg because of the sensor's error.
_BENT = 0.5


def node_rotations(positions: Array) -> Array:
    """Local rotations (T, 20, 4), child to parent, sign-continuous, from positions (T, 20, 3) in metres.

    End nodes (head, hands, feet) get the identity. A rotation that depends on a missing (NaN) or coinciding
    node is NaN; the others are not affected.
    """
    return local_rotations(node_frames(positions))


def node_frames(
    positions: Array,
    *,
    pelvis: Array | None = None,
    torso: Array | None = None,
    recorded: Array | None = None,
) -> Array:
    """World frames (T, 20, 4) of the body segments at the nodes; end nodes have their parent's.

    positions: (T, 20, 3), consecutive frames: where the points do not show a bone's twist, it is carried over
    from frame to frame (twist.py). pelvis, torso: (T, 4) world frames that replace the measured ones; the
    segments attached to them are then relative to them. recorded: (T, 20, 4) world frames of the nodes from a
    recorder's own rotations, NaN where missing: limbs keep their measured directions, and the recorded twist
    is used where no hinge shows one.
    """
    p = np.asarray(positions, dtype=np.float64)
    frames = np.full((len(p), len(NODES), 4), np.nan)
    known = frames if recorded is None else recorded

    frames[:, N["hip_center"]] = (
        _first(known[:, N["hip_center"]], pelvis_frames(p)) if pelvis is None else pelvis
    )
    frames[:, N["spine"]] = _first(known[:, N["spine"]], torso_frames(p)) if torso is None else torso
    head = _swung(frames[:, N["spine"]], _UP, direction(p, "shoulder_center", "head"))
    frames[:, N["shoulder_center"]] = _first(known[:, N["shoulder_center"]], head)
    for side in SIDES:
        for limb, parent, joints in (
            ("leg", "hip_center", ("hip", "knee", "ankle", "foot")),
            ("arm", "spine", ("shoulder", "elbow", "wrist", "hand")),
        ):
            first, hinge, last, end = (f"{joint}_{side}" for joint in joints)
            upper, lower = direction(p, first, hinge), direction(p, hinge, last)
            above = frames[:, N[parent]]
            frames[:, N[first]] = _upper_limb(above, known[:, N[first]], upper, lower, limb)
            frames[:, N[hinge]] = _below_hinge(frames[:, N[first]], lower)
            at_rest = _TOE if limb == "leg" else _DOWN
            swung = _swung(frames[:, N[hinge]], at_rest, direction(p, last, end))
            frames[:, N[last]] = _first(known[:, N[last]], swung)
            frames[:, N[end]] = frames[:, N[last]]
    frames[:, N["head"]] = frames[:, N["shoulder_center"]]
    return frames


def local_rotations(frames: Array) -> Array:
    """Rotations (T, 20, 4) of each segment relative to its parent's, from world frames (T, 20, 4)."""
    local = frames.copy()
    for node, parent in enumerate(NODE_PARENTS):
        if parent >= 0:
            local[:, node] = multiply(conjugate(frames[:, parent]), frames[:, node])
    local[:, [N["head"], N["hand_left"], N["hand_right"], N["foot_left"], N["foot_right"]]] = IDENTITY
    return continuous(local)


def _first(preferred: Array, otherwise: Array) -> Array:
    """Frames (T, 4): the preferred ones, or the others where those are NaN."""
    return np.where(np.isfinite(preferred), preferred, otherwise)


def _swung(parent: Array, at_rest: Array, towards: Array) -> Array:
    """World frames (T, 4): the parent's, turned so that `at_rest` (3,) points along `towards` (T, 3).

    For a head, hand or foot, whose twist cannot be seen from positions.
    """
    return multiply(parent, swing(at_rest, rotate(conjugate(parent), towards), _END))


def _upper_limb(parent: Array, recorded: Array, upper: Array, lower: Array, limb: str) -> Array:
    """World frames (T, 4) of thigh or upper arm: -Z along the bone, Y along the hinge axis of the next joint.

    The bone's direction alone gives an untwisted frame, the swing from the parent, unless one is recorded;
    the bend of the next joint then gives the twist.
    """
    middle = _BY_WAY_OF[limb]
    local = rotate(conjugate(parent), upper)
    untwisted = _first(
        multiply(conjugate(parent), _swung(recorded, _DOWN, upper)),
        multiply(swing(middle, local, _LIMB), swing(_DOWN, middle, _LIMB)),
    )
    shank = rotate(conjugate(parent), lower)
    below = rotate(conjugate(untwisted), shank)
    # The direction of the bend: an elbow to the front of its axis, a knee to the back.
    ahead, aside = (below[:, 0], below[:, 1]) if limb == "arm" else (-below[:, 0], -below[:, 1])
    bend = np.hypot(ahead, aside)
    if limb == "leg":
        # A nearly straight knee may also bend to the front, through noise or hyperextension; its axis must
        # not flip there. A sideways bend is the sensor's error, not a twisted thigh. A bend of more than 45
        # degrees to the front is not a leg's.
        ahead = np.where(ahead < -np.sin(np.pi / 4.0), np.nan, ahead)
        along = np.abs(ahead) / np.where(bend > 0, bend, 1.0)
        ahead, aside = np.abs(ahead), np.where(ahead < 0, -aside, aside)
        bend = bend * np.clip(along / np.clip(1.0 - 0.75 * bend / _BENT, 0.25, 1.0), 0.0, 1.0) ** 2
    turn = follow_twist(np.arctan2(aside, ahead), bend, np.stack([local, shank], axis=1))
    return multiply(parent, multiply(untwisted, from_axis_angle("Z", turn)))


def _below_hinge(above: Array, lower: Array) -> Array:
    """World frames (T, 4) of shank or forearm: turned about the Y of the bone above, -Z towards `lower`.

    NaN where `lower` is more than 60 degrees out of the plane in which the joint bends.
    """
    local = rotate(conjugate(above), lower)
    in_plane = np.hypot(local[:, 0], local[:, 2])
    seen = np.where(in_plane > 0.5, np.arctan2(-local[:, 0], -local[:, 2]), np.nan)
    return multiply(above, from_axis_angle("Y", follow_twist(seen, in_plane, local[:, None])))

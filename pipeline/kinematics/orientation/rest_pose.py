"""Convert the recorded rotations of any skeleton to those of the 20 nodes, by matching rest poses.

A recorder's joint frames follow its own rest pose: arms out in a T or an A, or, in a sensor's SDK, axes along
the bones. Each differs from our body segment's frame by a constant rotation, which is estimated from the
recording itself: the frames that its positions show (from_positions.py), relative to the recorder's joint,
averaged over time. So the same motion on a skeleton with another rest pose gives the same rotations.
Rotations that positions cannot show are kept as recorded: the twist of a straight limb, of the head, of the
foot, a forearm's pronation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.euler import rotations_of_channels
from kinemimic.pipeline.kinematics.nodes import joints_of, to_nodes
from kinemimic.pipeline.kinematics.orientation.from_positions import local_rotations, node_frames
from kinemimic.pipeline.kinematics.orientation.trunk import direction, swing
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    angle_between,
    conjugate,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES, SIDES, Skeleton
from kinemimic.pipeline.kinematics.spans import all_finite

# A joint's frame is accepted if it agrees with the positions to this (rms, radians).
_AGREES = np.radians(25.0)
# Frames, spread over the clip, that are enough to estimate constants of an hour's recording.
_ENOUGH = 4000
# Spreads (radians) of a bone in two joints' frames that count as equal: the joint nearer to the root wins.
_SAME = np.radians(0.3)
# Nodes that the segment at a node carries, the first of them along its line.
_CARRIES: dict[str, tuple[str, ...]] = {
    "hip_center": ("hip_left", "hip_right"),
    "spine": ("shoulder_left", "shoulder_right"),
    "shoulder_center": ("head",),
    **{
        f"{start}_{side}": (f"{end}_{side}",)
        for side in SIDES
        for start, end in (
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
            ("wrist", "hand"),
            ("hip", "knee"),
            ("knee", "ankle"),
            ("ankle", "foot"),
        )
    },
}
# Segments whose twist cannot be seen from positions: at rest they are aligned with the segment above, with
# this axis along their line. (A foot, which only needs to be level on average, is averaged.)
_ENDS: dict[str, Array] = {
    "shoulder_center": np.array([0.0, 0.0, 1.0]),
    "wrist_left": np.array([0.0, 0.0, -1.0]),
    "wrist_right": np.array([0.0, 0.0, -1.0]),
}
_HINGES = ("knee_left", "knee_right", "elbow_left", "elbow_right")


@dataclass(frozen=True)
class NodeRotations:
    """rotations: (T, 20, 4), child to parent, sign-continuous, of the segments at the nodes; NaN if unknown.

    sources: node -> the recorder's joint whose rotation was taken; the other nodes follow the positions.
    off_axis: knee or elbow -> mean angle (radians) between the recorded joint and the pure hinge; the
    difference went into the twist of the limb above and to the foot or hand below.
    """

    rotations: Array
    sources: dict[str, str]
    off_axis: dict[str, float]


def node_rotations_of(clip: Clip) -> NodeRotations:
    """Rotations of the 20 nodes, as recorded if the clip has rotations that fit its positions.

    Knees and elbows are pure hinges. Raises KinemimicError, as `nodes.to_nodes`, if the clip lacks nodes.
    """
    positions = to_nodes(clip)[0]
    shown = node_frames(positions)
    local = _recorded(clip)
    if local is None:
        return NodeRotations(local_rotations(shown), {}, {})
    world = forward_kinematics(clip.skeleton, np.zeros((*local.shape[:2], 3)), local)[1]
    if clip.skeleton.names == NODES and clip.skeleton.parents == NODE_PARENTS:
        recorded, sources = world, {node: node for node in _CARRIES}
    else:
        rows = np.unique(np.linspace(0, len(world) - 1, min(len(world), _ENOUGH)).astype(np.intp))
        matched = _offsets(clip, world[rows], positions[rows], shown[rows])
        recorded = np.full_like(shown, np.nan)
        for node, (joint, offset) in matched.items():
            recorded[:, N[node]] = multiply(world[:, joint], offset)
        sources = {node: clip.skeleton.names[joint] for node, (joint, _) in matched.items()}
    frames = node_frames(positions, recorded=recorded)
    return NodeRotations(local_rotations(frames), sources, _off_axis(recorded, frames))


def recorded_knees(clip: Clip) -> dict[str, Array]:
    """Knee flexion (T,) in radians about the hinge, by name, of a clip whose joints are the 20 nodes and have
    rotations of their own; empty for any other.

    Such files come from this program. The knees of its simulated body also give way to the side, which the
    angle between thigh and shank would include.
    """
    names, parents = clip.skeleton.names, clip.skeleton.parents
    above = {name: names[parent] if parent >= 0 else "" for name, parent in zip(names, parents, strict=True)}
    nodes = zip(NODES, NODE_PARENTS, strict=True)
    if any(above.get(node) != (NODES[parent] if parent >= 0 else "") for node, parent in nodes):
        return {}
    local = _recorded(clip)
    if local is None:
        return {}
    # Rotations are about the axes of the file.
    lateral = rotate(conjugate(clip.world_from_file), np.array([0.0, 1.0, 0.0]))
    knees = (f"knee_{side}" for side in SIDES)
    return {knee: to_rotvec(local[:, names.index(knee)]) @ lateral for knee in knees}


def _recorded(clip: Clip) -> Array | None:
    """Local rotations (T, J, 4) of the clip's own joints, if it has any."""
    if clip.rotations is not None or clip.euler is None or clip.orders is None:
        return clip.rotations
    return rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)


def _offsets(clip: Clip, world: Array, positions: Array, shown: Array) -> dict[str, tuple[int, Array]]:
    """Node -> the recorder's joint that turns its segment, and our frame's rotation (4,) relative to it.

    world: (M, J, 4) of the joints, positions: (M, 20, 3), shown: (M, 20, 4), of M frames of the clip.
    """
    found, rest = joints_of(clip), _rest(clip)
    matched: dict[str, tuple[int, Array]] = {}
    at_rest: dict[str, Array] = {}
    for node, carried in _CARRIES.items():
        joint = _carrier(clip.skeleton, world, positions, found, node, carried)
        if joint is None:
            continue
        above = NODES[NODE_PARENTS[N[node]]]
        frames, weight = shown[:, N[node]], _visible(node, positions)
        by_rest = node in _ENDS and rest is not None and above in at_rest
        if by_rest and rest is not None:
            offset = multiply(conjugate(rest[joint]), at_rest[above])
            line = rotate(
                conjugate(multiply(world[:, joint], offset)), direction(positions, node, carried[0])
            )
            offset = multiply(offset, swing(_ENDS[node], _mean_direction(line), np.pi))
        else:
            offset = _mean(multiply(conjugate(world[:, joint]), frames), weight)
        apart = angle_between(multiply(world[:, joint], offset), frames)
        clear = np.isfinite(apart) & (weight > 0.1)
        if not by_rest and clear.any() and np.sqrt(np.mean(apart[clear] ** 2)) > _AGREES:
            continue
        matched[node] = joint, offset
        if rest is not None:
            at_rest[node] = multiply(rest[joint], offset)
    return matched


def _carrier(
    skeleton: Skeleton,
    world: Array,
    positions: Array,
    found: dict[str, int],
    node: str,
    carried: tuple[str, ...],
) -> int | None:
    """The joint in whose frame the segment at a node is at rest.

    In a BVH that is the joint it hangs from, in a Kinect's tree the one it ends at; of a neck's many joints,
    the head's own.
    """
    if any(end not in found for end in carried):
        return None
    chains = [_chain(skeleton, found.get(node), found[end]) for end in carried]
    joints = [j for j in chains[0] if all(j in chain for chain in chains) and np.isfinite(world[:, j]).any()]
    if node == "shoulder_center" or not joints:
        return joints[-1] if joints else None
    spreads = np.array([max(_spread(world[:, j], positions, node, end) for end in carried) for j in joints])
    return joints[int(np.argmax(spreads <= spreads.min() + _SAME))]


def _chain(skeleton: Skeleton, start: int | None, end: int) -> list[int]:
    """Joints from `start` down to `end`; from the root if `start` is not above `end`."""
    chain = [end]
    while skeleton.parents[chain[-1]] >= 0 and chain[-1] != start:
        chain.append(skeleton.parents[chain[-1]])
    return chain[::-1]


def _spread(frames: Array, positions: Array, node: str, end: str) -> float:
    """Rms angle (radians) of the line between two nodes about its mean, seen from frames (T, 4)."""
    line = rotate(conjugate(frames), direction(positions, node, end))
    if not np.isfinite(line).all(axis=-1).any():
        return float("inf")
    return float(np.sqrt(max(0.0, 1.0 - np.sum(np.nanmean(line, axis=0) ** 2))))


def _mean_direction(line: Array) -> Array:
    """Unit vector (3,) along the mean of unit vectors (T, 3), NaN left out."""
    mean = np.nanmean(line, axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def _visible(node: str, positions: Array) -> Array:
    """How well positions show the twist of the segment at a node, 0 to 1 (T,): of a limb, by its bend."""
    joint, _, side = node.partition("_")
    chain = {"shoulder": "arm", "elbow": "arm", "hip": "leg", "knee": "leg"}.get(joint)
    if chain is None or side not in SIDES:
        return np.ones(len(positions))
    first, hinge, last = ("shoulder", "elbow", "wrist") if chain == "arm" else ("hip", "knee", "ankle")
    upper = direction(positions, f"{first}_{side}", f"{hinge}_{side}")
    lower = direction(positions, f"{hinge}_{side}", f"{last}_{side}")
    bend = np.sum(np.cross(upper, lower) ** 2, axis=-1)
    return np.asarray(np.where(np.isfinite(bend), bend, 0.0))


def _mean(turns: Array, weight: Array) -> Array:
    """Robust weighted mean (4,) of rotations (T, 4)."""
    seen = np.isfinite(turns).all(axis=-1)
    q, given = turns[seen], weight[seen] + 1e-6
    if not len(q):
        return np.full(4, np.nan)
    w = given
    for _ in range(8):
        mean = np.linalg.eigh(np.einsum("m,mi,mj->ij", w, q, q))[1][:, -1]
        w = given / (1.0 + (angle_between(np.broadcast_to(mean, q.shape), q) / np.radians(5.0)) ** 2)
    return np.asarray(mean)


def _rest(clip: Clip) -> Array | None:
    """World rotations (J, 4) of the joints with all channels at zero; None unless that pose is upright."""
    if clip.euler is None or clip.translations is None:
        return None
    joints = len(clip.skeleton.names)
    turned = (np.tile(IDENTITY, (joints, 1)) if clip.rests is None else clip.rests)[None].copy()
    turned[:, 0] = multiply(clip.world_from_file, turned[:, 0])
    known = clip.translations[all_finite(clip.translations, axis=(1, 2))]
    if not len(known):
        return None
    offsets = np.median(known, axis=0)[None]
    places, frames = forward_kinematics(clip.skeleton, offsets, turned)
    found = joints_of(clip)
    # Upward along each leg, in a standing skeleton.
    chains = [[found.get(f"{joint}_{side}") for joint in ("ankle", "knee", "hip")] for side in SIDES]
    steps = [(a, b) for chain in chains for a, b in pairwise(chain) if a is not None and b is not None]
    ups = [places[0, b] - places[0, a] for a, b in steps]
    stands = all(up[2] > 0.8 * np.linalg.norm(up) for up in ups)
    return frames[0] if stands else None


def _off_axis(recorded: Array, frames: Array) -> dict[str, float]:
    """Mean angle (radians) between recorded knees and elbows and those of frames (T, 20, 4)."""
    angles: dict[str, float] = {}
    for node in _HINGES:
        joint, above = N[node], NODE_PARENTS[N[node]]
        pair = [multiply(conjugate(f[:, above]), f[:, joint]) for f in (recorded, frames)]
        apart = angle_between(*pair)
        if np.isfinite(apart).any():
            angles[node] = float(np.nanmean(apart))
    return angles

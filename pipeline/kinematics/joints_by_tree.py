"""The joints of a body whose names say nothing (joint_12, 左足, Oberschenkel), by the tree and their motion.

A body has two pairs of equal limbs. The longer pair are the legs; of each limb the two longest bones that
follow each other are thigh and shank, or upper arm and forearm; joints for twist do not bend, and are passed
over. The toes point forward, which tells left from right.
"""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.kinematics.vectors import perpendicular, unit

# Frames, spread over the recording, that suffice.
_FRAMES = 200
# Bones shorter than this share of their limb are ignored; paired limbs have bones of the same lengths to this
# share; the lengths of the two main bones of a limb differ by this factor at most.
_NO_BONE, _SAME, _ALIKE = 0.01, 0.15, 2.4
# A joint that bends by less than this, in every frame and by less than the other between them, is for twist.
_STRAIGHT, _STILL = np.radians(12.0), np.radians(3.0)
# Arm (without the hand) and trunk over leg (without the foot), in a person; the largest angle between trunk
# and legs, as in sitting; share of frames in which left must be left.
_ARMS, _TRUNK, _SITTING, _CLEAR = (0.45, 0.9), (0.35, 0.95), np.radians(100.0), 0.8


class _Limb(NamedTuple):
    """branch: the joint that the pair hangs from; joints: hip, knee, ankle and perhaps foot, or shoulder …;
    length: of the two main bones."""

    branch: int
    joints: tuple[int, ...]
    length: float


def named_by_tree(
    names: tuple[str, ...], parents: tuple[int, ...], positions: Array
) -> tuple[tuple[str, ...], str | None]:
    """The names, of which those of recognised joints are the nodes' if the legs have no known names; and a
    note that says which joints were told by their places.

    positions: (T, J, 3), of a rigid skeleton, in any unit and axes. The names stay if they are known, or if
    the tree is not clearly a person's.
    """
    if set(REQUIRED) <= joints_by_name(names).keys():
        return names, None
    found = joints_by_tree(parents, positions) or {}
    # A trunk's or a head's joint of that name stays the one.
    found = {node: joint for node, joint in found.items() if names[joint] == node or node not in names}
    if not set(REQUIRED) <= found.keys():
        return names, None
    nodes = {joint: node for node, joint in found.items()}
    legs = ", ".join(f"{node} = {names[found[node]]}" for node in REQUIRED)
    return (
        tuple(nodes.get(joint, name) for joint, name in enumerate(names)),
        f"joints told by their places in the skeleton: {legs}",
    )


def joints_by_tree(parents: tuple[int, ...], positions: Array) -> dict[str, int] | None:
    """Joint of each node that the tree shows, legs and arms at least; None if it is not clearly a person's.

    positions: (T, J, 3), of a rigid skeleton, in any unit and axes.
    """
    p = positions[:: len(positions) // _FRAMES + 1]
    p = p[np.isfinite(p).all(axis=(1, 2))]
    if not len(p):
        return None
    pairs = sorted(_pairs(parents, p), key=lambda pair: -pair[0].length)
    if len(pairs) < 2:
        return None
    legs, arms = pairs[0], next((pair for pair in pairs[1:] if _apart(pair, pairs[0], parents)), None)
    if arms is None or not is_a_person(
        _middle(p, arms, 0), _middle(p, legs, 0), _middle(p, legs, 2), arm=arms[0].length, leg=legs[0].length
    ):
        return None
    sides = _left_first(p, legs, arms)
    if sides is None:
        return None
    found: dict[str, int] = {}
    for pair, is_left, nodes in (
        (legs, sides[0], ("hip", "knee", "ankle", "foot")),
        (arms, sides[1], ("shoulder", "elbow", "wrist", "hand")),
    ):
        for limb, side in zip(pair if is_left else pair[::-1], ("left", "right"), strict=True):
            found |= {f"{node}_{side}": joint for node, joint in zip(nodes, limb.joints, strict=False)}
    return found | _trunk(parents, p, legs[0], arms[0], set(found.values()))


def _pairs(parents: tuple[int, ...], p: Array) -> list[tuple[_Limb, _Limb]]:
    """The pairs of limbs of equal lengths that hang from the same joint."""
    children = [[c for c, parent in enumerate(parents) if parent == joint] for joint in range(len(parents))]
    chains: list[list[int]] = [[] for _ in parents]
    lengths = np.zeros(len(parents))
    for joint in reversed(range(len(parents))):
        longest = max(children[joint], key=lambda child: lengths[child], default=None)
        chains[joint] = [joint, *(chains[longest] if longest is not None else [])]
        bone = 0.0 if parents[joint] < 0 else _length(p, parents[joint], joint)
        lengths[joint] = bone + (lengths[longest] if longest is not None else 0.0)
    pairs = []
    for branch, below in enumerate(children):
        limbs = [limb for child in below if (limb := _limb(p, branch, chains[child])) is not None]
        pairs += [(one, other) for one, other in combinations(limbs, 2) if _equal(p, one, other)]
    return pairs


def _equal(p: Array, one: _Limb, other: _Limb) -> bool:
    """Whether the two main bones of two limbs have the same lengths."""
    pairs = [[_length(p, a, b) for a, b in pairwise(limb.joints[:3])] for limb in (one, other)]
    return all(abs(a - b) <= _SAME * max(a, b) for a, b in zip(*pairs, strict=True))


def _limb(p: Array, branch: int, chain: list[int]) -> _Limb | None:
    """The limb along a chain down from a branch; None if it has no two long bones."""
    size = sum(_length(p, a, b) for a, b in pairwise([branch, *chain]))
    joints = [branch]
    for joint in chain:
        if _length(p, joints[-1], joint) > _NO_BONE * size:
            joints.append(joint)
        elif len(joints) > 1:
            joints[-1] = joint  # of joints at the same place the last one turns what is below
    bending = [
        joint
        for before, joint, after in zip(joints, joints[1:], joints[2:-1], strict=False)
        if not _is_straight(p, before, joint, after)
    ]
    for kept in ([joints[0], *bending, *joints[-2:]], joints):
        steps = [_length(p, a, b) for a, b in pairwise(kept)]
        first = max(range(1, len(steps) - 1), key=lambda k: min(steps[k], steps[k + 1]), default=0)
        if first:
            low, high = sorted(steps[first : first + 2])
            if high <= _ALIKE * low:
                return _Limb(branch, tuple(kept[first : first + 4]), low + high)
    return None


def _length(p: Array, start: int, end: int) -> float:
    return float(np.median(np.linalg.norm(p[:, end] - p[:, start], axis=-1)))


def _is_straight(p: Array, before: int, joint: int, after: int) -> bool:
    cosine = np.sum(unit(p[:, joint] - p[:, before]) * unit(p[:, after] - p[:, joint]), axis=-1)
    bend = np.arccos(np.clip(np.nan_to_num(cosine, nan=1.0), -1.0, 1.0))
    return bool(bend.max() < _STRAIGHT and np.ptp(bend) < _STILL)


def _apart(arms: tuple[_Limb, _Limb], legs: tuple[_Limb, _Limb], parents: tuple[int, ...]) -> bool:
    """Whether the arms' branch is not in a leg, nor the legs'."""
    chain = [arms[0].branch]
    while chain[-1] >= 0:
        chain.append(parents[chain[-1]])
    return arms[0].branch != legs[0].branch and not {leg.joints[0] for leg in legs} & set(chain)


def _middle(p: Array, pair: tuple[_Limb, _Limb], number: int) -> Array:
    return np.asarray(0.5 * (p[:, pair[0].joints[number]] + p[:, pair[1].joints[number]]))


def is_a_person(shoulders: Array, hips: Array, ankles: Array, *, arm: float, leg: float) -> bool:
    """Whether the proportions are a person's, and the trunk stands on the legs in most frames.

    shoulders, hips, ankles: (T, 3), T > 0, the middles of each pair; arm, leg: lengths of the two main bones
    of a limb, in the same unit.
    """
    trunk = shoulders - hips
    size = float(np.median(np.linalg.norm(trunk, axis=-1)))
    angle = np.arccos(np.clip(np.sum(unit(trunk) * unit(hips - ankles), axis=-1), -1.0, 1.0))
    return bool(
        _ARMS[0] < arm / leg < _ARMS[1] and _TRUNK[0] < size / leg < _TRUNK[1] and np.median(angle) < _SITTING
    )


def _left_first(p: Array, legs: tuple[_Limb, _Limb], arms: tuple[_Limb, _Limb]) -> tuple[bool, bool] | None:
    """Whether the first leg and the first arm are the left ones; None if it is not clear."""
    up = unit(_middle(p, arms, 0) - _middle(p, legs, 0))
    if min(len(leg.joints) for leg in legs) < 4:
        return None
    ahead = sum(perpendicular(p[:, leg.joints[3]] - p[:, leg.joints[2]], up) for leg in legs)
    across, over = (p[:, pair[0].joints[0]] - p[:, pair[1].joints[0]] for pair in (legs, arms))
    votes = np.sum(across * np.cross(up, ahead), axis=-1), np.sum(over * across, axis=-1)
    shares = [float(np.sum(vote[vote > 0.0]) / np.sum(np.abs(vote))) for vote in votes]
    if any(1.0 - _CLEAR < share < _CLEAR for share in shares):
        return None
    return shares[0] > 0.5, (shares[0] > 0.5) == (shares[1] > 0.5)


def _trunk(parents: tuple[int, ...], p: Array, leg: _Limb, arm: _Limb, taken: set[int]) -> dict[str, int]:
    """The spine above the pelvis, and the neck and head above the arms' branch, if they are there."""
    size = leg.length
    found: dict[str, int] = {}
    # Legs and trunk may hang from a waist, and that from the origin of the scene.
    carry_legs = {leg.branch, *(j for j in range(len(parents)) if _is_below(leg.branch, j, parents))}
    chain = [arm.branch]
    while parents[chain[-1]] >= 0 and parents[chain[-1]] not in carry_legs:
        chain.append(parents[chain[-1]])
    hips = p[:, leg.branch]
    above = [j for j in reversed(chain) if np.median(np.linalg.norm(p[:, j] - hips, axis=-1)) > 0.03 * size]
    if above:
        found["spine"] = above[0]
    middle = 0.5 * (p[:, leg.branch] + p[:, arm.branch])
    heads = [
        joint
        for joint, parent in enumerate(parents)
        if parent == arm.branch
        and joint not in taken
        and not any(_is_below(limb, joint, parents) for limb in taken)
        and np.median(np.sum((p[:, joint] - middle) * (p[:, arm.branch] - middle), axis=-1)) > 0.0
    ]
    if len(heads) == 1:
        found["shoulder_center"] = heads[0]
        below = [joint for joint in range(len(parents)) if _is_below(joint, heads[0], parents)]
        if below:
            found["head"] = max(
                below, key=lambda j: float(np.median(np.linalg.norm(p[:, j] - hips, axis=-1)))
            )
    return found


def _is_below(joint: int, above: int, parents: tuple[int, ...]) -> bool:
    while (joint := parents[joint]) >= 0:
        if joint == above:
            return True
    return False

"""The 20 nodes of any skeleton, by its joints' names and positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import (
    HOW_TO_NAME,
    REQUIRED,
    joints_by_name,
    listed,
    normalised,
)
from kinemimic.pipeline.kinematics.proportions import complete
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES, TRACKED
from kinemimic.pipeline.kinematics.vectors import median_distance

# Metres; nodes nearer to each other have no direction between them: a fingerless hand, a spine at the hips.
_APART = 0.02
# Metres from the middle of the hips within which the joint that both thighs hang from is the pelvis, not the
# origin of a scene.
_PELVIS = 0.25
# Shares of the trunk's height at which a joint is a spine.
_LOWER_TRUNK = (0.1, 0.5)
# A node at the same point as this other node counts as not shown.
_BEYOND: dict[str, str] = {
    "spine": "hip_center",
    "hand_left": "wrist_left",
    "hand_right": "wrist_right",
}
# Plausible lengths of thigh, shank, trunk and upper arm in metres; others mean a wrong unit or wrong names.
_SANE: tuple[tuple[str, str, float, float], ...] = (
    *(
        (start.format(side), end.format(side), low, high)
        for side in SIDES
        for start, end, low, high in (
            ("hip_{}", "knee_{}", 0.18, 0.65),
            ("knee_{}", "ankle_{}", 0.18, 0.60),
            ("shoulder_{}", "elbow_{}", 0.10, 0.50),
        )
    ),
    ("hip_center", "shoulder_center", 0.10, 0.90),
)


def to_nodes(clip: Clip) -> tuple[Array, States]:
    """Positions (T, 20, 3) in metres and states (T, 20) of the 20 nodes.

    Hips, knees, ankles and a trunk (the spine, the shoulder_center or both shoulders) are required; a
    KinemimicError names what is missing, or implausible lengths. All other missing nodes are derived, with
    the state "inferred" at best (`derived_nodes` lists them): hip_center and shoulder_center midway between
    the sides, spine a third of the way up the trunk, a hand 8 cm beyond the wrist along the forearm; and
    head, arms and feet that the capture does not show, with an average body's lengths (proportions.py). A
    derived node is NaN where a node that it follows from is.
    """
    found = joints_of(clip)
    positions = np.full((len(clip.times), len(NODES), 3), np.nan)
    states = np.zeros(positions.shape[:2], dtype=np.uint8)
    for node, joint in found.items():
        positions[:, NODE_INDEX[node]] = clip.positions[:, joint]
        states[:, NODE_INDEX[node]] = clip.states[:, joint]
    complete(positions, states, set(found))
    _check_lengths(positions)
    return positions, states


def shows_feet(states: States) -> bool:
    """Whether both feet are tracked in some frame of states (T, 20); a derived foot never is."""
    feet = states[:, [NODE_INDEX["foot_left"], NODE_INDEX["foot_right"]]]
    return bool((feet == TRACKED).any(axis=0).all())


def derived_nodes(clip: Clip) -> tuple[str, ...]:
    """The nodes without a joint in the capture, which `to_nodes` derives, in the order of NODES.

    Raises KinemimicError as `to_nodes` does.
    """
    found = joints_of(clip)
    return tuple(node for node in NODES if node not in found)


def joints_of(clip: Clip) -> dict[str, int]:
    """Joint index of every node, by names and by the joints' positions.

    Raises KinemimicError as `to_nodes` does.
    """
    found = joints_by_name(clip.skeleton.names)
    lacking = [node for node in REQUIRED if node not in found]
    names = clip.skeleton.names
    if not lacking and not {"spine", "shoulder_center"} & found.keys():
        lacking = [f"shoulder_{side}" for side in SIDES if f"shoulder_{side}" not in found]
        if len(lacking) == len(SIDES):
            raise KinemimicError(
                f"expected joints of the trunk beside the legs, found none among {listed(names)}; record or "
                "export a spine, a neck or both shoulders as well, or rename them"
            )
    if lacking:
        raise KinemimicError(
            "expected joints for hips, knees, ankles and a trunk, found none for "
            f"{', '.join(lacking)} among {listed(names)}; {HOW_TO_NAME}"
        )
    _take_pelvis(clip, found)
    _prefer(clip, found)
    _fill_by_tree(clip, found)
    for node, start in _BEYOND.items():
        if node in found and start in found:
            ends = (clip.positions[:, found[name]] for name in (start, node))
            if median_distance(*ends) < _APART:
                del found[node]
    return found


def _take_pelvis(clip: Clip, found: dict[str, int]) -> None:
    """Take the joint that both thighs hang from for hip_center, if no joint of that name is nearer to the
    hips: Blender's root is called "spine", and a "root" may be the origin of the scene.
    """
    left, right = (ancestors(clip.skeleton.parents, found[f"hip_{side}"]) for side in SIDES)
    shared = next((joint for joint in left if joint in right), None)
    # A tree that was drawn up for a table without a pelvis hangs the thighs from its only spine.
    if shared is None or (shared == found.get("spine") and not _trunk(clip, found, shared)):
        return
    hips = 0.5 * (clip.positions[:, found["hip_left"]] + clip.positions[:, found["hip_right"]])
    named = found.get("hip_center")
    nearest = _PELVIS if named is None else median_distance(clip.positions[:, named], hips)
    if median_distance(clip.positions[:, shared], hips) < nearest:
        found["hip_center"] = shared


def ancestors(parents: tuple[int, ...], joint: int) -> list[int]:
    """The joints that a joint hangs from, the nearest first."""
    above: list[int] = []
    while (joint := parents[joint]) >= 0:
        above.append(joint)
    return above


def _trunk(clip: Clip, found: dict[str, int], pelvis: int) -> list[int]:
    """The joints from the pelvis up to the shoulders (or neck, or head) that serve no other node."""
    top = next((found[node] for node in ("shoulder_left", "shoulder_center", "head") if node in found), None)
    above = [] if top is None else ancestors(clip.skeleton.parents, top)
    if pelvis not in above:
        return []
    return [joint for joint in reversed(above[: above.index(pelvis)]) if joint not in found.values()]


def _prefer(clip: Clip, found: dict[str, int]) -> None:
    """Prefer a spine above the hips and a head off the neck, if the skeleton has them."""
    names, parents = clip.skeleton.names, clip.skeleton.parents

    def distance(a: int, b: int) -> float:
        return median_distance(clip.positions[:, a], clip.positions[:, b])

    if "spine" in found and "hip_center" in found:
        hips = found["hip_center"]
        if distance(hips, found["spine"]) < _APART:
            # CMU puts the lower back at the hips: take the next joint up that does not coincide with them.
            above = (joint for joint in _trunk(clip, found, hips) if distance(hips, joint) >= _APART)
            found["spine"] = next(above, found["spine"])
        _lower_spine(clip, found)
    head = found.get("head")
    if head is None or parents[head] < 0 or normalised(names[head]) not in ("headend", "headtip"):
        return
    if distance(parents[head], head) < _APART:
        found["head"] = parents[head]


def _fill_by_tree(clip: Clip, found: dict[str, int]) -> None:
    """Find joints whose names are not known by their place in the tree: an elbow between shoulder and
    wrist, a wrist below the elbow, a spine between pelvis and shoulders."""
    parents = clip.skeleton.parents

    def distance(a: int, b: int) -> float:
        return median_distance(clip.positions[:, a], clip.positions[:, b])

    for side in SIDES:
        shoulder, elbow, wrist = (found.get(f"{joint}_{side}") for joint in ("shoulder", "elbow", "wrist"))
        if elbow is not None and wrist is None:
            below = [joint for joint, parent in enumerate(parents) if parent == elbow]
            _take(found, f"wrist_{side}", {joint: distance(elbow, joint) for joint in below})
        end = found.get(f"hand_{side}") if wrist is None else wrist
        above = [] if end is None else ancestors(parents, end)
        if elbow is None and end is not None and shoulder in above:
            between = above[: above.index(shoulder)]
            nearer = {joint: min(distance(shoulder, joint), distance(joint, end)) for joint in between}
            _take(found, f"elbow_{side}", nearer)
    if "spine" not in found and "hip_center" in found:
        _lower_spine(clip, found)


def _take(found: dict[str, int], node: str, joints: Mapping[int, float]) -> None:
    """Take for a node the joint with the largest distance (m), if it is apart and no other node's."""
    free = {joint: away for joint, away in joints.items() if joint not in found.values()}
    best = max(free, key=free.__getitem__, default=None)
    if best is not None and _APART <= free[best] < np.inf:
        found[node] = best


def _lower_spine(clip: Clip, found: dict[str, int]) -> None:
    """Prefer a joint of the lower trunk to one of the chest: the line from the hips to the chest leans with
    the back, and hip flexion with it. Skeletons with an abdomen and a chest have no joint called spine."""
    hips = found["hip_center"]
    top = next((found[node] for node in ("shoulder_center", "head") if node in found), None)
    if top is None:
        return
    trunk = median_distance(clip.positions[:, hips], clip.positions[:, top])

    def height(joint: int) -> float:
        above = median_distance(clip.positions[:, hips], clip.positions[:, joint])
        return above / trunk if trunk > 0.0 else np.inf

    lower = [
        joint for joint in _trunk(clip, found, hips) if _LOWER_TRUNK[0] <= height(joint) <= _LOWER_TRUNK[1]
    ]
    if lower and ("spine" not in found or height(found["spine"]) > _LOWER_TRUNK[1]):
        found["spine"] = min(lower, key=lambda joint: abs(height(joint) - 1.0 / 3.0))


def _check_lengths(positions: Array) -> None:
    for start, end, low, high in _SANE:
        length = median_distance(positions[:, NODE_INDEX[start]], positions[:, NODE_INDEX[end]])
        if np.isfinite(length) and not low <= length <= high:
            raise KinemimicError(
                f"expected {start} to {end} between {low} and {high} m, found a median of {length:.3f} m; "
                "the unit is wrong, or the joints are named differently"
            )

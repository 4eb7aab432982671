"""The 20 nodes out of any skeleton, by the names that recorders and mocap libraries give their joints."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.skeleton import INFERRED, NODE_INDEX, NODES

Array = NDArray[np.float64]
States = NDArray[np.uint8]

# Per node the names to look for, best first, in lower case without punctuation. A * stands for the side:
# "*leg" is leftleg or lleg, "leg*" is legleft or legl; a % for the whole word only. The sequence settles
# what is ambiguous between conventions: LeftFoot is the ankle wherever there is no LeftAnkle, and the foot
# where there is; ShoulderLeft is a Kinect's shoulder, but Shoulder_L a clavicle beside UpperArm_L.
_MIDDLE: dict[str, tuple[str, ...]] = {
    "hip_center": ("hipcenter", "hips", "pelvis", "spinebase", "hip", "root"),
    "spine": ("spine", "spinemid", "lowerback", "spine1", "chest", "abdomen", "torso", "waist"),
    "shoulder_center": ("shouldercenter", "spineshoulder", "neck", "neckbase"),
    "head": ("headend", "head"),
}
_SIDED: dict[str, tuple[str, ...]] = {
    "shoulder": (
        "shoulder%",
        "*arm",
        "*upperarm",
        "*uparm",
        "upperarm*",
        "uparm*",
        "*humerus",
        "*shoulder",
        "shoulder*",
    ),
    "elbow": ("elbow*", "*forearm", "*elbow", "*lowerarm", "*lowarm", "lowerarm*", "forearm*", "*radius"),
    "wrist": ("wrist*", "*wrist", "*hand", "hand*"),
    "hand": (
        "hand%",
        "*hand",
        "*handmiddle1",
        "*handindex1",
        "*middle1",
        "*index1",
        "*fingers",
        "*handend",
        "*wristend",
        "hand*end",
        "wrist*end",
    ),
    "hip": ("hip*", "*upleg", "*upperleg", "*thigh", "*hip", "upperleg*", "upleg*", "thigh*", "*femur"),
    "knee": (
        "knee*",
        "*knee",
        "*leg",
        "*lowerleg",
        "*lowleg",
        "*shin",
        "*calf",
        "lowerleg*",
        "shin*",
        "calf*",
        "*tibia",
    ),
    "ankle": ("ankle*", "*ankle", "*foot", "foot*"),
    "foot": (
        "foot%",
        "*foot",
        "*toebase",
        "*toes",
        "*toe",
        "toes*",
        "toe*",
        "*footend",
        "*ankleend",
        "foot*end",
        "ankle*end",
    ),
}
# Nodes that fall on one joint have no direction between them: a fingerless hand, a spine at the hips.
_APART = 0.02
_HAND = 0.08
# Nodes that can be derived, and the two that they come from, in this sequence.
_DERIVED: dict[str, tuple[str, str]] = {
    "shoulder_center": ("shoulder_left", "shoulder_right"),
    "spine": ("hip_center", "shoulder_center"),
    "hand_left": ("wrist_left", "elbow_left"),
    "hand_right": ("wrist_right", "elbow_right"),
}
# Thigh, shank, trunk and upper arm outside of these bounds (metres) are no human's, or the unit is wrong.
_SANE: tuple[tuple[str, str, float, float], ...] = (
    *(
        (start.format(side), end.format(side), low, high)
        for side in ("left", "right")
        for start, end, low, high in (
            ("hip_{}", "knee_{}", 0.18, 0.65),
            ("knee_{}", "ankle_{}", 0.18, 0.60),
            ("shoulder_{}", "elbow_{}", 0.10, 0.50),
        )
    ),
    ("hip_center", "shoulder_center", 0.15, 0.90),
)


def normalised(name: str) -> str:
    """A joint's name without namespace ("mixamorig:"), case and punctuation."""
    return re.sub(r"[^a-z0-9]", "", name.rsplit(":", 1)[-1].lower())


def _candidates(node: str) -> Iterator[str]:
    if node in _MIDDLE:
        yield from _MIDDLE[node]
        return
    joint, side = node.rsplit("_", 1)
    for pattern in _SIDED[joint]:
        yield pattern.replace("*", side).replace("%", side)
        if "*" in pattern:
            yield pattern.replace("*", side[0])


def joints_of_nodes(names: tuple[str, ...]) -> dict[str, int]:
    """Index of the joint that each node is found on by its name alone; no joint serves two nodes."""
    index: dict[str, int] = {}
    for joint, name in enumerate(names):
        index.setdefault(normalised(name), joint)
    found: dict[str, int] = {}
    for node in NODES:
        for candidate in _candidates(node):
            if candidate in index and index[candidate] not in found.values():
                found[node] = index[candidate]
                break
    return found


def to_nodes(clip: Clip) -> tuple[Array, States]:
    """Positions (T, 20, 3) in metres and states (T, 20) of the 20 nodes.

    What a skeleton lacks is derived where its place follows from others, and is then "inferred" at best:
    shoulder_center midway between the shoulders, spine a third of the way up the trunk, a hand without
    fingers 8 cm on from the wrist along the forearm. Anything else that is missing raises a KinemimicError
    that names it, and so do lengths that no human has.
    """
    found = joints_of_nodes(clip.skeleton.names)
    lacking = [node for node in NODES if node not in found and node not in _DERIVED]
    if lacking:
        raise KinemimicError(
            f"expected joints for all 20 nodes, found none for {', '.join(lacking)} among "
            f"{', '.join(clip.skeleton.names)}"
        )
    _prefer(clip, found)
    positions = np.full((len(clip.times), len(NODES), 3), np.nan)
    states = np.zeros(positions.shape[:2], dtype=np.uint8)
    for node, joint in found.items():
        positions[:, NODE_INDEX[node]] = clip.positions[:, joint]
        states[:, NODE_INDEX[node]] = clip.states[:, joint]
    for node, (start, end) in _DERIVED.items():
        a, b = positions[:, NODE_INDEX[start]], positions[:, NODE_INDEX[end]]
        if node in found and _length(a, positions[:, NODE_INDEX[node]]) >= _APART:
            continue
        if node == "shoulder_center":
            place = 0.5 * (a + b)
        elif node == "spine":
            place = a + (b - a) / 3.0
        else:
            length = np.linalg.norm(a - b, axis=-1, keepdims=True)
            place = a + _HAND * (a - b) / np.where(length > 0, length, np.nan)
        positions[:, NODE_INDEX[node]] = place
        least = np.minimum(states[:, NODE_INDEX[start]], states[:, NODE_INDEX[end]])
        states[:, NODE_INDEX[node]] = np.minimum(least, INFERRED)
    _check_lengths(positions)
    return positions, states


def _prefer(clip: Clip, found: dict[str, int]) -> None:
    """A spine that lies above the hips, and a head that lies off the neck, where the tree has them."""
    names, parents = clip.skeleton.names, clip.skeleton.parents

    def distance(a: int, b: int) -> float:
        return _length(clip.positions[:, a], clip.positions[:, b])

    hips, trunk = found["hip_center"], [parents[found["shoulder_left"]]]
    while trunk[-1] >= 0 and trunk[-1] != hips:
        trunk.append(parents[trunk[-1]])
    if "spine" in found and distance(hips, found["spine"]) < _APART and trunk[-1] == hips:
        # CMU writes the lower back on the spot of the hips: the next joint up that is apart from them.
        found["spine"] = next((j for j in trunk[-2::-1] if distance(hips, j) >= _APART), found["spine"])
    head = found["head"]
    if normalised(names[head]) == "headend" and distance(parents[head], head) < _APART:
        found["head"] = parents[head]


def _length(start: Array, end: Array) -> float:
    """Median distance of two joints over the frames that have both; infinite if none has."""
    distance = np.linalg.norm(end - start, axis=-1)
    seen = distance[np.isfinite(distance)]
    return float(np.median(seen)) if len(seen) else np.inf


def _check_lengths(positions: Array) -> None:
    for start, end, low, high in _SANE:
        length = _length(positions[:, NODE_INDEX[start]], positions[:, NODE_INDEX[end]])
        if np.isfinite(length) and not low <= length <= high:
            raise KinemimicError(
                f"expected {start} to {end} between {low} and {high} m, found a median of {length:.3f} m; "
                "these are no human's lengths, or the joints are named differently"
            )

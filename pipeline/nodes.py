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
# "*leg" is leftleg or lleg, "leg*" is legleft or legl. The sequence settles what is ambiguous between
# conventions: LeftFoot is the ankle wherever there is no LeftAnkle, and the foot where there is.
_MIDDLE: dict[str, tuple[str, ...]] = {
    "hip_center": ("hipcenter", "hips", "pelvis", "spinebase", "hip", "root"),
    "spine": ("spine", "spinemid", "lowerback", "spine1", "chest", "abdomen", "torso", "waist"),
    "shoulder_center": ("shouldercenter", "spineshoulder", "neck", "neckbase"),
    "head": ("headend", "head"),
}
_SIDED: dict[str, tuple[str, ...]] = {
    "shoulder": ("shoulder*", "*arm", "*upperarm", "*uparm", "upperarm*", "uparm*", "*humerus", "*shoulder"),
    "elbow": ("elbow*", "*forearm", "*elbow", "*lowerarm", "*lowarm", "lowerarm*", "forearm*", "*radius"),
    "wrist": ("wrist*", "*wrist", "*hand", "hand*"),
    "hand": (
        "hand*",
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
        "foot*",
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
        yield pattern.replace("*", side)
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
    shoulder_center is the joint where both arms branch off, spine the first joint above the hips or a third
    of the way up the trunk, a hand without fingers 8 cm on from the wrist along the forearm. Anything else
    that is missing raises a KinemimicError that names it, and so do lengths that no human has.
    """
    positions = np.full((len(clip.times), len(NODES), 3), np.nan)
    states = np.zeros(positions.shape[:2], dtype=np.uint8)
    found = joints_of_nodes(clip.skeleton.names)
    _trunk(clip, found)

    def put(node: str, values: Array, sources: list[str]) -> None:
        positions[:, NODE_INDEX[node]] = values
        least = np.min([states[:, NODE_INDEX[source]] for source in sources], axis=0)
        states[:, NODE_INDEX[node]] = np.minimum(least, INFERRED)

    def at(node: str) -> Array:
        place: Array = positions[:, NODE_INDEX[node]]
        return place

    for node, joint in found.items():
        positions[:, NODE_INDEX[node]] = clip.positions[:, joint]
        states[:, NODE_INDEX[node]] = clip.states[:, joint]
    derivable = {"spine": ("hip_center", "shoulder_center")}
    derivable |= {f"hand_{side}": (f"wrist_{side}", f"elbow_{side}") for side in ("left", "right")}
    lacking = [node for node in NODES if node not in found and node not in derivable]
    lacking += [
        s for node, sources in derivable.items() if node not in found for s in sources if s not in found
    ]
    if lacking:
        raise KinemimicError(
            f"expected joints for all 20 nodes, found none for {', '.join(dict.fromkeys(lacking))} among "
            f"{', '.join(clip.skeleton.names)}"
        )
    if "spine" not in found or _length(at("hip_center"), at("spine")) < _APART:
        put("spine", (2 * at("hip_center") + at("shoulder_center")) / 3, ["hip_center", "shoulder_center"])
    for side in ("left", "right"):
        hand, wrist, elbow = f"hand_{side}", f"wrist_{side}", f"elbow_{side}"
        if hand not in found or _length(at(wrist), at(hand)) < _APART:
            forearm = at(wrist) - at(elbow)
            length = np.linalg.norm(forearm, axis=-1, keepdims=True)
            put(hand, at(wrist) + _HAND * forearm / np.where(length > 0, length, np.nan), [wrist, elbow])
    _check_lengths(positions)
    return positions, states


def _trunk(clip: Clip, found: dict[str, int]) -> None:
    """Fill in shoulder_center and spine from the tree, and prefer a head that lies off the neck."""
    names, parents = clip.skeleton.names, clip.skeleton.parents

    def chain(joint: int) -> list[int]:
        above = [joint]
        while parents[above[-1]] >= 0:
            above.append(parents[above[-1]])
        return above

    if "shoulder_center" not in found and {"shoulder_left", "shoulder_right"} <= found.keys():
        right = set(chain(found["shoulder_right"]))
        found["shoulder_center"] = next(j for j in chain(found["shoulder_left"]) if j in right)
    if {"hip_center", "shoulder_center"} <= found.keys():
        low, high = found["hip_center"], found["shoulder_center"]
        trunk = chain(high)[::-1]
        between = trunk[trunk.index(low) + 1 : -1] if low in trunk else []
        spine = [found["spine"]] if "spine" in found else []
        for joint in spine + between:
            ends = (clip.positions[:, low], clip.positions[:, high])
            if all(_length(clip.positions[:, joint], end) > _APART for end in ends):
                found["spine"] = joint
                break
        else:
            found.pop("spine", None)
    if "head" in found and normalised(names[found["head"]]) == "headend":
        head = parents[found["head"]]
        if head >= 0 and _length(clip.positions[:, head], clip.positions[:, found["head"]]) < _APART:
            found["head"] = head


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

"""The names that recorders and motion-capture tools give to the joints of the 20 nodes."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice, product

from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES

# Per node the names to look for, best first, in lower case without punctuation. A * stands for the side:
# "*leg" is leftleg or lleg, "leg*" is legleft or legl; a % for the whole word only. A name in the middle may
# be marked like a side: C_Hips, Neck_M. The order resolves conflicts between conventions: LeftFoot is the
# ankle if there is no LeftAnkle, and the foot otherwise; ShoulderLeft is a Kinect's shoulder, but Shoulder_L
# a clavicle beside UpperArm_L, as Hip_L is a part of the pelvis beside Thigh_L. LeftLeg is the shank, or the
# thigh of a skeleton without another.
_MIDDLE: dict[str, tuple[str, ...]] = {
    "hip_center": ("hipcenter", "hips", "pelvis", "spinebase", "midhip", "hip", "root", "waist"),
    "spine": (
        "spine",
        "spinemid",
        "spinenavel",
        "lowerback",
        "spine1",
        "spine01",
        "chest",
        "abdomen",
        "abdomenlower",
        "ab",
        "torso",
        "waist",
        "spinechest",
    ),
    "shoulder_center": (
        "shouldercenter",
        "spineshoulder",
        "neck",
        "neckbase",
        "lowerneck",
        "necklower",
        "neck01",
        "neck0",
        "neck1",
        "necktwist01",
    ),
    "head": ("headend", "headtip", "head", "head1"),
}
_SIDED: dict[str, tuple[str, ...]] = {
    "shoulder": (
        "shoulder%",
        "*arm",
        "*upperarm",
        "*uparm",
        "*uarm",
        "upperarm*",
        "uparm*",
        "*humerus",
        "humerus*",
        "*shldr",
        "*shldrbend",
        "upperarm01*",
        "arm*",
        "*shoulder",
        "shoulder*",
    ),
    "elbow": (
        "elbow*",
        "*forearm",
        "*elbow",
        "*lowerarm",
        "*lowarm",
        "*farm",
        "*larm",
        "lowerarm*",
        "forearm*",
        "*forearmbend",
        "lowerarm01*",
        "*radius",
        "ulna*",
    ),
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
    "hip": (
        "hip%",
        "*upleg",
        "*upperleg",
        "*thigh",
        "*hip",
        "upperleg*",
        "upleg*",
        "thigh*",
        "*thighbend",
        "upperleg01*",
        "*femur",
        "femur*",
        "hip*",
        "*leg",
    ),
    "knee": (
        "knee*",
        "*knee",
        "*leg",
        "*lowerleg",
        "*lowleg",
        "*shin",
        "*shank",
        "*calf",
        "lowerleg*",
        "lowerleg01*",
        "shin*",
        "shank*",
        "calf*",
        "*tibia",
        "tibia*",
    ),
    "ankle": ("ankle*", "*ankle", "talus*", "*foot", "foot*"),
    "foot": (
        "foot*",
        "*foot",
        "*toebase",
        "*toes",
        "*toe",
        "*toe0",
        "ball*",
        "*ball",
        "toes*",
        "toe*",
        "toe11*",
        "*bigtoe",
        "*footindex",
        "*footend",
        "*ankleend",
        "foot*end",
        "ankle*end",
    ),
}
# Required; everything else follows from these and one node of the trunk.
REQUIRED: tuple[str, ...] = tuple(f"{joint}_{side}" for side in SIDES for joint in ("hip", "knee", "ankle"))
# What to do about joints that are not found.
HOW_TO_NAME = "rename the joints, for instance to LeftUpLeg, LeftLeg, LeftFoot, RightUpLeg and so on"
# Between the parts of a name.
_BOUNDARY = re.compile(r"[^A-Za-z0-9]+|(?<=[a-z0-9])(?=[A-Z])")


def listed(names: Sequence[str]) -> str:
    """The first 40 names, for an error."""
    return f"{', '.join(names[:40])}{' …' if len(names) > 40 else ''}"


def normalised(name: str) -> str:
    """A joint's name without namespace ("mixamorig:"), case and punctuation."""
    return re.sub(r"[^a-z0-9]", "", name.rsplit(":", 1)[-1].lower())


def _candidates(node: str) -> Iterator[str]:
    if node in _MIDDLE:
        for name in _MIDDLE[node]:
            yield from (name, f"c{name}", f"{name}m")
        return
    joint, side = node.rsplit("_", 1)
    for pattern in _SIDED[joint]:
        yield pattern.replace("*", side).replace("%", side)
        if "*" in pattern:
            yield pattern.replace("*", side[0])


_CANDIDATES: dict[str, tuple[str, ...]] = {node: tuple(_candidates(node)) for node in NODES}


def joints_by_name(names: tuple[str, ...]) -> dict[str, int]:
    """Joint index of every node that is found by name alone; no joint serves two nodes."""
    return _joints_of_words(words(names))


def words(names: tuple[str, ...]) -> tuple[str, ...]:
    """The joints' normalised names without what a tool puts before each ("Bip01 L Thigh", "DEF-thigh.L") or
    behind it ("l_upleg_JNT").

    If legs are not found otherwise, the parts left out are those without which most of them are found: in
    front, of what at least six joints share, as two legs do; behind, of what most joints share (many markers
    end in "Out" or "Lat", and are no joints without it). A joint that lacks them keeps its name.
    """
    plain = tuple(map(normalised, names))
    if _leg_joints(plain) == len(REQUIRED):
        return plain
    heads = _shared(map(_leading_parts, names), len(REQUIRED))
    tails = _shared(map(_trailing_parts, names), max(len(REQUIRED), len(names) // 2 + 1))
    shorter = (
        tuple(word.removeprefix(head).removesuffix(tail) for word in plain)
        for head, tail in product(["", *heads], ["", *tails])
    )
    return max(shorter, key=_leg_joints)


def _shared(parts: Iterable[set[str]], fewest: int) -> list[str]:
    counts = Counter(chain.from_iterable(parts))
    return [part for part, count in counts.items() if count >= fewest]


def _leg_joints(words: Sequence[str]) -> int:
    return len(_joints_of_words(words).keys() & set(REQUIRED))


def _leading_parts(name: str) -> set[str]:
    """What a name begins with, up to each of its first separators or capital letters, normalised."""
    return {normalised(name[: end.start()]) for end in islice(_BOUNDARY.finditer(name), 4)}


def _trailing_parts(name: str) -> set[str]:
    """What a name ends with, from each of its last separators or capital letters, normalised."""
    return {normalised(name[start.end() :]) for start in [*_BOUNDARY.finditer(name)][-4:]}


def _joints_of_words(words: Sequence[str]) -> dict[str, int]:
    index: dict[str, int] = {}
    for joint, word in enumerate(words):
        index.setdefault(word, joint)
    found: dict[str, int] = {}
    for node in NODES:
        for candidate in _CANDIDATES[node]:
            if candidate in index and index[candidate] not in found.values():
                found[node] = index[candidate]
                break
    return found

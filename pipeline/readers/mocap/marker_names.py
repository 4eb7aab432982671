"""Where on the body an optical marker sits, by the label that marker sets give it."""

from __future__ import annotations

from collections.abc import Sequence

from kinemimic.pipeline.kinematics.nodes import normalised

# Landmark -> labels of its markers in lower case without punctuation, by which it is known; a * stands for
# the side: "*asi" is lasi, leftasi. All the labels that a file has of one landmark's tuple belong to it, and
# the first tuple of which it has any (of a cluster: all) is taken. Plug-in-Gait; OpenSim's Gait2354, Hamner
# and Rajagopal; and plain words.
_SIDED: dict[str, tuple[tuple[str, ...], ...]] = {
    "asis": (("*asi",), ("*asis",)),
    "psis": (("*psi",), ("*psis",)),
    "knee_lateral": (("*kneelat",), ("*kneelateral",), ("*kne",), ("*lfc",), ("*knee",)),
    "knee_medial": (("*kneemed",), ("*kneemedial",), ("*mkne",), ("*knem",), ("*mfc",)),
    "ankle_lateral": (("*anklelat",), ("*anklelateral",), ("*ank",), ("*lmal",), ("*ankle",)),
    "ankle_medial": (("*anklemed",), ("*anklemedial",), ("*mank",), ("*ankm",), ("*mmal",)),
    "toes": (("*toetip",), ("*toe",), ("*mt2",), ("*mt1", "*mt5"), ("*toelat", "*toemed")),
    "acromion": (("*acromium",), ("*acromion",), ("*sho",), ("*acr",), ("*shoulder",)),
    "elbow": (("*elb", "*elbm"), ("*elbowlat", "*elbowmed"), ("*lel", "*mel"), ("*elbow",)),
    "wrist": (("*wra", "*wrb"), ("*wristlat", "*wristmed"), ("*wrist",)),
    "hand": (("*fin",), ("*hand",)),
}
_MIDDLE: dict[str, tuple[tuple[str, ...], ...]] = {
    "sacrum": (("vsacral",), ("sacr",), ("sacrum",), ("sacral",)),
    "neck_back": (("c7",),),
    "neck_front": (("clav",),),
    "head": (("lfhd", "rfhd", "lbhd", "rbhd"), ("ltemple", "rtemple"), ("tophead",)),
}
# Three markers each on a segment that has none at its joints.
_CLUSTERS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "thigh": (("*thighupper", "*thighfront", "*thighrear"),),
    "shank": (("*shankupper", "*shankfront", "*shankrear"),),
    "foot": (("*heel", "*midfootsup", "*midfootlat"),),
}
SIDES: tuple[str, ...] = ("left", "right")


def landmarks(labels: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Landmark -> indices of its markers: "asis_left", "sacrum", "thigh_right" (a cluster, exactly three) …

    A subject's name before a colon ("Jim:LASI"), case and punctuation do not matter; of a label that stands
    twice the first counts; labels that mean nothing here are passed over.
    """
    index: dict[str, int] = {}
    for marker, label in enumerate(labels):
        index.setdefault(normalised(label), marker)
    index.pop("", None)
    found: dict[str, tuple[int, ...]] = {}
    for landmark, sets in _MIDDLE.items():
        _take(found, landmark, [[(label,) for label in labels] for labels in sets], index, whole=False)
    for side in SIDES:
        for kinds, whole in ((_SIDED, False), (_CLUSTERS, True)):
            for landmark, patterns in kinds.items():
                spelt = [
                    [tuple(label.replace("*", word) for word in (side[0], side)) for label in labels]
                    for labels in patterns
                ]
                _take(found, f"{landmark}_{side}", spelt, index, whole=whole)
    return found


def _take(
    found: dict[str, tuple[int, ...]],
    landmark: str,
    sets: list[list[tuple[str, ...]]],
    index: dict[str, int],
    *,
    whole: bool,
) -> None:
    """Enter the first of the sets that is there; a set is a list of labels, each in its spellings."""
    for labels in sets:
        spelt = [next((index[name] for name in spellings if name in index), None) for spellings in labels]
        there = tuple(marker for marker in spelt if marker is not None)
        if there and (len(there) == len(labels) or not whole):
            found[landmark] = there
            return

"""Landmarks of optical markers, from the labels that marker sets give them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from kinemimic.pipeline.kinematics.nodes import normalised
from kinemimic.pipeline.kinematics.skeleton import NODES

# Landmark -> labels of its markers, in lower case without punctuation; * stands for the side: "*asi" is lasi
# or leftasi. Of each landmark's tuples, the first with any label in the file counts (for a cluster: with all
# labels); all labels of that tuple in the file belong to the landmark. Plug-in-Gait; OpenSim's Gait2354,
# Hamner, Rajagopal and Moco examples; OpenCap (whose suffix "_study" is dropped); the Rizzoli institute's
# (IOR; Leardini et al. 2007, Gait & Posture 26, 560-571); and plain words.
_SIDED: dict[str, tuple[tuple[str, ...], ...]] = {
    "asis": (("*asi",), ("*asis",), ("asis*",)),
    "psis": (("*psi",), ("*psis",), ("psis*",)),
    "knee_lateral": (
        ("*kneelat",),
        ("*kneelateral",),
        ("*kne",),
        ("*lfc",),
        ("*lepi",),
        ("*lkn",),
        ("*le",),
        ("*knee",),
    ),
    "knee_medial": (
        ("*kneemed",),
        ("*kneemedial",),
        ("*mkne",),
        ("*knem",),
        ("*mfc",),
        ("*mepi",),
        ("*mkn",),
        ("*me",),
        ("*mknee",),
    ),
    "ankle_lateral": (
        ("*anklelat",),
        ("*anklelateral",),
        ("*ank",),
        ("*lmal",),
        ("*lak",),
        ("*lm",),
        ("*ankle",),
    ),
    "ankle_medial": (
        ("*anklemed",),
        ("*anklemedial",),
        ("*mank",),
        ("*ankm",),
        ("*mmal",),
        ("*mak",),
        ("*mm",),
        ("*mankle",),
    ),
    "toes": (("*toetip",), ("*toe",), ("*mt2",), ("*mt1", "*mt5"), ("*fm", "*vm"), ("*toelat", "*toemed")),
    "acromion": (("*acromium",), ("*acromion",), ("*sho",), ("*acr",), ("*shoulder",), ("*shl",), ("*sh",)),
    "elbow": (
        ("*elb", "*elbm"),
        ("*elbowlat", "*elbowmed"),
        ("*lel", "*mel"),
        ("*lelbow", "*melbow"),
        ("*elbow",),
    ),
    "wrist": (
        ("*wra", "*wrb"),
        ("*wristlat", "*wristmed"),
        ("*lwrist", "*mwrist"),
        ("*faradius", "*faulna"),
        ("*rad", "*uln"),
        ("*wrist",),
        ("*wr",),
    ),
    "hand": (("*fin",), ("*hand",)),
}
_MIDDLE: dict[str, tuple[tuple[str, ...], ...]] = {
    "sacrum": (("vsacral",), ("sacr",), ("sacrum",), ("sacral",)),
    "neck_back": (("c7",),),
    "neck_front": (("clav",),),
    "head": (("lfhd", "rfhd", "lbhd", "rbhd"), ("ltemple", "rtemple"), ("tophead",)),
}
# Clusters of three markers on a segment without markers at its joints.
_CLUSTERS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "thigh": (
        ("*thighupper", "*thighfront", "*thighrear"),
        ("*th1", "*th2", "*th3"),
        ("*thigh1", "*thigh2", "*thigh3"),
    ),
    "shank": (
        ("*shankupper", "*shankfront", "*shankrear"),
        ("*tb1", "*tb2", "*tb3"),  # the tibia's
        ("*sh1", "*sh2", "*sh3"),
        ("*sk1", "*sk2", "*sk3"),
        ("*shank1", "*shank2", "*shank3"),
    ),
    "foot": (("*heel", "*midfootsup", "*midfootlat"), ("*heel", "*mfs", "*mfl")),
}
SIDES: tuple[str, ...] = ("left", "right")


def landmarks(labels: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Landmark -> indices of its markers: "asis_left", "sacrum", "thigh_right" (a cluster, exactly three) …

    A subject's name before a colon ("Jim:LASI"), case and punctuation are ignored; of a repeated label the
    first counts; unknown labels are ignored.
    """
    index: dict[str, int] = {}
    for marker, label in enumerate(labels):
        index.setdefault(normalised(label).removesuffix("study"), marker)
    index.pop("", None)
    found: dict[str, tuple[int, ...]] = {}
    for landmark, sets in _MIDDLE.items():
        _add_first_match(
            found, landmark, [[(label,) for label in labels] for labels in sets], index, complete=False
        )
    for side in SIDES:
        for kinds, complete in ((_SIDED, False), (_CLUSTERS, True)):
            for landmark, patterns in kinds.items():
                spellings_of_sets = [
                    [tuple(label.replace("*", word) for word in (side[0], side)) for label in labels]
                    for labels in patterns
                ]
                _add_first_match(found, f"{landmark}_{side}", spellings_of_sets, index, complete=complete)
    return found


def _add_first_match(
    found: dict[str, tuple[int, ...]],
    landmark: str,
    sets: list[list[tuple[str, ...]]],
    index: dict[str, int],
    *,
    complete: bool,
) -> None:
    """Add the first of the sets that is in the file; a set is a list of labels, each with its spellings."""
    for labels in sets:
        spellings_of_sets = [
            next((index[name] for name in spellings if name in index), None) for spellings in labels
        ]
        present = tuple(marker for marker in spellings_of_sets if marker is not None)
        if present and (len(present) == len(labels) or not complete):
            found[landmark] = present
            return


def canonical_labels(landmark: str, count: int) -> tuple[str, ...] | None:
    """Labels that `landmarks` reads as `count` markers of a landmark, or a joint of this node; None if there
    are none.

    landmark: as in `landmarks` ("asis_left", "sacrum", "thigh_right"), or a node, which has one marker.
    """
    if landmark in NODES and count == 1:
        return (landmark.replace("_", ""),)
    name, _, side = landmark.rpartition("_")
    patterns = chain(_MIDDLE.get(landmark, ()), *(kind.get(name, ()) for kind in (_SIDED, _CLUSTERS)))
    if landmark not in _MIDDLE and side not in SIDES:
        return None
    found = next((labels for labels in patterns if len(labels) == count), None)
    return None if found is None else tuple(label.replace("*", side[:1]) for label in found)

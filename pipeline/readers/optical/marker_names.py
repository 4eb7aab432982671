"""Landmarks of optical markers and named joint centres, from the labels that laboratories give them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import chain

from kinemimic.pipeline.kinematics.joint_names import joints_by_name, normalised
from kinemimic.pipeline.kinematics.skeleton import NODES

# Landmark -> labels of its markers, in lower case without punctuation; * stands for the side: "*asi" is
# lasi or leftasi, and a word of four letters or more may also have its side behind it (kneelatl). Of each
# landmark's tuples, the first with any label in the file counts (for a cluster: with all labels); all
# labels of that tuple in the file belong to the landmark. Plug-in-Gait; OpenSim's Gait2354, Hamner,
# Rajagopal and Moco examples; OpenCap (whose suffix "_study" is dropped); the Rizzoli institute's (IOR;
# Leardini et al. 2007, Gait & Posture 26, 560-571); the anatomical names (IAS, FLE, FAL …) of van Sint Jan
# 2007, Color Atlas of Skeletal Landmark Definitions, as in Visual3D, Qualisys and Motive; Motive's Baseline
# and Qualisys' sports set (WaistLFront, LKneeOut …); Motek's Human Body Model (LLEK, LMEK …); the CMU
# library (LFWT, LBWT: the front and back of the waist); the medial markers of the Conventional Gait Model 2
# (LKNM, LMED), of AMASS (LKNI, LANI) and the Oxford foot (LMMA); the points of Xsens MVN's C3D
# (pRightKneeLatEpicondyle); and plain words.
_SIDED: dict[str, tuple[tuple[str, ...], ...]] = {
    "asis": (("*asi",), ("*asis",), ("*ias",), ("*sias",), ("waist*front",), ("*fwt",)),
    "psis": (("*psi",), ("*psis",), ("*ips",), ("*sips",), ("waist*back",), ("*bwt",)),
    "knee_lateral": (
        ("*kneelat",),
        ("*kneelateral",),
        ("*kne",),
        ("*lfc",),
        ("*lepi",),
        ("*lkn",),
        ("*le",),
        ("*fle",),
        ("*kneeout",),
        ("*latknee",),
        ("*lateralknee",),
        ("*lknee",),
        ("*latepicondyle",),
        ("*lateralepicondyle",),
        ("*lek",),
        ("*knee",),
        ("*lk",),
        ("*lfe",),
        ("*knel",),
        ("*knee1",),
        ("*lep",),
        ("*lcon",),
        ("*kneelatepicondyle",),
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
        ("*fme",),
        ("*kneein",),
        ("*medknee",),
        ("*medialknee",),
        ("*medepicondyle",),
        ("*medialepicondyle",),
        ("*knm",),
        ("*mek",),
        ("*mknee",),
        ("*mk",),
        ("*mfe",),
        ("*knee2",),
        ("*mep",),
        ("*mcon",),
        ("*kni",),
        ("*kneemedepicondyle",),
    ),
    "ankle_lateral": (
        ("*anklelat",),
        ("*anklelateral",),
        ("*ank",),
        ("*lmal",),
        ("*lak",),
        ("*lm",),
        ("*fal",),
        ("*ankleout",),
        ("*latankle",),
        ("*lateralankle",),
        ("*latank",),
        ("*lankle",),
        ("*latmalleolus",),
        ("*lateralmalleolus",),
        ("*ankle",),
        ("*la",),
        ("*anklat",),
        ("*ankl",),
        ("*mall",),
        ("*lml",),
    ),
    "ankle_medial": (
        ("*anklemed",),
        ("*anklemedial",),
        ("*mank",),
        ("*ankm",),
        ("*ankmed",),
        ("*mmal",),
        ("*mak",),
        ("*mm",),
        ("*tam",),
        ("*anklein",),
        ("*medankle",),
        ("*medialankle",),
        ("*medank",),
        ("*medmalleolus",),
        ("*medialmalleolus",),
        ("*med",),
        ("*mankle",),
        ("*ma",),
        ("*mml",),
        ("*mma",),
        ("*ani",),
    ),
    "toes": (
        ("*toetip",),
        ("*toe",),
        ("*mt2",),
        ("*mt1", "*mt5"),
        ("*fm", "*vm"),
        ("*toelat", "*toemed"),
        ("*fm2",),
        ("*fm1", "*fm5"),
        ("*toeout", "*toein"),
        ("*forefootout", "*forefootin"),
        ("*met",),
        ("*firstmetatarsal", "*fifthmetatarsal"),
    ),
    "acromion": (
        ("*acromium",),
        ("*acromion",),
        ("*sho",),
        ("*acr",),
        ("*shoulder",),
        ("*shl",),
        ("*sh",),
        ("*sae",),
        ("*caj",),
        ("*shouldertop",),
        ("*should",),
    ),
    "elbow": (
        ("*elb", "*elbm"),
        ("*elbowlat", "*elbowmed"),
        ("*lel", "*mel"),
        ("*lelbow", "*melbow"),
        ("*hle", "*hme"),
        ("*elbowout", "*elbowin"),
        ("*latelbow", "*medelbow"),
        ("*lee", "*mee"),
        ("*armlatepicondyle", "*armmedepicondyle"),
        ("*elbow",),
    ),
    "wrist": (
        ("*wra", "*wrb"),
        ("*wristlat", "*wristmed"),
        ("*lwrist", "*mwrist"),
        ("*faradius", "*faulna"),
        ("*rad", "*uln"),
        ("*rsp", "*usp"),
        ("*wristout", "*wristin"),
        ("*latwrist", "*medwrist"),
        ("*wrist",),
        ("*wr",),
        ("*lw", "*mw"),
    ),
    "hand": (("*fin",), ("*hand",), ("*hm2",), ("*handout",)),
}
_MIDDLE: dict[str, tuple[tuple[str, ...], ...]] = {
    "sacrum": (("vsacral",), ("sacr",), ("sacrum",), ("sacral",), ("waistback",), ("sac",)),
    "neck_back": (("c7",), ("cv7",), ("c7spinalprocess",)),
    "neck_front": (("clav",), ("sjn",)),
    "head": (
        ("lfhd", "rfhd", "lbhd", "rbhd"),
        ("ltemple", "rtemple"),
        ("headl", "headr"),
        ("tophead",),
        ("headtop",),
        ("topofhead",),
    ),
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
# Centres that a laboratory's model computed: LHJC, "Right KJC".
_JOINT_CENTRE = re.compile(r"([lr])(?:eft|ight)?([hkasew])jc(?:study)?")
_JOINT_OF_LETTER = {"h": "hip", "k": "knee", "a": "ankle", "s": "shoulder", "e": "elbow", "w": "wrist"}
# Of points that are found as hips: in the middle of the thigh or the shank, beside a knee.
_ON_LEG = re.compile(r"thigh|^(?:l|r|left|right)leg$")
_FIRST_WORD = re.compile(r"([^_.\s-]*)[_.\s-]+(.*[A-Za-z].*)")
# Before the names of Xsens MVN's points.
_POINT = re.compile(r"^p(?=[A-Z][A-Za-z0-9]{2})")
# Labels of points without a name.
_UNNAMED = re.compile(r"\*?\d*|(?:unlabell?ed|new)[ _]?\d+", re.IGNORECASE)
# Letters of a word behind which a side may stand; shorter ones would be other labels (le + l).
_LONG_WORD = 4
# A word before fewer labels is not a subject's name: Top.Head alone says nothing about "Top".
_FEWEST_OF_SUBJECT = 4


def landmarks(labels: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Landmark -> indices of its markers: "asis_left", "sacrum", "thigh_right" (a cluster, exactly three) …

    A subject's name (`without_subject`), case and punctuation are ignored; of a repeated label the first
    counts; unknown labels are ignored.
    """
    index: dict[str, int] = {}
    for marker, label in enumerate(without_subject(labels)):
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
                spellings_of_sets = [[_spellings(label, side) for label in labels] for labels in patterns]
                _add_first_match(found, f"{landmark}_{side}", spellings_of_sets, index, complete=complete)
    return found


def _spellings(label: str, side: str) -> tuple[str, ...]:
    word = label.removeprefix("*")
    behind = [word + s for s in (side[0], side)] if word != label and len(word) >= _LONG_WORD else []
    return (*(label.replace("*", s) for s in (side[0], side)), *behind)


def joint_centres(labels: Sequence[str]) -> dict[str, int]:
    """Node -> index of the point that is named as this joint's centre: "LKJC", "Left Knee", "knee_left" …

    A thigh beside a knee is no hip: in "L.Thigh, L.Knee, L.Ankle" (Helen Hayes) it is a marker in the middle
    of the thigh. Where the shank follows it, the names are those of bones, whose points are their upper ends.
    Nor is a leg beside a knee, "L.Leg", which is a marker on the shank.
    """
    names = tuple(_joint_name(label) for label in without_subject(labels))
    found = joints_by_name(names)
    on_legs = {
        found[f"hip_{side}"]
        for side in SIDES
        if {f"hip_{side}", f"knee_{side}"} <= found.keys()
        and _ON_LEG.search(normalised(names[found[f"hip_{side}"]]))
        and "knee" in normalised(labels[found[f"knee_{side}"]])
    }
    if on_legs:
        found = joints_by_name(tuple("" if k in on_legs else name for k, name in enumerate(names)))
    return found


def _joint_name(label: str) -> str:
    found = _JOINT_CENTRE.fullmatch(normalised(label))
    return f"{_JOINT_OF_LETTER[found[2]]} {'left' if found[1] == 'l' else 'right'}" if found else label


def without_subject(labels: Sequence[str]) -> tuple[str, ...]:
    """The labels without a subject's name, before a colon ("Jim:LASI") or as first word of most ("Jim_LASI").

    A side ("L_IAS") is not a name.
    """
    bare = tuple(label.rsplit(":", 1)[-1].strip() for label in labels)
    if sum(map(bool, map(_POINT.match, bare))) > len(bare) // 2:
        bare = tuple(_POINT.sub("", label) for label in bare)
    while True:
        parts = [_FIRST_WORD.fullmatch(label) for label in bare]
        words = Counter(part[1].lower() for part in parts if part)
        word, count = max(words.items(), key=lambda item: item[1], default=("", 0))
        named = sum(map(is_named, bare))
        if count < max(_FEWEST_OF_SUBJECT, named // 2 + 1) or word in ("l", "r", *SIDES):
            return bare
        bare = tuple(
            part[2] if part and part[1].lower() == word else label
            for part, label in zip(parts, bare, strict=True)
        )


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


def is_named(label: str) -> bool:
    """Whether a label is a name, and not the number of a point without one."""
    return _UNNAMED.fullmatch(label.strip()) is None


def body_labels(labels: Sequence[str]) -> tuple[str, ...]:
    """The labels of joints and known markers, in their order; files store angles, forces and moments as
    points too."""
    known = {k for markers in landmarks(labels).values() for k in markers}
    known |= set(joint_centres(labels).values())
    return tuple(labels[k] for k in sorted(known))

"""Several people among the labelled points of a file: whose points are whose, and who is seen in most frames.

A person's name is what stands before a colon ("Ann:LASI"), or the first ("Ann_LASI") or the last word
("LASI_2") of the labels. Only names that come with legs are people: a box is none, and neither is a second
set of names for the same body, such as a model's joint centres beside the markers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.joint_names import REQUIRED
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.optical.marker_names import SIDES, joint_centres, landmarks

_FIRST_WORD = re.compile(r"(?P<name>[^_.\s:-]+)[_.\s-]+(?P<label>.+)")
_LAST_WORD = re.compile(r"(?P<label>.+?)(?:[_.\s-]+(?P<name>[^_.\s:-]+)|(?P<number>\d))")
# Knees and ankles of two people are farther apart than this share of a shank (in the median), those of two
# models of one person are not.
_SAME_PLACE = 0.3
# A person is seen in a frame that has this share of the points with known names.
_SEEN = 0.5


def main_person(labels: tuple[str, ...], points: Array) -> tuple[tuple[str, ...], Array, list[Defect]]:
    """Labels (N,) and points (T, N, 3) without those of other people, and the defect that there were others.

    labels: (M,); points: (T, M, 3) in any unit, NaN or zeros where missing. The person seen in most frames
    stays, of several the first, with the points that are nobody's.
    """
    kept, new, defects = without_others(labels, points)
    return (new, points[:, kept], defects) if len(kept) < len(labels) else (labels, points, [])


def without_others(labels: tuple[str, ...], points: Array) -> tuple[list[int], tuple[str, ...], list[Defect]]:
    """The indices (N,) of the points that `main_person` keeps, their labels, and the defect."""
    everyone = list(range(len(labels))), labels, list[Defect]()
    bare, people = _people(labels)
    if len(people) < 2:
        return everyone
    seen = np.logical_and(np.isfinite(points).all(axis=-1), points.any(axis=-1))
    people = _distinct(bare, people, np.where(seen[..., None], points, np.nan))
    if len(people) < 2:
        return everyone
    frames = {name: _seen(bare, members, seen) for name, members in people.items()}
    main = seen_most(frames)
    others = {k for name, members in people.items() if name != main for k in members}
    kept = [k for k in range(len(labels)) if k not in others]
    # What stands before a label is known not to belong to it (marker_names.py), unlike what stands behind it.
    new = tuple(bare[k] if labels[k].startswith(bare[k]) else labels[k] for k in kept)
    return kept, new, other_people(frames, main)


def seen_most(frames: Mapping[str, Mask]) -> str:
    """The person seen in most frames, the first of several; frames: name -> frames (T,) with that person."""
    return max(frames, key=lambda name: int(frames[name].sum()))


def other_people(frames: Mapping[str, Mask], main: str) -> list[Defect]:
    """The defect that others than the main person are in the file; frames: as in `seen_most`."""
    others = {name: mask for name, mask in frames.items() if name != main and mask.any()}
    if not others:
        return []
    listed = ", ".join(
        f"{_called(name)} in {plural(int(mask.sum()), 'frame')}" for name, mask in others.items()
    )
    text = f"{len(others)} more ({listed}), dropped; {_called(main)}, in {int(frames[main].sum())}, is read"
    if any((mask & frames[main]).any() for mask in others.values()):
        return [Defect("several_people", len(others), "people", "repaired", text)]
    text += "; never together with them: they may be the same person under another name"
    return [Defect("several_people", len(others), "people", "flagged", text)]


def _called(name: str) -> str:
    return repr(name[:40]) if name else "the one without a name"


def _people(labels: tuple[str, ...]) -> tuple[tuple[str, ...], dict[str, list[int]]]:
    """The labels without names, and name -> points, of the naming that gives several people."""
    # In "L.Knee.Lat" the last word says which marker it is, not whose.
    whole = {labels[k] for markers in landmarks(labels).values() for k in markers}
    for naming in (_before_colon, _first_word, _last_word):
        split = [("", one) if naming is _last_word and one in whole else naming(one) for one in labels]
        names, rests = zip(*split, strict=True) if split else ((), ())
        named = {
            name: [k for k, one in enumerate(names) if one == name]
            for name in dict.fromkeys(filter(None, names))
        }
        members = {name: found for name, found in named.items() if has_legs([rests[k] for k in found])}
        unnamed = [k for k, name in enumerate(names) if name not in members]
        bare = tuple(
            rest if name in members else label for label, name, rest in zip(labels, names, rests, strict=True)
        )
        if members and has_legs([labels[k] for k in unnamed]):
            members[""] = unnamed
        if len(members) > 1:
            return bare, dict(sorted(members.items(), key=lambda item: item[1][0]))
    return labels, {}


def _before_colon(label: str) -> tuple[str, str]:
    name, _, rest = label.rpartition(":")
    return name.strip(), rest


def _first_word(label: str) -> tuple[str, str]:
    parts = _FIRST_WORD.fullmatch(label)
    return (parts["name"], parts["label"]) if parts else ("", label)


def _last_word(label: str) -> tuple[str, str]:
    parts = _LAST_WORD.fullmatch(label)
    return (parts["name"] or parts["number"], parts["label"]) if parts else ("", label)


def has_legs(labels: Sequence[str]) -> bool:
    """Whether there are hips, knees and ankles, or markers at, or clusters around, the knees and ankles."""
    if len(labels) < len(REQUIRED):
        return False
    if joint_centres(labels).keys() >= set(REQUIRED):
        return True
    marked = landmarks(labels)
    return all(
        f"{marker}_{side}" in marked or f"{cluster}_{side}" in marked
        for side in SIDES
        for marker, cluster in (("knee_lateral", "thigh"), ("ankle_lateral", "shank"))
    )


def _known(labels: tuple[str, ...], members: list[int]) -> dict[str, int]:
    """Node or landmark -> the (first) point of it among a person's."""
    names = [labels[k] for k in members]
    marked = {landmark: members[markers[0]] for landmark, markers in landmarks(names).items()}
    return marked | {node: members[k] for node, k in joint_centres(names).items()}


def _seen(labels: tuple[str, ...], members: list[int], seen: Mask) -> Mask:
    """The frames (T,) in which a person is seen; seen: (T, M) of the points."""
    known = list(_known(labels, members).values())
    return np.asarray(seen[:, known].mean(axis=1) >= _SEEN)


def _distinct(
    labels: tuple[str, ...], people: Mapping[str, list[int]], points: Array
) -> dict[str, list[int]]:
    """The people without those who are always where an earlier one is; points: (T, M, 3), NaN if missing."""
    distinct: dict[str, list[int]] = {}
    places = {name: _legs(labels, members, points) for name, members in people.items()}
    for name, members in people.items():
        if not any(_together(places[name], places[one]) for one in distinct):
            distinct[name] = members
    return distinct


def _legs(labels: tuple[str, ...], members: list[int], points: Array) -> dict[str, Array]:
    """ "knee_left" … -> (T, 3) of the joint's centre or marker, or of the segment's cluster."""
    known = _known(labels, members)
    spellings = {
        f"{joint}_{side}": (f"{joint}_{side}", f"{joint}_lateral_{side}", f"{cluster}_{side}")
        for side in SIDES
        for joint, cluster in (("knee", "thigh"), ("ankle", "shank"))
    }
    return {
        joint: points[:, next(known[name] for name in names if name in known)]
        for joint, names in spellings.items()
        if any(name in known for name in names)
    }


def _together(one: Mapping[str, Array], other: Mapping[str, Array]) -> bool:
    """Whether the legs are at the same places in the frames that have both."""
    with np.errstate(over="ignore"):  # damaged numbers, which are refused later
        apart = _finite([np.linalg.norm(one[k] - other[k], axis=-1) for k in one if k in other])
        shanks = _finite(
            [np.linalg.norm(one[f"knee_{side}"] - one[f"ankle_{side}"], axis=-1) for side in SIDES]
        )
    return bool(len(apart) and len(shanks) and np.median(apart) < _SAME_PLACE * np.median(shanks))


def _finite(lengths: list[Array]) -> Array:
    every = np.concatenate(lengths) if lengths else np.empty(0)
    return every[np.isfinite(every)]

"""A clip of the nodes from labelled points: optical markers on the skin, or joints by their own names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.proportions import TRUNK, stature
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, Skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.node_parents import nearest_ancestor
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.joint_centres import (
    HALF_ANKLE,
    HALF_KNEE,
    Pelvis,
    centre_of_rotation,
    hip_centre,
    inward,
    pelvis,
    unit,
)
from kinemimic.pipeline.readers.mocap.marker_names import SIDES, landmarks

_LEGS = tuple(f"{joint}_{side}" for side in SIDES for joint in ("hip", "knee", "ankle"))
# Rab, Petuskey & Bagley 2002 (Gait & Posture 15, 113-119): the shoulder's centre lies below the acromion by
# this share of the distance between the acromia.
_BELOW_ACROMION = 0.17
# Where ankles lie that no marker shows, to begin the search: this share of the way from the heel to the top
# of the midfoot, and so far (metres) up the shank.
_ANKLE_ON_FOOT, _ANKLE_UP = 0.4, 0.03


def clip_of_markers(
    labels: tuple[str, ...],
    times: Array,
    points: Array,
    *,
    format: Format,
    reading: Mapping[str, Any],
    world_from_file: Array,
    source: Source,
    angles: Mapping[str, Array] | None = None,
) -> Clip:
    """The clip of those of the 20 nodes that the points show.

    labels: (M,) the points' names; times: (T,) seconds; points: (T, M, 3) metres in the file's axes,
    NaN or zeros where missing (a mirrored file gives a mirrored clip); format, reading, world_from_file,
    angles: as in `recording.clip_of_points`. The reading's notes say how each joint's centre was found.
    Points that bear the names of hips, knees and ankles are taken for these joints. Otherwise hips follow
    from the pelvis' markers, knees and ankles from markers at the joint or from clusters on the segments, the
    rest of the body from what there is; the spine node stands on the pelvis' own long axis, so that a pelvis
    frame taken from the clip is the anatomical one. A node is missing where a marker that it follows from is.
    CaptureError if hips, knees or ankles cannot be found: it names what is missing.
    """
    named = joints_of_nodes(labels)
    notes: list[str] = []
    if named.keys() >= set(_LEGS):
        centres = {node: points[:, point] for node, point in named.items()}
        notes.append("points that bear the names of joints are taken for their centres")
    else:
        centres = _centres(_Markers(labels, points), notes, source)
    nodes = tuple(node for node in NODES if node in centres)
    return clip_of_points(
        _skeleton(nodes),
        times,
        np.stack([centres[node] for node in nodes], axis=1),
        None,
        format=format,
        reading={**reading, "notes": [*reading["notes"], *notes]},
        world_from_file=world_from_file,
        angles=angles,
    )


class _Markers:
    """The places (T, 3) of landmarks, NaN where missing; a landmark of several markers is at their middle."""

    def __init__(self, labels: tuple[str, ...], points: Array) -> None:
        self.labels, self.points, self.found = labels, points, landmarks(labels)

    def __contains__(self, landmark: str) -> bool:
        return landmark in self.found

    def __getitem__(self, landmark: str) -> Array:
        first, *others = (self._place(marker) for marker in self.found[landmark])
        return np.asarray(sum(others, first) / (1 + len(others)))

    def cluster(self, landmark: str) -> Array:
        """(T, n, 3) the markers of a landmark."""
        return np.stack([self._place(marker) for marker in self.found[landmark]], axis=1)

    def _place(self, marker: int) -> Array:
        place = self.points[:, marker]
        x, y, z = place.T
        missing = ~np.isfinite(x + y + z) | ((x == 0.0) & (y == 0.0) & (z == 0.0))
        return np.where(missing[:, None], np.nan, place)


def _centres(markers: _Markers, notes: list[str], source: Source) -> dict[str, Array]:
    _check(markers, source)
    back = markers["sacrum"] if "sacrum" in markers else 0.5 * (markers["psis_left"] + markers["psis_right"])
    frame = pelvis(markers["asis_left"], markers["asis_right"], back, _below(markers))
    notes.append("hip centres from the ASIS and the sacrum by the regression of Bell et al. 1990")
    centres: dict[str, Array] = {}
    for side in SIDES:
        centres |= _leg(markers, frame, side, notes)
    centres |= _trunk(markers, frame, centres)
    for side in SIDES:
        for node in ("elbow", "wrist", "hand"):
            if f"{node}_{side}" in markers:
                centres[f"{node}_{side}"] = markers[f"{node}_{side}"]
        if f"toes_{side}" in markers:
            centres[f"foot_{side}"] = markers[f"toes_{side}"]
    return centres


def _check(markers: _Markers, source: Source) -> None:
    """CaptureError that names the first joint for which markers are missing, and those that would do."""
    lacking = [f"{side} ASIS" for side in SIDES if f"asis_{side}" not in markers]
    if "sacrum" not in markers and not {"psis_left", "psis_right"} <= markers.found.keys():
        lacking.append("sacrum or both PSIS")
    for side in SIDES:
        for joint, above, below in (("knee", "thigh", "shank"), ("ankle", "shank", "foot")):
            clusters = f"{above}_{side}" in markers and f"{below}_{side}" in markers
            if f"{joint}_lateral_{side}" not in markers and not clusters:
                lacking.append(f"{side} {joint} (at its side, or three each on {above} and {below})")
    if lacking:
        shown = ", ".join(label for label in markers.labels if label)[:300]
        raise source.error(
            expected="markers from which hips, knees and ankles follow",
            found=f"none for {'; '.join(lacking)} among {shown or 'points without labels'}",
        )


def _below(markers: _Markers) -> Array:
    """(T, 3) between the knees, or the shanks where no marker is at a knee."""
    places = [
        markers[f"{place}_{side}"]
        for side in SIDES
        for place in (("knee_lateral",) if f"knee_lateral_{side}" in markers else ("shank",))
    ]
    return np.asarray(0.5 * (places[0] + places[1]))


def _leg(markers: _Markers, frame: Pelvis, side: str, notes: list[str]) -> dict[str, Array]:
    hip = hip_centre(frame, side)
    medial = -frame.left if side == "left" else frame.left
    if f"knee_lateral_{side}" in markers:
        knee = _beside_marker(markers, "knee", side, hip, medial, HALF_KNEE, notes)
    else:
        thigh, shank = markers.cluster(f"thigh_{side}"), markers.cluster(f"shank_{side}")
        middle = 0.5 * (thigh.mean(axis=1) + shank.mean(axis=1))
        # Clusters are worn on the outer side: the guess is as far to the side as the hip.
        guess = middle - np.sum((middle - hip) * medial, axis=-1, keepdims=True) * medial
        knee = centre_of_rotation(thigh, shank, guess)
        _tell(notes, "knee", "the centres of rotation between clusters of markers (Ehrig et al. 2006)")
    if f"ankle_lateral_{side}" in markers:
        ankle = _beside_marker(markers, "ankle", side, knee, medial, HALF_ANKLE, notes)
    else:
        shank, foot = markers.cluster(f"shank_{side}"), markers.cluster(f"foot_{side}")
        heel, top = foot[:, 0], foot[:, 1]
        guess = heel + _ANKLE_ON_FOOT * (top - heel)
        guess += _ANKLE_UP * unit(shank.mean(axis=1) - guess)
        ankle = centre_of_rotation(shank, foot, guess)
        _tell(notes, "ankle", "the centres of rotation between clusters of markers (Ehrig et al. 2006)")
    return {f"hip_{side}": hip, f"knee_{side}": knee, f"ankle_{side}": ankle}


def _beside_marker(
    markers: _Markers, joint: str, side: str, above: Array, medial: Array, half: float, notes: list[str]
) -> Array:
    lateral = markers[f"{joint}_lateral_{side}"]
    if f"{joint}_medial_{side}" in markers:
        _tell(notes, joint, "midway between the medial and the lateral marker")
        return np.asarray(0.5 * (lateral + markers[f"{joint}_medial_{side}"]))
    _tell(
        notes, joint, f"{1000 * half:.0f} mm inward of the lateral marker, along the pelvis' axis (assumed)"
    )
    return inward(lateral, above, medial, half)


def _tell(notes: list[str], joint: str, how: str) -> None:
    note = f"{joint} centres: {how}"
    if note not in notes:
        notes.append(note)


def _trunk(markers: _Markers, frame: Pelvis, legs: Mapping[str, Array]) -> dict[str, Array]:
    """Middle nodes and shoulders; the shoulder_center only from markers of its own."""
    middle = 0.5 * (legs["hip_left"] + legs["hip_right"])
    body = np.full((len(middle), len(NODES), 3), np.nan)
    for node, place in legs.items():
        body[:, NODE_INDEX[node]] = place
    trunk = {"hip_center": middle, "spine": middle + TRUNK / 3.0 * stature(body) * frame.up}
    if "neck_back" in markers and "neck_front" in markers:
        trunk["shoulder_center"] = 0.5 * (markers["neck_back"] + markers["neck_front"])
    if "acromion_left" in markers and "acromion_right" in markers:
        left, right = markers["acromion_left"], markers["acromion_right"]
        down = unit(middle - 0.5 * (left + right))
        drop = _BELOW_ACROMION * np.linalg.norm(left - right, axis=-1, keepdims=True) * down
        trunk |= {"shoulder_left": left + drop, "shoulder_right": right + drop}
    if "head" in markers:
        trunk["head"] = markers["head"]
    return trunk


def _skeleton(nodes: tuple[str, ...]) -> Skeleton:
    """The tree of these of the 20 nodes; rest offsets unknown (zeros)."""

    ancestors = [nearest_ancestor(node, nodes) for node in nodes]
    parents = tuple(-1 if ancestor is None else nodes.index(ancestor) for ancestor in ancestors)
    return Skeleton(nodes, parents, np.zeros((len(nodes), 3)))

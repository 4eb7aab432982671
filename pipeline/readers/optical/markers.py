"""Build a clip of the nodes from labelled points: optical markers on the skin, or named joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_by_name
from kinemimic.pipeline.kinematics.proportions import TRUNK, stature
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.kinematics.vectors import median, unit
from kinemimic.pipeline.readers.base.clip_building import clip_of_points
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.joint_centres import (
    HALF_ANKLE,
    HALF_KNEE,
    Pelvis,
    centre_of_rotation,
    hip_centre,
    inward,
    pelvis,
)
from kinemimic.pipeline.readers.optical.marker_names import SIDES, landmarks
from kinemimic.pipeline.readers.optical.marker_set import SUFFIX, MarkerSet, marker_set

_LEGS = tuple(f"{joint}_{side}" for side in SIDES for joint in ("hip", "knee", "ankle"))
# Rab, Petuskey & Bagley 2002 (Gait & Posture 15, 113-119): the shoulder's centre is below the acromion by
# this share of the distance between the acromia.
_BELOW_ACROMION = 0.17
# Initial guess for an ankle without markers: this share of the way from the heel to the top of the midfoot,
# and this far (metres) up the shank.
_ANKLE_OVER_FOOT, _ANKLE_UP = 0.4, 0.03
_AUTHORS = {
    "bell": "Bell et al. 1990",
    "harrington": "Harrington et al. 2007",
    "davis": "Davis et al. 1991",
}


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
    """The clip of those of the 20 nodes that can be computed from the points.

    labels: (M,) names of the points; times: (T,) seconds; points: (T, M, 3) metres in the file's axes, NaN or
    zeros where missing (a mirrored file gives a mirrored clip); format, reading, world_from_file, angles: as
    in `clip_of_points`. The reading's notes say how each joint's centre was found.

    Points named like hips, knees and ankles are taken as these joints. Otherwise hips are computed from the
    pelvis markers, knees and ankles from markers at the joint or from clusters on the segments, the rest of
    the body from what is available. The spine node lies on the pelvis' own long axis, so that a pelvis frame
    computed from the clip is the anatomical one. A node is missing where one of its markers is.

    Raises CaptureError naming what is missing if hips, knees or ankles cannot be computed.
    """
    joint_points = joints_by_name(labels)
    notes: list[str] = []
    if joint_points.keys() >= set(_LEGS):
        centres = {node: points[:, point] for node, point in joint_points.items()}
        notes.append("points named like joints are taken as their centres")
    else:
        centres = _centres(_Markers(labels, points), marker_set(source), notes, source)
    nodes = tuple(node for node in NODES if node in centres)
    return clip_of_points(
        skeleton_of(nodes),
        times,
        np.stack([centres[node] for node in nodes], axis=1),
        None,
        format=format,
        reading={**reading, "notes": [*reading["notes"], *notes]},
        world_from_file=world_from_file,
        angles=angles,
    )


class _Markers:
    """Positions (T, 3) of landmarks, NaN where missing; the mean for a landmark of several markers."""

    def __init__(self, labels: tuple[str, ...], points: Array) -> None:
        self.labels, self.points, self.found = labels, points, landmarks(labels)

    def __contains__(self, landmark: str) -> bool:
        return landmark in self.found

    def __getitem__(self, landmark: str) -> Array:
        first, *others = (self._position(marker) for marker in self.found[landmark])
        return np.asarray(sum(others, first) / (1 + len(others)))

    def cluster(self, landmark: str) -> Array:
        """The markers (T, n, 3) of a landmark."""
        return np.stack([self._position(marker) for marker in self.found[landmark]], axis=1)

    def _position(self, marker: int) -> Array:
        position = self.points[:, marker]
        x, y, z = position.T
        missing = ~np.isfinite(x + y + z) | ((x == 0.0) & (y == 0.0) & (z == 0.0))
        return np.where(missing[:, None], np.nan, position)


def _centres(markers: _Markers, chosen: MarkerSet, notes: list[str], source: Source) -> dict[str, Array]:
    _require_markers(markers, source)
    back = markers["sacrum"] if "sacrum" in markers else 0.5 * (markers["psis_left"] + markers["psis_right"])
    frame = pelvis(markers["asis_left"], markers["asis_right"], back, _below(markers))
    notes.append(f"hip centres from the ASIS and the sacrum by the regression of {_AUTHORS[chosen.hips]}")
    centres: dict[str, Array] = {}
    for side in SIDES:
        centres |= _leg(markers, frame, side, chosen, notes)
    centres |= _trunk(markers, frame, centres)
    for side in SIDES:
        for node in ("elbow", "wrist", "hand"):
            if f"{node}_{side}" in markers:
                centres[f"{node}_{side}"] = markers[f"{node}_{side}"]
        if f"toes_{side}" in markers:
            centres[f"foot_{side}"] = markers[f"toes_{side}"]
    return centres


def _require_markers(markers: _Markers, source: Source) -> None:
    """Raise CaptureError listing the joints without markers, and the markers that would suffice."""
    missing_markers = [f"{side} ASIS" for side in SIDES if f"asis_{side}" not in markers]
    if "sacrum" not in markers and not {"psis_left", "psis_right"} <= markers.found.keys():
        missing_markers.append("sacrum or both PSIS")
    for side in SIDES:
        for joint, above, below in (("knee", "thigh", "shank"), ("ankle", "shank", "foot")):
            clusters = f"{above}_{side}" in markers and f"{below}_{side}" in markers
            if f"{joint}_lateral_{side}" not in markers and not clusters:
                missing_markers.append(f"{side} {joint} (at the joint, or three each on {above} and {below})")
    if missing_markers:
        labels_shown = ", ".join(label for label in markers.labels if label)[:300]
        raise source.error(
            expected="markers from which hips, knees and ankles can be computed",
            found=f"none for {'; '.join(missing_markers)} among {labels_shown or 'points without labels'}",
            advice=f"say which marker is where in NAME{SUFFIX}, if they have other names",
        )


def _below(markers: _Markers) -> Array:
    """The midpoint (T, 3) of the knees, or of the shanks without knee markers."""
    positions = [
        markers[f"{landmark}_{side}"]
        for side in SIDES
        for landmark in (("knee_lateral",) if f"knee_lateral_{side}" in markers else ("shank",))
    ]
    return np.asarray(0.5 * (positions[0] + positions[1]))


def _leg(
    markers: _Markers, frame: Pelvis, side: str, chosen: MarkerSet, notes: list[str]
) -> dict[str, Array]:
    marker = 0.5 * chosen.marker_diameter
    half_knee = HALF_KNEE if chosen.knee_width is None else 0.5 * chosen.knee_width + marker
    half_ankle = HALF_ANKLE if chosen.ankle_width is None else 0.5 * chosen.ankle_width + marker
    length = _leg_length(markers, side) if chosen.leg_length is None else chosen.leg_length
    hip = hip_centre(frame, side, chosen.hips, leg=length, marker=marker)
    medial = -frame.left if side == "left" else frame.left
    if f"knee_lateral_{side}" in markers:
        knee = _centre_at_marker(markers, "knee", side, hip, medial, half_knee, notes)
    else:
        thigh, shank = markers.cluster(f"thigh_{side}"), markers.cluster(f"shank_{side}")
        middle = 0.5 * (thigh.mean(axis=1) + shank.mean(axis=1))
        # Clusters are worn laterally: the guess is moved inward to the lateral position of the hip.
        guess = middle - np.sum((middle - hip) * medial, axis=-1, keepdims=True) * medial
        knee = centre_of_rotation(thigh, shank, guess)
        _add_note(notes, "knee", "the centres of rotation between clusters of markers (Ehrig et al. 2006)")
    if f"ankle_lateral_{side}" in markers:
        ankle = _centre_at_marker(markers, "ankle", side, knee, medial, half_ankle, notes)
    else:
        shank, foot = markers.cluster(f"shank_{side}"), markers.cluster(f"foot_{side}")
        heel, top = foot[:, 0], foot[:, 1]
        guess = heel + _ANKLE_OVER_FOOT * (top - heel)
        guess += _ANKLE_UP * unit(shank.mean(axis=1) - guess)
        ankle = centre_of_rotation(shank, foot, guess)
        _add_note(notes, "ankle", "the centres of rotation between clusters of markers (Ehrig et al. 2006)")
    return {f"hip_{side}": hip, f"knee_{side}": knee, f"ankle_{side}": ankle}


def _leg_length(markers: _Markers, side: str) -> float:
    """Median length of the leg from the ASIS over the knee's marker to the ankle's; NaN without these."""
    way = [f"{landmark}_{side}" for landmark in ("asis", "knee_lateral", "ankle_lateral")]
    if any(landmark not in markers for landmark in way):
        return float("nan")
    asis, knee, ankle = (markers[landmark] for landmark in way)
    return median(np.linalg.norm(asis - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1))


def _centre_at_marker(
    markers: _Markers, joint: str, side: str, above: Array, medial: Array, half: float, notes: list[str]
) -> Array:
    lateral = markers[f"{joint}_lateral_{side}"]
    if f"{joint}_medial_{side}" in markers:
        _add_note(notes, joint, "midway between the medial and the lateral marker")
        return np.asarray(0.5 * (lateral + markers[f"{joint}_medial_{side}"]))
    _add_note(
        notes, joint, f"{1000 * half:.0f} mm inward of the lateral marker, along the pelvis' axis (assumed)"
    )
    return inward(lateral, above, medial, half)


def _add_note(notes: list[str], joint: str, method: str) -> None:
    note = f"{joint} centres: {method}"
    if note not in notes:
        notes.append(note)


def _trunk(markers: _Markers, frame: Pelvis, legs: Mapping[str, Array]) -> dict[str, Array]:
    """Middle nodes and shoulders; shoulder_center only if it has markers of its own."""
    middle = 0.5 * (legs["hip_left"] + legs["hip_right"])
    body = np.full((len(middle), len(NODES), 3), np.nan)
    for node, position in legs.items():
        body[:, NODE_INDEX[node]] = position
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

"""Build a clip of the nodes from labelled points: optical markers on the skin, or named joints."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED
from kinemimic.pipeline.kinematics.proportions import SHANK, THIGH, TRUNK, stature
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODE_INDEX, NODES, TRACKED
from kinemimic.pipeline.kinematics.vectors import median, unit
from kinemimic.pipeline.readers.base.clip_building import clip_of_points
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.assumed_trunk import standing_tilt, upright_trunk
from kinemimic.pipeline.readers.optical.joint_centres import (
    HALF_ANKLE,
    HALF_KNEE,
    Pelvis,
    centre_of_rotation,
    hip_centre,
    inward,
    pelvis,
)
from kinemimic.pipeline.readers.optical.marker_names import SIDES, joint_centres, landmarks
from kinemimic.pipeline.readers.optical.marker_set import SUFFIX, MarkerSet, marker_set
from kinemimic.pipeline.readers.optical.rigid_segments import fill_rigid

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

    If points are named like hips, knees and ankles, all points named like joints are these joints, unless
    the hips are on the skin (`_on_skin`). Otherwise hips are computed from the pelvis markers, knees and
    ankles from markers at the joint or from clusters on the segments. The rest of the body follows from what
    is available. The spine node lies on the pelvis' own long axis, so that a pelvis frame computed from the
    clip is the anatomical one. A marker that was never seen does not count; one that is missing for a while
    is filled from others on its segment (rigid_segments.py), else the nodes computed from it are missing.
    Without markers on the trunk, shoulder_center is inferred (assumed_trunk.py).

    Raises CaptureError naming what is missing if hips, knees or ankles cannot be computed.
    """
    markers = _Markers(labels, points)
    _require_legs(markers, labels, source)
    chosen = marker_set(source)
    named = joint_centres(markers.labels)
    notes: list[str] = []
    centres: dict[str, Array] = {}
    if named.keys() >= set(REQUIRED):
        centres = {node: markers.points[:, point] for node, point in named.items()}
        if "hip_left" not in chosen.markers and (why := _on_skin(markers, centres)):
            notes.append(f"points named like joints are markers on the skin: {why}")
            centres = {}
        else:
            notes.append("points named like joints are taken as their centres")
    if unseen := _never_seen(markers, labels):
        notes.append(f"never seen: {', '.join(unseen)}")
    inferred: set[str] = set()
    if not _missing_of_pelvis(markers):
        if not centres and chosen.hips == "davis" and chosen.leg_length is None:
            _require_leg_length(markers, source)
        centres = _centres(markers, centres, chosen, notes, inferred)
    nodes = tuple(node for node in NODES if node in centres)
    states = np.array([INFERRED if node in inferred else TRACKED for node in nodes], dtype=np.uint8)
    return clip_of_points(
        skeleton_of(nodes),
        times,
        np.stack([centres[node] for node in nodes], axis=1),
        np.broadcast_to(states, (len(times), len(nodes))),
        format=format,
        reading={**reading, "notes": [*reading["notes"], *notes]},
        world_from_file=world_from_file,
        angles=angles,
    )


def _on_skin(markers: _Markers, joints: Mapping[str, Array]) -> str:
    """Why points named like hips, knees and ankles are markers on the skin, "" if they are the joints.

    The hips' centres are nearer to each other than the ASIS (0.7 of their distance), markers over the
    trochanters are farther apart.
    """
    if _missing_of_pelvis(markers) or _missing_of_legs(markers):
        return ""
    hips, asis = (
        median(np.linalg.norm(left - right, axis=-1))
        for left, right in (
            (joints["hip_left"], joints["hip_right"]),
            (markers["asis_left"], markers["asis_right"]),
        )
    )
    return f"the hips are {hips:.2f} m apart, the ASIS {asis:.2f} m" if hips > asis else ""


def require_legs(labels: tuple[str, ...], points: Array, source: Source) -> None:
    """Raise CaptureError, as `clip_of_markers` does, if hips, knees or ankles cannot be computed.

    labels: (M,); points: (T, M, 3) in any unit, NaN or zeros where missing.
    """
    _require_legs(_Markers(labels, points), labels, source)


def _require_legs(markers: _Markers, labels: tuple[str, ...], source: Source) -> None:
    missing = [*_missing_of_pelvis(markers), *_missing_of_legs(markers)]
    if not missing or joint_centres(markers.labels).keys() >= set(REQUIRED):
        return
    unseen = ", ".join(_never_seen(markers, labels))[:100]
    never = f" ({unseen} never seen)" if unseen else ""
    raise source.error(
        expected="markers from which hips, knees and ankles can be computed",
        found=f"none for {'; '.join(missing)}{never} among "
        f"{', '.join(label for label in labels if label)[:300] or 'points without labels'}",
        advice=f"say which marker is where in NAME{SUFFIX}, if they have other names",
    )


def _require_leg_length(markers: _Markers, source: Source) -> None:
    if any(np.isnan(_leg_length(markers, side)) for side in SIDES):
        raise source.error(
            expected='leg_length in the marker set, or lateral knee and ankle markers, for hips = "davis"',
            found="neither",
        )


def _never_seen(markers: _Markers, labels: tuple[str, ...]) -> list[str]:
    """The labels of known markers and joints without a position in any frame."""
    known = {*chain(*landmarks(labels).values()), *joint_centres(labels).values()}
    return [labels[k] for k in sorted(known) if not markers.labels[k]]


class _Markers:
    """Positions (T, 3) of landmarks, NaN where missing; the mean for a landmark of several markers.

    labels: (M,), "" for a marker that was never seen; points: (T, M, 3), NaN where missing.
    """

    def __init__(self, labels: tuple[str, ...], points: Array) -> None:
        x, y, z = np.moveaxis(points, -1, 0)
        # Written out per axis: numpy takes five times as long to reduce an axis of three.
        missing = ~(np.isfinite(x) & np.isfinite(y) & np.isfinite(z)) | ((x == 0) & (y == 0) & (z == 0))
        self.points = np.where(missing[..., None], np.nan, points)
        never = missing.all(axis=0)
        self.labels = tuple("" if gone else label for label, gone in zip(labels, never, strict=True))
        self.found = landmarks(self.labels)

    def __contains__(self, landmark: str) -> bool:
        return landmark in self.found

    def __getitem__(self, landmark: str) -> Array:
        first, *others = (self.points[:, marker] for marker in self.found[landmark])
        return np.asarray(sum(others, first) / (1 + len(others)))

    def cluster(self, landmark: str) -> Array:
        """The markers (T, n, 3) of a landmark."""
        return np.asarray(self.points[:, list(self.found[landmark])])

    def fill(self, notes: list[str]) -> None:
        """Fill the gaps of markers on rigid segments, and say which."""
        self.points, filled = fill_rigid(self.points, self.found)
        counts = {self.labels[k]: int(filled[:, k].sum()) for k in np.flatnonzero(filled.any(axis=0))}
        if counts:
            frames = ", ".join(f"{label} in {count} frames" for label, count in counts.items())
            notes.append(f"hidden markers filled from others on the same segment: {frames}")


def _centres(
    markers: _Markers, given: Mapping[str, Array], chosen: MarkerSet, notes: list[str], inferred: set[str]
) -> dict[str, Array]:
    """The nodes (T, 3) that the markers give, and those given: none, or at least hips, knees and ankles.

    Adds sentences for the user to `notes`, and nodes that no marker shows to `inferred`.
    """
    markers.fill(notes)
    back = markers["sacrum"] if "sacrum" in markers else 0.5 * (markers["psis_left"] + markers["psis_right"])
    below = 0.5 * (given["knee_left"] + given["knee_right"]) if given else _below(markers)
    frame = pelvis(markers["asis_left"], markers["asis_right"], back, below)
    centres = dict(given)
    if not centres:
        notes.append(f"hip centres from the ASIS and the sacrum by the regression of {_AUTHORS[chosen.hips]}")
        for side in SIDES:
            centres |= _leg(markers, frame, side, chosen, notes)
    centres = _trunk(markers, frame, centres) | centres
    if not _shows_trunk(centres):
        centres["shoulder_center"] = _assumed_shoulders(frame, centres, notes)
        inferred.add("shoulder_center")
    for side in SIDES:
        for node in ("elbow", "wrist", "hand"):
            if f"{node}_{side}" in markers:
                centres.setdefault(f"{node}_{side}", markers[f"{node}_{side}"])
        if f"toes_{side}" in markers:
            centres.setdefault(f"foot_{side}", markers[f"toes_{side}"])
    return centres


def _missing_of_pelvis(markers: _Markers) -> list[str]:
    missing = [f"{side} ASIS" for side in SIDES if f"asis_{side}" not in markers]
    if "sacrum" not in markers and not {"psis_left", "psis_right"} <= markers.found.keys():
        missing.append("sacrum or both PSIS")
    return missing


def _missing_of_legs(markers: _Markers) -> list[str]:
    """The joints without markers, and the markers that would suffice."""
    missing = []
    for side in SIDES:
        for joint, above, below in (("knee", "thigh", "shank"), ("ankle", "shank", "foot")):
            clusters = f"{above}_{side}" in markers and f"{below}_{side}" in markers
            if f"{joint}_lateral_{side}" not in markers and not clusters:
                missing.append(f"{side} {joint} (at the joint, or three each on {above} and {below})")
    return missing


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
        # While the knee is hidden, the line to the hip is near enough for half an ankle.
        above = np.where(np.isfinite(knee), knee, hip)
        ankle = _centre_at_marker(markers, "ankle", side, above, medial, half_ankle, notes)
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
    trunk = {"hip_center": middle, "spine": middle + TRUNK / 3.0 * _stature(legs) * frame.up}
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


def _shows_trunk(centres: Mapping[str, Array]) -> bool:
    return "shoulder_center" in centres or {"shoulder_left", "shoulder_right"} <= centres.keys()


def _assumed_shoulders(frame: Pelvis, centres: Mapping[str, Array], notes: list[str]) -> Array:
    """Positions (T, 3) of shoulder_center above the hips of a body whose trunk has no markers."""
    ankles = 0.5 * (centres["ankle_left"] + centres["ankle_right"])
    tall = _stature(centres)
    tilt = standing_tilt(frame, centres["hip_center"], ankles, (THIGH + SHANK) * tall)
    notes.append(
        "no markers on the trunk: it is assumed in line with the legs in standing, with the pelvis tilted by "
        f"{np.degrees(tilt):.0f} degrees; hip angles relative to a neutral pelvis exclude this tilt"
    )
    return np.asarray(centres["hip_center"] + TRUNK * tall * upright_trunk(frame, tilt))


def _stature(legs: Mapping[str, Array]) -> float:
    """Stature in metres by the lengths of the legs' bones."""
    body = np.full((len(legs["hip_left"]), len(NODES), 3), np.nan)
    for node in REQUIRED:
        body[:, NODE_INDEX[node]] = legs[node]
    return stature(body)

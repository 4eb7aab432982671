"""Build a clip of the nodes from labelled points: optical markers on the skin, or named joints."""

from __future__ import annotations

from collections.abc import Mapping
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
from kinemimic.pipeline.readers.optical.body_landmarks import (
    Landmarks,
    leg_length,
    missing_of_legs,
    missing_of_pelvis,
    never_seen,
)
from kinemimic.pipeline.readers.optical.exchanged_labels import exchange_labels
from kinemimic.pipeline.readers.optical.joint_centres import Pelvis, pelvis
from kinemimic.pipeline.readers.optical.leg_centres import leg_centres
from kinemimic.pipeline.readers.optical.marker_names import SIDES, joint_centres
from kinemimic.pipeline.readers.optical.marker_set import SUFFIX, MarkerSet, marker_set

# Rab, Petuskey & Bagley 2002 (Gait & Posture 15, 113-119): the shoulder's centre is below the acromion by
# this share of the distance between the acromia.
_BELOW_ACROMION = 0.17
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
    clip is the anatomical one. A marker that was never seen does not count. One that carries another's label
    for a while is put back (exchanged_labels.py). One that is missing for a while is filled from others on
    its segment (rigid_segments.py), else the nodes computed from it are missing.
    Without markers on the trunk, shoulder_center is inferred (assumed_trunk.py).

    Raises CaptureError naming what is missing if hips, knees or ankles cannot be computed.
    """
    markers = Landmarks(labels, points)
    _require_legs(markers, labels, source)
    markers.points, wrong_labels = exchange_labels(markers.labels, markers.points)
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
    if unseen := never_seen(markers, labels):
        notes.append(f"never seen: {', '.join(unseen)}")
    inferred: set[str] = set()
    if not missing_of_pelvis(markers):
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
        reading={
            **reading,
            "defects": [*reading["defects"], *(defect.to_json() for defect in wrong_labels)],
            "notes": [*reading["notes"], *notes],
        },
        world_from_file=world_from_file,
        angles=angles,
    )


def _on_skin(markers: Landmarks, joints: Mapping[str, Array]) -> str:
    """Why points named like hips, knees and ankles are markers on the skin, "" if they are the joints.

    The hips' centres are nearer to each other than the ASIS (0.7 of their distance), markers over the
    trochanters are farther apart.
    """
    if missing_of_pelvis(markers) or missing_of_legs(markers):
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
    _require_legs(Landmarks(labels, points), labels, source)


def _require_legs(markers: Landmarks, labels: tuple[str, ...], source: Source) -> None:
    missing = [*missing_of_pelvis(markers), *missing_of_legs(markers)]
    if not missing or joint_centres(markers.labels).keys() >= set(REQUIRED):
        return
    unseen = ", ".join(never_seen(markers, labels))[:100]
    never = f" ({unseen} never seen)" if unseen else ""
    raise source.error(
        expected="markers from which hips, knees and ankles can be computed",
        found=f"none for {'; '.join(missing)}{never} among "
        f"{', '.join(label for label in labels if label)[:300] or 'points without labels'}",
        advice=f"say which marker is where in NAME{SUFFIX}, if they have other names",
    )


def _require_leg_length(markers: Landmarks, source: Source) -> None:
    if any(np.isnan(leg_length(markers, side)) for side in SIDES):
        raise source.error(
            expected='leg_length in the marker set, or lateral knee and ankle markers, for hips = "davis"',
            found="neither",
        )


def _centres(
    markers: Landmarks, given: Mapping[str, Array], chosen: MarkerSet, notes: list[str], inferred: set[str]
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
            centres |= leg_centres(markers, frame, side, chosen, notes)
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


def _below(markers: Landmarks) -> Array:
    """The midpoint (T, 3) of the knees, or of the shanks without knee markers."""
    positions = [
        markers[f"{landmark}_{side}"]
        for side in SIDES
        for landmark in (("knee_lateral",) if f"knee_lateral_{side}" in markers else ("shank",))
    ]
    return np.asarray(0.5 * (positions[0] + positions[1]))


def _trunk(markers: Landmarks, frame: Pelvis, legs: Mapping[str, Array]) -> dict[str, Array]:
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

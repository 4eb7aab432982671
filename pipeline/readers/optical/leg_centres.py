"""Hips, knees and ankles from the markers of the pelvis and the legs."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.readers.optical.body_landmarks import Landmarks, leg_length
from kinemimic.pipeline.readers.optical.joint_centres import (
    HALF_ANKLE,
    HALF_KNEE,
    Pelvis,
    centre_of_rotation,
    hip_centre,
    inward,
)
from kinemimic.pipeline.readers.optical.marker_set import MarkerSet

# Initial guess for an ankle without markers: this share of the way from the heel to the top of the midfoot,
# and this far (metres) up the shank.
_ANKLE_OVER_FOOT, _ANKLE_UP = 0.4, 0.03


def leg_centres(
    markers: Landmarks, frame: Pelvis, side: str, chosen: MarkerSet, notes: list[str]
) -> dict[str, Array]:
    """The hip, knee and ankle (T, 3) of a side; how they were found is added to `notes`."""
    marker = 0.5 * chosen.marker_diameter
    half_knee = HALF_KNEE if chosen.knee_width is None else 0.5 * chosen.knee_width + marker
    half_ankle = HALF_ANKLE if chosen.ankle_width is None else 0.5 * chosen.ankle_width + marker
    length = leg_length(markers, side) if chosen.leg_length is None else chosen.leg_length
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


def _centre_at_marker(
    markers: Landmarks, joint: str, side: str, above: Array, medial: Array, half: float, notes: list[str]
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

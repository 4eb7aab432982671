"""Labelled points as the landmarks of a body, and which of them are missing."""

from __future__ import annotations

from itertools import chain

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.readers.optical.marker_names import SIDES, joint_centres, landmarks
from kinemimic.pipeline.readers.optical.rigid_segments import fill_rigid


class Landmarks:
    """Positions (T, 3) of landmarks, NaN where missing; the mean for a landmark of several markers.

    labels: (M,), "" for a marker that was never seen; points: (T, M, 3), NaN where missing. A position of
    three equal numbers is missing too: files write 0, 9999 or -999 for what they do not have.
    """

    def __init__(self, labels: tuple[str, ...], points: Array) -> None:
        x, y, z = np.moveaxis(points, -1, 0)
        # Written out per axis: numpy takes five times as long to reduce an axis of three.
        missing = ~(np.isfinite(x) & np.isfinite(y) & np.isfinite(z)) | ((x == y) & (y == z))
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


def never_seen(markers: Landmarks, labels: tuple[str, ...]) -> list[str]:
    """The labels of known markers and joints without a position in any frame."""
    known = {*chain(*landmarks(labels).values()), *joint_centres(labels).values()}
    return [labels[k] for k in sorted(known) if not markers.labels[k]]


def missing_of_pelvis(markers: Landmarks) -> list[str]:
    """The markers without which the pelvis has no axes."""
    missing = [f"{side} ASIS" for side in SIDES if f"asis_{side}" not in markers]
    if "sacrum" not in markers and not {"psis_left", "psis_right"} <= markers.found.keys():
        missing.append("sacrum or both PSIS")
    return missing


def missing_of_legs(markers: Landmarks) -> list[str]:
    """The joints without markers, and the markers that would suffice."""
    missing = []
    for side in SIDES:
        for joint, above, below in (("knee", "thigh", "shank"), ("ankle", "shank", "foot")):
            clusters = f"{above}_{side}" in markers and f"{below}_{side}" in markers
            if f"{joint}_lateral_{side}" not in markers and not clusters:
                missing.append(f"{side} {joint} (at the joint, or three each on {above} and {below})")
    return missing


def leg_length(markers: Landmarks, side: str) -> float:
    """Median length of the leg from the ASIS over the knee's marker to the ankle's; NaN without these."""
    way = [f"{landmark}_{side}" for landmark in ("asis", "knee_lateral", "ankle_lateral")]
    if any(landmark not in markers for landmark in way):
        return float("nan")
    asis, knee, ankle = (markers[landmark] for landmark in way)
    return median(np.linalg.norm(asis - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1))

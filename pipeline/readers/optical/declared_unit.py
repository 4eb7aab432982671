"""The unit that a file of markers declares, by any of its spellings, checked against the size of the body.

Joint centres are computed with lengths in metres (half a knee, the radius of a marker). From markers in a
wrong unit they form no body, and no later check could tell why. So the markers themselves are checked.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import LEG_RANGE, UNITS, unit_correction
from kinemimic.pipeline.readers.optical.marker_names import SIDES, joint_centres, landmarks

# Length of the path from ASIS over the lateral knee to the ankle, over thigh plus shank.
_SKIN_PATH = 1.1
# Smaller deviations are left to quality/rules/length_units.py, which knows the joint centres.
_TOLERANCE = 1.5
# Number of frames, spread over the recording, that suffice for a median.
_SAMPLED_FRAMES = 500
_USUAL = ("mm", "m", "cm")
# Key of UNITS -> its words in headers, in the singular.
_WORDS: dict[str, tuple[str, ...]] = {
    "mm": ("mm", "millimeter", "millimetre"),
    "cm": ("cm", "centimeter", "centimetre"),
    "m": ("m", "meter", "metre"),
    "dm": ("dm", "decimeter", "decimetre"),
    "inch": ("in", "inch", "inche", '"'),
    "ft": ("ft", "foot", "feet", "'"),
}


def unit_named(word: str) -> str | None:
    """The unit (a key of UNITS) that a header names "mm", "Meters", "metre", "in" …; None if unknown."""
    singular = word.strip().lower().removesuffix(".").removesuffix("s")
    return next((unit for unit, words in _WORDS.items() if singular in words), None)


def likeliest_unit(labels: tuple[str, ...], points: Array) -> str:
    """The first of the usual units in which the legs of points (T, M, 3) are a person's; mm if none is."""
    return next((unit for unit in _USUAL if not in_metres(labels, points * UNITS[unit])[1]), _USUAL[0])


def in_metres(labels: tuple[str, ...], points: Array) -> tuple[Array, list[Defect]]:
    """The points (T, M, 3) in metres and the defect that they were not; unchanged if they were.

    labels: (M,) of the points; points: in what the file declares as metres, NaN or zeros where missing.
    """
    leg = _leg(labels, points[:: len(points) // _SAMPLED_FRAMES + 1])
    if np.isnan(leg) or LEG_RANGE[0] / _TOLERANCE <= leg <= LEG_RANGE[1] * _TOLERANCE:
        return points, []
    factor, found = unit_correction(leg, len(labels))
    if factor == 1.0:
        return points, []
    return points * factor, found


def _leg(labels: tuple[str, ...], points: Array) -> float:
    """Approximate median length of thigh plus shank; NaN if no leg has markers."""
    lengths: list[Array] = []
    for side in SIDES:
        chain, on_skin = _chain(labels, side)
        if chain:
            hip, knee, ankle = (_middle(points, markers) for markers in chain)
            with np.errstate(invalid="ignore", over="ignore"):  # a damaged file may hold any number
                length = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
            lengths.append(length / (_SKIN_PATH if on_skin else 1.0))
    all_lengths = np.concatenate(lengths) if lengths else np.empty(0)
    all_lengths = all_lengths[np.isfinite(all_lengths) & (all_lengths > 0)]
    return float(np.median(all_lengths)) if len(all_lengths) else np.nan


def _chain(labels: tuple[str, ...], side: str) -> tuple[list[tuple[int, ...]], bool]:
    """The points at hip, knee and ankle of a side ([] if unknown), and whether they are markers on
    the skin."""
    joints, marked = joint_centres(labels), landmarks(labels)
    nodes = [f"{joint}_{side}" for joint in ("hip", "knee", "ankle")]
    if joints.keys() >= set(nodes):
        return [(joints[node],) for node in nodes], False
    # The middle of the clusters on thigh and shank is near the knee; the foot's cluster begins with the heel.
    clusters = marked.get(f"thigh_{side}", ()) + marked.get(f"shank_{side}", ())
    chain = [
        marked.get(f"asis_{side}", ()),
        marked.get(f"knee_lateral_{side}", clusters),
        marked.get(f"ankle_lateral_{side}", marked.get(f"foot_{side}", ())[:1]),
    ]
    return (chain if all(chain) else []), True


def _middle(points: Array, markers: tuple[int, ...]) -> Array:
    """Mean (T, 3) of these points; NaN where one is missing."""
    positions = points[:, list(markers)]
    present = positions.any(axis=-1, keepdims=True) & np.isfinite(positions)
    with np.errstate(over="ignore"):
        return np.asarray(np.where(present, positions, np.nan).mean(axis=1))

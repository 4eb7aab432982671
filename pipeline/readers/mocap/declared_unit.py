"""The unit that a file of markers declares, held against the size of the body in it.

Joint centres are built with lengths in metres (half a knee, the radius of a marker): of markers in a wrong
unit they are no body at all, and no rule could tell what is wrong with it. So the markers are looked at.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import LEG_RANGE, unit_correction
from kinemimic.pipeline.readers.mocap.marker_names import SIDES, landmarks

# The way from the ASIS over the outside of the knee to the ankle, over thigh plus shank.
_OUTSIDE = 1.1
# What is off by less than this is left to quality/rules/length_units.py, which knows the legs themselves.
_NEAR = 1.5
# Frames, spread over the recording, that are enough for a median.
_ENOUGH = 500


def in_metres(labels: tuple[str, ...], points: Array) -> tuple[Array, list[Defect]]:
    """The points (T, M, 3) in metres, and the finding that they were not; else as they are.

    labels: (M,) of the points; points: in what the file declares for metres, NaN or zeros where missing.
    """
    leg = _leg(labels, points[:: len(points) // _ENOUGH + 1])
    if np.isnan(leg) or LEG_RANGE[0] / _NEAR <= leg <= LEG_RANGE[1] * _NEAR:
        return points, []
    factor, found = unit_correction(leg, len(labels))
    if factor == 1.0:
        return points, []
    return points * factor, found


def _leg(labels: tuple[str, ...], points: Array) -> float:
    """The median length of thigh plus shank, roughly; NaN where no leg is marked."""
    lengths: list[Array] = []
    for side in SIDES:
        chain, outside = _chain(labels, side)
        if chain:
            hip, knee, ankle = (_middle(points, markers) for markers in chain)
            with np.errstate(invalid="ignore", over="ignore"):  # a damaged file has any number
                way = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
            lengths.append(way / (_OUTSIDE if outside else 1.0))
    ways = np.concatenate(lengths) if lengths else np.empty(0)
    ways = ways[np.isfinite(ways) & (ways > 0)]
    return float(np.median(ways)) if len(ways) else np.nan


def _chain(labels: tuple[str, ...], side: str) -> tuple[list[tuple[int, ...]], bool]:
    """The points at hip, knee and ankle of a side, and whether they are markers on the skin; [] of none."""
    joints, marked = joints_of_nodes(labels), landmarks(labels)
    nodes = [f"{joint}_{side}" for joint in ("hip", "knee", "ankle")]
    if joints.keys() >= set(nodes):
        return [(joints[node],) for node in nodes], False
    # Between the clusters on thigh and shank is about the knee; that on the foot begins with the heel.
    clusters = marked.get(f"thigh_{side}", ()) + marked.get(f"shank_{side}", ())
    chain = [
        marked.get(f"asis_{side}", ()),
        marked.get(f"knee_lateral_{side}", clusters),
        marked.get(f"ankle_lateral_{side}", marked.get(f"foot_{side}", ())[:1]),
    ]
    return (chain if all(chain) else []), True


def _middle(points: Array, markers: tuple[int, ...]) -> Array:
    """(T, 3) between these of the points; NaN where one is missing."""
    places = points[:, list(markers)]
    there = places.any(axis=-1, keepdims=True) & np.isfinite(places)
    with np.errstate(over="ignore"):
        return np.asarray(np.where(there, places, np.nan).mean(axis=1))

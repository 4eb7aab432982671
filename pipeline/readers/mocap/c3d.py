"""C3D files: a Kinect's joints that a recorder exported, or a laboratory's markers.

The file names its points, their unit and rate. Axes are the laboratory's own: Y_SCREEN says which points up
where somebody filled it in. A point with a negative residual was not seen. Reading takes the library ezc3d,
the extra `c3d`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import MAX_COORDINATE, zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.treadmill import JOINTS, angles_of_recorder, true_rate
from kinemimic.pipeline.readers.mocap.c3d_layout import check_layout, marked
from kinemimic.pipeline.readers.mocap.c3d_points import read_points
from kinemimic.pipeline.readers.mocap.declared_unit import in_metres
from kinemimic.pipeline.readers.mocap.marker_names import landmarks
from kinemimic.pipeline.readers.mocap.markers import clip_of_markers

FORMAT = Format(
    name="C3D",
    sensor="optical, or a Kinect through btk",
    holds="positions of joints or markers, and angles",
    recognised_by="the byte 0x50 in second place",
    binary=True,
)
DECLARED: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
# The axis that points up -> the turn that makes it Z.
_UP: dict[str, Array] = {
    "Z": IDENTITY,
    "Y": from_axis_angle("X", np.pi / 2.0),
    "X": from_axis_angle("Y", -np.pi / 2.0),
}
# Largest distance between two points of an adult's body in a usual frame, and what a body may have.
_SPAN, _SPANS = 1.6, (0.6, 3.0)
_FASTEST = 10000.0


def recognises(source: Source) -> bool:
    """True if the header bears the format's mark."""
    return marked(source.content)


def read(source: Source) -> Clip:
    """The clip of the 20 nodes, or of those that the markers show.

    KinemimicError if ezc3d is not installed; CaptureError for a damaged file, one without units in which no
    body is as large as a person's, and markers from which no legs follow.
    """
    check_layout(source)
    file = read_points(source)
    labels, rate, points = file.labels, file.rate, file.places
    kinect = all(label in labels for label in JOINTS)
    wanted = tuple(JOINTS) if kinect else _of_the_body(labels)
    chosen = points[:, [labels.index(label) for label in wanted]]
    unit, rule = _unit(file.units.lower(), chosen, source)
    chosen = chosen * UNITS[unit]
    wrong: list[Defect] = []
    if source.unit is None:
        chosen, wrong = in_metres(wanted, chosen)
        _check_places(chosen, wanted, source)
    up = file.up.upper().removeprefix("+")
    facts: dict[str, Any] = {"points": len(labels), "declared_rate": rate, "up": up or "not said"}
    if kinect:
        rate, wrong_rate = true_rate(rate, len(points))
        own = {label: points[:, k, 0] for k, label in enumerate(labels)}
        return clip_of_points(
            node_skeleton(),
            np.arange(len(points)) / rate,
            chosen,
            None,
            format=FORMAT,
            reading=reading(
                units=unit, units_rule=rule, defects=[*wrong, *wrong_rate, *zero_frames(chosen)], **facts
            ),
            world_from_file=_UP.get(up, Y_UP_TO_Z_UP),
            angles=angles_of_recorder(own),
        )
    if not 0.0 < rate <= _FASTEST:
        raise source.error(expected="frames a second in POINT:RATE", found=f"{rate:g}")
    notes = [] if up in _UP else ["the file does not say which axis is up: read as Z"]
    return clip_of_markers(
        wanted,
        np.arange(len(points)) / rate,
        chosen,
        format=FORMAT,
        reading=reading(
            units=unit, units_rule=rule, defects=[*wrong, *zero_frames(chosen)], notes=notes, **facts
        ),
        world_from_file=_UP.get(up, IDENTITY),
        source=source,
    )


def _of_the_body(labels: tuple[str, ...]) -> tuple[str, ...]:
    """The labels of joints and known markers: files hold angles, forces and moments as points too."""
    known = {k for markers in landmarks(labels).values() for k in markers} | set(
        joints_of_nodes(labels).values()
    )
    return tuple(labels[k] for k in sorted(known)) or labels


def _check_places(places: Array, labels: tuple[str, ...], source: Source) -> None:
    """CaptureError for a place (T, N, 3), metres, that lies out of any laboratory."""
    far = np.argwhere(np.abs(places) > MAX_COORDINATE)
    if len(far):
        frame, point, axis = (int(k) for k in far[0])
        raise source.error(
            expected=f"metres, at most {MAX_COORDINATE:g}, in {labels[point]}",
            found=f"{places[frame, point, axis]:g}",
            where=f"frame {frame}",
        )


def _unit(told: str, points: Array, source: Source) -> tuple[str, str]:
    """The unit of length, and how it is known; points: (T, N, 3) in it."""
    if source.unit is not None:
        return source.unit, SET_BY_USER
    if told in DECLARED:
        return told, "the file's"
    spans = np.linalg.norm(_extent(points), axis=-1)
    spans = spans[np.isfinite(spans) & (spans > 0)]
    span = float(np.median(spans)) if len(spans) else 0.0
    if span > 0:
        unit = min(DECLARED, key=lambda name: abs(np.log(span * DECLARED[name] / _SPAN)))
        if _SPANS[0] <= span * DECLARED[unit] <= _SPANS[1]:
            return unit, "the size of the body, because the file does not say it"
    raise source.error(
        expected=f"POINT:UNITS of {', '.join(DECLARED)}, or a body of {_SPANS[0]} to {_SPANS[1]} m in one",
        found=f"{told[:20]!r} and a body of {span:.4g}",
        advice="--unit names the unit",
    )


def _extent(points: Array) -> Array:
    """(T, 3) sizes of the box around the points that are there; NaN of none."""
    high = np.where(np.isfinite(points), points, -np.inf).max(axis=1)
    low = np.where(np.isfinite(points), points, np.inf).min(axis=1)
    empty = high < low
    return np.where(empty, np.nan, np.where(empty, 0.0, high) - np.where(empty, 0.0, low))

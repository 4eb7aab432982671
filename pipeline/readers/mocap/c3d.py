"""C3D files: a Kinect's joints that a recorder exported, or a laboratory's markers.

The file names its points, their unit and rate. Axes are the laboratory's; Y_SCREEN says which points up, if
it is filled in. A point with a negative residual was not seen. Instead of points, a file may have segments
with matrices of 4 by 4, of which the origins are read. Needs the library ezc3d (the extra `c3d`).
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.treadmill import NODE_OF_LABEL, angles_of_recorder, true_rate
from kinemimic.pipeline.readers.mocap.c3d_layout import BLOCK, check_layout, frames_with_room, has_signature
from kinemimic.pipeline.readers.mocap.c3d_points import Points, read_points
from kinemimic.pipeline.readers.optical.declared_unit import in_metres, unit_named
from kinemimic.pipeline.readers.optical.marker_names import body_labels
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers, require_legs
from kinemimic.pipeline.readers.optical.people import main_person

FORMAT = Format(
    name="C3D",
    sensor="optical, or a Kinect exported by btk",
    holds="positions of joints or markers, and angles",
    recognised_by="0x50 as the second byte",
    binary=True,
    right_handed=True,
)
DECLARED: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
# Axis that points up -> rotation that turns it to Z.
_UP: dict[str, Array] = {
    "Z": IDENTITY,
    "Y": from_axis_angle("X", np.pi / 2.0),
    "X": from_axis_angle("Y", -np.pi / 2.0),
}
# In metres: usual distance between the outermost points of an adult's body, and its limits.
_ADULT_SPAN, _SPAN_LIMITS = 1.6, (0.6, 3.0)
_MAX_RATE = 10000.0
# Outputs of a model that are no places, among a file's points.
_OUTPUT = re.compile(r"(?:Angles?|Forces?|Moments?|Powers?|Torques?|GRF)\d?$")
# Of markers in a file without a rate, in Hz: the usual one of laboratories.
RATE = 100.0


def recognises(source: Source) -> bool:
    """True if the header has the format's signature."""
    return has_signature(source.content)


def read(source: Source) -> Clip:
    """The clip of the 20 nodes, or of those that the markers give.

    Raises KinemimicError if ezc3d is not installed; CaptureError for a damaged file, a file without units in
    which no unit gives a person's size, and markers from which legs cannot be computed.
    """
    check_layout(source)
    content = read_points(source)
    labels = marker_set(source).renamed(content.labels, source)
    if all(label in labels for label in NODE_OF_LABEL):
        return _of_kinect(content, labels, source)
    return _of_laboratory(content, labels, source)


def _of_kinect(content: Points, labels: tuple[str, ...], source: Source) -> Clip:
    """The joints of a Kinect with the recorder's own angles."""
    rate, assumed = true_rate(content.rate)
    body = _body(tuple(NODE_OF_LABEL), labels, content.positions, content.units, source)
    return clip_of_points(
        node_skeleton(),
        np.arange(len(body.points)) / rate,
        body.points,
        None,
        format=FORMAT,
        reading=reading(
            units=body.unit,
            units_rule=body.rule,
            defects=body.defects,
            points=len(labels),
            declared_rate=content.rate,
            up=_up(content) or "not stated",
            **assumed,
        ),
        world_from_file=_UP.get(_up(content), Y_UP_TO_Z_UP),
        angles=angles_of_recorder({label: content.positions[:, k, 0] for k, label in enumerate(labels)}),
    )


def _of_laboratory(content: Points, labels: tuple[str, ...], source: Source) -> Clip:
    """The nodes that one person's markers give."""
    places = [k for k, label in enumerate(labels) if _OUTPUT.search(label) is None]
    if not places:
        raise source.error(
            expected="markers or joint centres", found=f"outputs of a model alone ({', '.join(labels)[:80]})",
            advice="export the markers as well",
        )  # fmt: skip
    kept = tuple(labels[k] for k in places)
    labels, points, wrong = main_person(kept, content.positions[:, places])
    require_legs(labels, points, source)  # while unknown labels are still there to be named
    known = body_labels(labels)
    body = _body(known, labels, points, content.units, source)
    rate, no_rate = _rate(content.rate, len(points), source)
    up, notes = _up(content), []
    if up not in _UP:
        stated = f"the file states {up[:8]} as up, which is not supported" if up else "the file states no up"
        notes.append(f"{stated}: read as Z")
    return clip_of_markers(
        known,
        np.arange(len(points)) / rate,
        body.points,
        format=FORMAT,
        reading=reading(
            units=body.unit,
            units_rule=body.rule,
            defects=[*wrong, *body.defects, *no_rate],
            notes=notes,
            points=len(content.labels),
            declared_rate=content.rate,
            up=up or "not stated",
        ),
        world_from_file=_UP.get(up, IDENTITY),
        source=source,
    )


class _Body(NamedTuple):
    """points: (T, N, 3) metres; unit: the file's, and how it is known; defects: of frames and unit."""

    points: Array
    unit: str
    rule: str
    defects: list[Defect]


def _body(
    wanted: tuple[str, ...], labels: tuple[str, ...], points: Array, units: str, source: Source
) -> _Body:
    """The wanted ones of the points (T, M, 3) with labels (M,), in the stated units."""
    chosen = points[:, [labels.index(label) for label in wanted]]
    unit, rule = _unit(units, chosen, source)
    chosen = chosen * UNITS[unit]
    defects = unread_frames(source, len(points))
    if source.unit is None:
        chosen, wrong_unit = in_metres(wanted, chosen)
        defects += wrong_unit
        refuse_remote(chosen, wanted, source, unit="m" if wrong_unit else unit)
    return _Body(chosen, unit, rule, [*defects, *zero_frames(chosen)])


def _up(content: Points) -> str:
    return content.up.upper().removeprefix("+")


def _rate(stated: float, frames: int, source: Source) -> tuple[float, list[Defect]]:
    """The rate in Hz, and the defect that the file states none."""
    if not 0.0 <= stated <= _MAX_RATE:
        raise source.error(expected="a rate in Hz in POINT:RATE", found=f"{stated:g}")
    if stated > 0.0:
        return stated, []
    text = f"the file has no rate: {RATE:g} Hz, unless --rate says what it has"
    return RATE, [Defect("wrong_rate", frames, "frames", "flagged", text)]


def unread_frames(source: Source, read: int) -> list[Defect]:
    """A defect if the file has more frames than its header can count, and only these were read."""
    room = frames_with_room(source)
    if room is None or room <= read + BLOCK:  # the last frame is padded to a whole block
        return []
    text = (
        f"the header counts {read} frames, the most it can; the file has room for {room}: the rest is unread"
    )
    return [Defect("dropped_frames", room - read, "frames", "flagged", text)]


def _unit(declared: str, points: Array, source: Source) -> tuple[str, str]:
    """The unit of length, and how it is known; points: (T, N, 3) in that unit."""
    if source.unit is not None:
        return source.unit, SET_BY_USER
    if (named := unit_named(declared)) is not None:
        return named, "the file's"
    spans = np.linalg.norm(_extent(points), axis=-1)
    spans = spans[np.isfinite(spans) & (spans > 0)]
    span = float(np.median(spans)) if len(spans) else 0.0
    if span > 0:
        unit = min(DECLARED, key=lambda name: abs(np.log(span * DECLARED[name] / _ADULT_SPAN)))
        if _SPAN_LIMITS[0] <= span * DECLARED[unit] <= _SPAN_LIMITS[1]:
            return unit, "inferred from the size of the body"
    raise source.error(
        expected=f"POINT:UNITS of {', '.join(DECLARED)}, or a body of "
        f"{_SPAN_LIMITS[0]} to {_SPAN_LIMITS[1]} m in one of them",
        found=f"{declared[:20]!r} and a body of {span:.4g}",
        advice="set it with --unit",
    )


def _extent(points: Array) -> Array:
    """Sizes (T, 3) of the box around the points that are present; NaN without any."""
    high = np.where(np.isfinite(points), points, -np.inf).max(axis=1)
    low = np.where(np.isfinite(points), points, np.inf).min(axis=1)
    empty = high < low
    return np.where(empty, np.nan, np.where(empty, 0.0, high) - np.where(empty, 0.0, low))

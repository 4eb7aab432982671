"""Markers in a MAT-file: as Qualisys Track Manager exports them, as the MoCap Toolbox of the University of
Jyväskylä stores them, or in a variable or field for each marker.

QTM's structure has FrameRate and Trajectories.Labeled with Labels and Data (labels, 4, frames), the fourth
number an error; a recording without markers, as by Theia Markerless, has Skeletons with SegmentLabels and
PositionData (3, segments, frames). The toolbox's has freq, markerName and data (frames, 3 · markers). Both
are in millimetres. Visual3D exports a cell of (frames, 3) for each signal, the Biomechanical ToolKit a
structure of them. NaN where not seen; Z is up in the default axes of these programs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.array_files.mat5 import Value, field, heads, texts, variables
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.clock import is_rate
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.declared_unit import in_metres
from kinemimic.pipeline.readers.optical.marker_names import joint_centres
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person
from kinemimic.pipeline.readers.optical.people import has_legs

FORMAT = Format(
    name="markers in a MAT-file",
    sensor="optical",
    holds="positions of markers, or of a skeleton's segments",
    recognised_by="a structure of QTM or of the MoCap Toolbox, or a variable or field for each marker",
    binary=True,
    right_handed=True,
)
UNIT = "mm"
RATE, KINECT_RATE = 100.0, 30.0  # Hz, of markers and of joints, where nothing states it
_QTM = ({"FrameRate", "Trajectories"}, {"FrameRate", "Skeletons"})
_TOOLBOX = {"freq", "markerName", "data"}
_MAX_RATE = 10_000.0
_RATES = ({"freq"}, {"frequency"}, {"fs"}, {"f", "s"})  # words of a variable, beside those of `is_rate`


class _Points(NamedTuple):
    """labels: (M,); points: (T, M, 3) in `unit`, a key of UNITS, or None if that is not known; rate: Hz;
    notes: for the user."""

    labels: tuple[str, ...]
    points: Array
    unit: str | None
    rate: float
    notes: tuple[str, ...] = ()


def recognises(source: Source) -> bool:
    """True if a variable is such a structure, or markers have variables or fields of their own."""
    return _layout(source) is not None


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py), or of a skeleton's segments.

    Raises CaptureError for a damaged file, one without labelled markers, and markers from which legs cannot
    be computed.
    """
    labels, points, stated, rate, notes = _points(source)
    unit = source.unit or stated or _likeliest_unit(labels, points)
    defects = zero_frames(points)
    labels, points, wrong = metres_of_one_person(labels, points, unit, source)
    defects += wrong
    return clip_of_markers(
        labels,
        np.arange(len(points)) / rate,
        points,
        # Variables may be in the axes of anybody's own program.
        format=FORMAT if stated else replace(FORMAT, right_handed=False),
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's" if stated else "the size of the body",
            defects=defects,
            notes=["no axes in the file: read as Z up", *notes],
            markers=[label for label in labels if label],
        ),
        world_from_file=IDENTITY,
        source=source,
    )


def _layout(source: Source) -> tuple[str, str] | None:
    """How the file is laid out, and the variable that holds the markers; "" if all do."""
    known = heads(source)
    for name, head in known.items():
        fields = set(head.fields)
        if any(wanted <= fields for wanted in _QTM):
            return "qtm", name
        if fields >= _TOOLBOX:
            return "toolbox", name
    for name, head in known.items():
        if has_legs(head.fields):
            return "named", name
    numbers = tuple(name for name, head in known.items() if head.kind in ("number", "cell"))
    return ("named", "") if has_legs(numbers) else None


def _points(source: Source) -> _Points:
    """The points of any layout; a marker set beside the file may rename markers."""
    layout = _layout(source)
    assert layout is not None  # noqa: S101 (recognises() holds)
    kind, name = layout
    if kind == "named":
        return _of_names(source, name)
    value = variables(source, [name])[name]
    return _of_qtm(value, source) if kind == "qtm" else _of_toolbox(value, source)


def _of_qtm(value: Value, source: Source) -> _Points:
    """A skeleton's segments, else the labelled trajectories."""
    rate = _checked(_number(field(value, "FrameRate")), "FrameRate", source)
    if segments := _segments(field(value, "Skeletons"), rate):
        return segments
    labels = texts(field(value, "Trajectories", "Labeled", "Labels"))
    data = field(value, "Trajectories", "Labeled", "Data")
    if not labels:
        raise source.error(
            expected="labelled trajectories, or a skeleton with legs",
            found="none",
            advice="label them in QTM, or export the skeleton",
        )
    if not _is_array(data) or data.ndim != 3 or len(data) != len(labels) or data.shape[1] not in (3, 4):
        raise source.error(expected=f"Data of shape ({len(labels)} labels, 4, frames)", found=_shape(data))
    points = np.moveaxis(data[:, :3].astype(np.float64), -1, 0)
    return _Points(marker_set(source).renamed(labels, source), points, UNIT, rate)


def _segments(skeletons: Value, rate: float) -> _Points | None:
    """The segments of the first skeleton that has legs."""
    for skeleton in skeletons if isinstance(skeletons, list) else [skeletons]:
        names, data = texts(field(skeleton, "SegmentLabels")), field(skeleton, "PositionData")
        whole = _is_array(data) and data.ndim == 3 and data.shape[:2] == (3, len(names))
        if whole and set(REQUIRED) <= joints_by_name(names).keys():
            points = np.moveaxis(data.astype(np.float64), (2, 1, 0), (0, 1, 2))
            note = "a skeleton's segments are read as joints at their positions"
            return _Points(names, points, UNIT, rate, (note,))
    return None


def _of_toolbox(value: Value, source: Source) -> _Points:
    labels, data = texts(field(value, "markerName")), field(value, "data")
    if not labels or not _is_array(data) or data.ndim != 2 or data.shape[1] != 3 * len(labels):
        raise source.error(
            expected="names in markerName, and data of shape (frames, 3 for each of them)",
            found=f"{len(labels)} names and {_shape(data)}",
        )
    points = data.astype(np.float64).reshape(len(data), len(labels), 3)
    rate = _checked(_number(field(value, "freq")), "freq", source)
    return _Points(marker_set(source).renamed(labels, source), points, UNIT, rate)


def _of_names(source: Source, name: str) -> _Points:
    """The arrays (T, 3), or with an error (T, 4), of the variables or of a structure's fields."""
    values = variables(source, heads(source).keys())
    holder = values if not name else values[name]
    arrays = {
        label: found
        for label, value in (holder.items() if isinstance(holder, Mapping) else ())
        if _is_array(found := _alone(value)) and found.ndim == 2 and found.shape[1] in (3, 4)
    }
    lengths = Counter(len(found) for found in arrays.values())
    frames = lengths.most_common(1)[0][0] if lengths else 0
    labels = tuple(label for label, found in arrays.items() if len(found) == frames)
    if not has_legs(labels):
        raise source.error(
            expected="arrays (frames, 3) of the markers at pelvis, knees and ankles",
            found=f"{len(labels)} of {frames} frames",
        )
    points = np.stack([arrays[label][:, :3].astype(np.float64) for label in labels], axis=1)
    stated = _stated_rate(values)
    if stated is None:
        # Cameras of markers call none of them a joint; an array of joints is a Kinect's.
        rate = KINECT_RATE if joint_centres(labels).keys() >= set(REQUIRED) else RATE
        notes = (f"no rate in the file: {rate:g} Hz, unless --rate says what it has",)
    else:
        rate, notes = _checked(stated[1], stated[0], source), (f"rate of {stated[0]}",)
    return _Points(marker_set(source).renamed(labels, source), points, None, rate, notes)


def _stated_rate(values: Mapping[str, Value]) -> tuple[str, float] | None:
    """The name of a number that calls itself a rate, of a variable or of a structure's field, and the
    number."""
    inside = [value for value in values.values() if isinstance(value, Mapping)]
    for group in (values, *inside):
        for name, value in group.items():
            if is_rate(name) or set(words_of(name)) in _RATES:
                return name[:40], _number(_alone(value))
    return None


def _likeliest_unit(labels: tuple[str, ...], points: Array) -> str:
    """The first of the usual units in which the legs are a person's; mm if none is."""
    return next((unit for unit in (UNIT, "m", "cm") if not in_metres(labels, points * UNITS[unit])[1]), UNIT)


def _checked(rate: float, name: str, source: Source) -> float:
    if not 0.0 < rate <= _MAX_RATE:
        raise source.error(expected=f"a rate in Hz in {name}", found=f"{rate:g}"[:20])
    return rate


def _alone(value: Value) -> Value:
    """The only value of a cell array, or any other value."""
    return value[0] if isinstance(value, list) and len(value) == 1 else value


def _number(value: Value) -> float:
    """The first number of an array; 0 without one."""
    return float(value.flat[0]) if _is_array(value) and value.size else 0.0


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray)


def _shape(value: Any) -> str:
    return str(value.shape)[:60] if _is_array(value) else "none"

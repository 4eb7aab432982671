"""Markers or joints of a MAT-file that have a variable or a field each, or are named beside one matrix.

Visual3D exports a cell of (frames, 3) for each signal, the Biomechanical ToolKit (btk) a structure of them
and another one with their rate; people's own programs store either. Angles, forces and moments may stand
beside the markers, and have the names of joints.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import REQUIRED
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.array_files.mat5 import Head, Value, heads, variables
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import is_rate
from kinemimic.pipeline.readers.clocks.video_clock import Rate, stated_rate, times_of_frames
from kinemimic.pipeline.readers.laboratory.matlab_matrix import PLACES, is_place, named_matrix
from kinemimic.pipeline.readers.optical.marker_names import body_labels, joint_centres
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.people import has_legs

# Hz, of markers and of joints, where nothing states it: points that are all called joints are a Kinect's.
RATE, KINECT_RATE = 100.0, 30.0
_RATES = ({"freq"}, {"frequency"}, {"fs"}, {"f", "s"})  # words of a name, beside those of `is_rate`
# Words of devices whose rate is not that of the markers.
_DEVICES = frozenset(("analog", "analogs", "emg", "force", "forces", "fp", "grf", "imu", "platform", "plate"))


class Recorded(NamedTuple):
    """labels: (M,); points: (T, M, 3) in `unit`, a key of UNITS, or None if that is not known; times: (T,)
    seconds; notes: for the user; defects: of the times."""

    labels: tuple[str, ...]
    points: Array
    times: Array
    unit: str | None
    notes: tuple[str, ...] = ()
    defects: tuple[Defect, ...] = ()


def holder(source: Source) -> str | None:
    """The structure whose fields are markers with legs, "" if variables are; None if there are none."""
    known = heads(source)
    structures = [
        name for name, head in known.items() if head.fields and _named_like_markers(name, head.fields)
    ]
    if structures:
        return min(structures, key=lambda name: not PLACES & set(words_of(name)))
    names = tuple(name for name, head in known.items() if _may_be_places(head.kind, head.shape))
    return "" if _named_like_markers("", names) else None


def recorded(source: Source) -> Recorded:
    """The arrays (T, 3), or with an error (T, 4), of the markers; a marker set beside the file may rename
    them.

    Raises CaptureError for a damaged file, and for fields with the names of markers that are no such arrays.
    """
    name, known = holder(source), heads(source)
    own = [name] if name else [one for one, head in known.items() if _may_be_places(head.kind, head.shape)]
    values = variables(source, {*own, *(one for one, head in known.items() if _may_be_clock(one, head))})
    fields = values[name] if name else {one: values[one] for one in own}
    if name is None:
        fields = named_matrix(source)
    places = _places(fields, source)
    labels, frames = tuple(places), len(next(iter(places.values())))
    renamed = marker_set(source).renamed(labels, source)
    kept = body_labels(renamed)
    points = np.stack([places[labels[renamed.index(one)]][:, :3].astype(np.float64) for one in kept], axis=1)
    usual = KINECT_RATE if joint_centres(kept).keys() >= set(REQUIRED) else RATE
    rate, notes = _rate(values, fields, source)
    beside = _of_frames(values, fields, frames)
    times = times_of_frames(frames, beside, source, lambda row: f"frame {row}", rate=rate, usual=usual)
    if name:
        notes = (f"markers of {name[:40]}", *notes)
    notes = (*notes, times.note)
    return Recorded(kept, points[times.kept], times.seconds, None, notes, tuple(times.defects))


def _places(fields: Value, source: Source) -> dict[str, Array]:
    """Label -> array (T, 3 or 4) of as many frames as most have; CaptureError if they have no legs."""
    arrays = {
        label: value
        for label, one in (fields.items() if isinstance(fields, Mapping) else ())
        if is_array(value := _alone(one)) and value.ndim == 2 and value.shape[1] in (3, 4)
        if is_place(label)
    }
    lengths = Counter(len(value) for value in arrays.values())
    frames = lengths.most_common(1)[0][0] if lengths else 0
    places = {label: value for label, value in arrays.items() if len(value) == frames}
    if not has_legs(tuple(places)):
        cells = [fields, *(fields.values() if isinstance(fields, Mapping) else ())]
        several = any(isinstance(one, list) and len(one) > 1 for one in cells)
        raise source.error(
            expected="one recording: arrays (frames, 3) of the markers at pelvis, knees and ankles",
            found="several" if several else f"{len(places)} of {frames} frames",
        )
    return places


def is_array(value: Any) -> bool:
    """Whether a value is an array of numbers."""
    return isinstance(value, np.ndarray)


def first_number(value: Value) -> float | None:
    """The first number of an array; None without one."""
    return float(value.flat[0]) if is_array(value) and value.size else None


def _named_like_markers(name: str, labels: Sequence[str]) -> bool:
    return is_place(name) and has_legs(tuple(label for label in labels if is_place(label)))


def _may_be_places(kind: str, shape: tuple[int, ...]) -> bool:
    """Whether a variable is (T, 3), (T, 4), or a cell, which may hold that."""
    return kind == "cell" or (kind == "number" and len(shape) == 2 and shape[1] in (3, 4))


def _may_be_clock(name: str, head: Head) -> bool:
    """Whether a variable is a row or a column of numbers, a rate, or a structure with one."""
    if head.kind == "number":
        return len(head.shape) == 2 and min(head.shape) == 1
    return _says_rate(name) or any(map(_says_rate, head.fields))


def _says_rate(name: str) -> bool:
    return is_rate(name) or set(words_of(name)) in _RATES


def _alone(value: Value) -> Value:
    """The only value of a cell array, or any other value."""
    return value[0] if isinstance(value, list) and len(value) == 1 else value


def _of_frames(values: Mapping[str, Value], fields: Value, frames: int) -> dict[str, Array]:
    """The rows and columns of as many numbers as there are frames."""
    groups = [group for group in (values, fields) if isinstance(group, Mapping)]
    return {
        name: one.reshape(-1).astype(np.float64)
        for group in groups
        for name, value in group.items()
        if is_array(one := _alone(value)) and one.size == frames and one.ndim == 2 and min(one.shape) == 1
    }


def _rate(values: Mapping[str, Value], fields: Value, source: Source) -> tuple[Rate | None, tuple[str, ...]]:
    """The rate of the markers, and a note if others are stated as well: first that beside the markers, then a
    variable, then a structure that is not of another device's."""
    structures = {name: value for name, value in values.items() if isinstance(value, Mapping)}
    of_markers = sorted(
        (name for name in structures if not _DEVICES & set(words_of(name))),
        key=lambda name: not PLACES & set(words_of(name)),
    )
    stated: dict[float, str] = {}
    for group in (fields, values, *(structures[name] for name in of_markers)):
        for name, rate in _rates(group):
            stated.setdefault(rate, name)
    if not stated:
        return None, ()
    (rate, name), *others = stated.items()
    note = ", ".join(f"{other:g} Hz ({called[:20]})" for other, called in others[:3])
    return stated_rate(name, rate, source), (f"other rates in the file: {note}",) if others else ()


def _rates(group: Value) -> Iterator[tuple[str, float]]:
    """The name and value of single numbers above 0 that call themselves a rate."""
    for name, value in group.items() if isinstance(group, Mapping) else ():
        one = _alone(value)
        if _says_rate(name) and is_array(one) and one.size == 1 and one.flat[0] > 0:
            yield name, float(one.flat[0])

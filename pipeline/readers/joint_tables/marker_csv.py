"""Optical markers as a table, with labels and axes in the header and a row per frame, as many programs
write them: "LASI (x)", "LASI_X", "Jim:LASI.x", "X_LASI", or the labels in a line above the axes.

The cells of a marker that was not seen are empty, zero or NaN. Such tables say little more. Times are those
of a column, else those of frame numbers, or of rows, at 100 Hz, the rate of most laboratories. The unit is
the one that makes a leg human. Up is Z, or Y if the pelvis is above the ankles along it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import is_rate, says_time
from kinemimic.pipeline.readers.clocks.video_clock import is_frame_number, times_of_frames
from kinemimic.pipeline.readers.custom_table.description import Text
from kinemimic.pipeline.readers.custom_table.suggest_names import joints_of_header
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet, sheet_of
from kinemimic.pipeline.readers.custom_table.table import Cells
from kinemimic.pipeline.readers.joint_tables.implied_axes import with_axes
from kinemimic.pipeline.readers.joint_tables.stacked_header import with_one_header
from kinemimic.pipeline.readers.optical.declared_unit import likeliest_unit
from kinemimic.pipeline.readers.optical.marker_names import SIDES, landmarks
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

RATE = 100.0
FORMAT = Format(
    name="Marker CSV",
    sensor="optical",
    holds="positions of markers",
    recognised_by="a header with the ASIS and an axis in each name, or of nothing but NAME (x), (y), (z)",
    width_in_header=True,
)
_BRACKETS = re.compile(r"(.+?) \([xyz]\)")
_MIN_MARKERS = 3


@dataclass(frozen=True)
class _Table:
    """source: with one header; labels: (M,) of the markers, as in the file; columns: (3 M,) of their axes."""

    source: Source
    sheet: Sheet
    labels: tuple[str, ...]
    columns: tuple[int, ...]


def recognises(source: Source) -> bool:
    """True if the header names markers of the pelvis, or those of the marker set beside the file, or if all
    its names, or all but a few damaged ones, are a name and an axis in brackets."""
    table = _table(source)
    if table is None or len(table.labels) < _MIN_MARKERS:
        return False
    names = table.sheet.names
    if sum(_BRACKETS.fullmatch(name) is not None for name in names) > 0.8 * len(names):
        return True
    try:
        labels = marker_set(source).renamed(table.labels, source)
    except CaptureError:
        return False
    return has_pelvis(labels)


def has_pelvis(labels: Sequence[str]) -> bool:
    """Whether the labels are of markers: those of the ASIS are among them."""
    return all(f"asis_{side}" in landmarks(labels) for side in SIDES)


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py).

    Raises CaptureError for damaged rows, and markers from which legs cannot be computed.
    """
    table = _table(source)
    assert table is not None  # noqa: S101 (recognises() holds)
    cells = Cells(table.source, _text(table.sheet), "the draft of `kinemimic inspect --suggest`")
    labels = marker_set(source).renamed(table.labels, source)
    clocks = _clocks(table)
    values, _ = cells.read([*table.columns, *clocks.values()], [])
    beside = {name: values[:, len(table.columns) + k] for k, name in enumerate(clocks)}

    def where(row: int) -> str:
        return f"line {cells.line(row)}"

    times = times_of_frames(len(values), beside, source, where, usual=RATE)
    points = values[times.kept, : len(table.columns)].reshape(-1, len(labels), 3)
    unit = source.unit or likeliest_unit(labels, points)
    defects = [*times.defects, *zero_frames(points)]
    rows = np.flatnonzero(times.kept)
    labels, points, wrong = metres_of_one_person(
        labels, points, unit, source, lambda frame: where(int(rows[frame]))
    )
    y_up = _is_y_up(labels, points)
    axes = "Y points up, from the ankles to the pelvis" if y_up else "no axes in the file: read as Z up"
    return clip_of_markers(
        labels,
        times.seconds,
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the size of the body",
            defects=[*defects, *wrong],
            notes=[times.note, axes],
            columns=table.sheet.width,
            markers=[label for label in labels if label],
        ),
        world_from_file=Y_UP_TO_Z_UP if y_up else IDENTITY,
        source=source,
    )


def _table(source: Source) -> _Table | None:
    """The table of points with names; None if there is none."""
    source = with_axes(with_one_header(source))
    try:
        sheet = sheet_of(source)
    except CaptureError:
        return None
    points = {name: one.position for name, one in joints_of_header(sheet.names).items() if one.position}
    columns = tuple(column for position in points.values() for column in position)
    return _Table(source, sheet, tuple(points), columns) if points else None


def _text(sheet: Sheet) -> Text:
    return Text(
        separator=sheet.separator,
        decimal=sheet.decimal,
        header=sheet.header,
        first_row=sheet.first,
        comment=sheet.comment,
        missing=tuple(mark for mark in sheet.marks if not mark.startswith('"')),  # -9999, but no words
    )


def _clocks(table: _Table) -> Mapping[str, int]:
    """Name -> column of times, frame numbers and rates."""
    sheet = table.sheet
    return {
        name: column
        for column, name in enumerate(sheet.names)
        if column not in table.columns
        and column not in sheet.words
        and (says_time(name) or is_frame_number(name) or is_rate(name))
    }


def _is_y_up(labels: tuple[str, ...], points: Array) -> bool:
    """Whether the ASIS are above the ankles along Y more than along any other axis."""
    found = landmarks(labels)
    ends = [
        [k for side in SIDES for k in found.get(f"{one}_{side}", ())] for one in ("asis", "ankle_lateral")
    ]
    if not all(ends):
        return False
    places = [points[:, end].reshape(-1, 3) for end in ends]
    seen = [place[np.isfinite(place).all(axis=1) & place.any(axis=1)] for place in places]
    if not all(map(len, seen)):
        return False
    asis, ankles = (np.median(place, axis=0) for place in seen)
    return bool(np.argmax(np.abs(asis - ankles)) == 1 and asis[1] > ankles[1])

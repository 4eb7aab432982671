"""Optical markers as a table with columns "LASI (x)", "LASI (y)", "LASI (z)" …, a row per frame.

Fields are separated by semicolons or commas; the cells of a marker that was not seen are empty, zero or NaN.
PyMoCapViewer shows such tables. They have no times, no unit and no axes: 100 Hz, millimetres and Z up are
those of the Vicon that most come from; the unit is checked against the size of the body.
"""

from __future__ import annotations

import re

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns, semicolon_or_comma
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.one_person import metres_of_one_person

RATE = 100.0
UNIT = "mm"
FORMAT = Format(
    name="Marker CSV",
    sensor="optical",
    holds="positions of markers",
    recognised_by="a header of columns NAME (x), NAME (y), NAME (z), and no others",
    width_in_header=True,
)
_COLUMN = re.compile(r'"?(.+?) \(([xyz])\)"?')
_MIN_MARKERS = 3


def recognises(source: Source) -> bool:
    """True if all names in the first line, or all but a few damaged ones, are a marker's and an axis."""
    names = source.head[0].split(semicolon_or_comma(source))
    found = sum(_COLUMN.fullmatch(name.strip()) is not None for name in names)
    return found >= 3 * _MIN_MARKERS and found > 0.8 * len(names)


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers give (see markers.py).

    Raises CaptureError for a damaged header or table, and markers from which legs cannot be computed.
    """
    line = source.blank_lines + 1
    labels, columns = _columns(source, line)
    labels = marker_set(source).renamed(labels, source)
    separator = semicolon_or_comma(source)
    width = len(source.head[0].split(separator))
    table = parse_sparse_table(source, start=line, width=width, separator=separator, keep_empty_rows=True)
    unit = source.unit or UNIT
    points = table.values[:, columns].reshape(len(table.values), len(labels), 3)
    defects = zero_frames(points)
    labels, points, wrong = metres_of_one_person(labels, points, unit, source, table.where)
    defects += wrong
    return clip_of_markers(
        labels,
        np.arange(len(points)) / RATE,
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's",
            defects=defects,
            notes=[f"no time in the file: {RATE:g} Hz; no axes: read as Z up"],
            columns=table.values.shape[1],
            markers=list(labels),
        ),
        world_from_file=IDENTITY,
        source=source,
    )


def _columns(source: Source, line: int) -> tuple[tuple[str, ...], list[int]]:
    """The markers' names and the columns of their x, y, z in turn."""
    names = [name.strip().strip('"') for name in source.head[0].split(semicolon_or_comma(source))]
    index = index_of_columns(names, source, line)
    labels: list[str] = []
    for name in names:
        parts = _COLUMN.fullmatch(name)
        if parts is None:
            raise source.error(
                expected="columns NAME (x), NAME (y), NAME (z)", found=f"{name[:40]!r}", line=line
            )
        if parts[1] not in labels:
            labels.append(parts[1])
    wanted = [f"{label} ({axis})" for label in labels for axis in "xyz"]
    lacking = next((name for name in wanted if name not in index), None)
    if lacking is not None:
        raise source.error(
            expected="x, y and z of every marker", found=f"no column {lacking[:44]}", line=line
        )
    return tuple(labels), [index[name] for name in wanted]

"""MediaPipe's 33 pose landmarks as a table. There is no official layout; programs write two.

Either one row per frame, with a column for each number of each landmark: "landmark_0_x", "L0_x", "x0" or
"left_knee_x", with visibility and presence. Or the landmark's number in the row:
"Frame,Time (ms),Landmark,X,Y,Z,Visibility", with one row per landmark, or with all landmarks of a frame one
after the other under the header of the first. A frame without a person has empty cells. Only landmarks in
metres are a capture (blaze_pose.py).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.clock import clock_column
from kinemimic.pipeline.readers.base.column_names import index_of_columns
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import Table, parse_sparse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.blaze_pose import (
    LANDMARKS,
    LEGS,
    NUMBER,
    clip_of_landmarks,
    path_of_landmarks,
)
from kinemimic.pipeline.readers.landmarks.video_clock import RATE, times_of_clock, times_of_rate

FORMAT = Format(
    name="MediaPipe landmarks CSV",
    sensor="a video, through MediaPipe",
    holds="positions of 33 landmarks in metres, their visibility",
    recognised_by="a header with x, y, z of numbered or named landmarks, or a column Landmark",
    width_in_header=True,
)
_FIELDS: dict[str, str] = {
    "x": "x", "y": "y", "z": "z", "visibility": "visibility", "vis": "visibility", "v": "visibility",
    "presence": "presence",
}  # fmt: skip
_COLUMN = re.compile(
    r"(?:(?P<name>[a-z_]*[a-z])_|(?:[a-z]+_?)?(?P<number>\d{1,2})_)(?P<field>x|y|z|visibility|vis|v|presence)"
    r"|(?P<first>x|y|z|v|visibility)_?(?P<last>\d{1,2})"
)
_MARK = "landmark"
_SEPARATORS = (",", ";", "\t")
_ROWS = 1000  # that show the width of a table


def recognises(source: Source) -> bool:
    """True if the first line names x, y and z of most landmarks of the legs, or has a column Landmark."""
    names = _names(source)
    if _is_long(names):
        return True
    found = set(_landmarks(names).values())
    return sum((NUMBER[leg], field) in found for leg in LEGS for field in "xyz") > 1.5 * len(LEGS)


def read(source: Source) -> Clip:
    """The clip of the nodes that the landmarks give; without times, at 30 Hz.

    Raises CaptureError for image landmarks, missing legs, and a damaged header or table.
    """
    names, line = _names(source), source.blank_lines + 1
    content = (_long if _is_long(names) else _wide)(names, line, source)
    points = content.values[..., :3]
    for leg in LEGS:
        if not np.isfinite(points[:, NUMBER[leg]]).all(axis=-1).any():
            raise source.error(expected="hips, knees and ankles", found=f"no {leg.replace('_', ' ')}")
    if content.clock is None:
        times = times_of_rate(len(points), RATE, f"no time in the file: {RATE:g} Hz")
    else:
        times = times_of_clock(content.clock, content.name, source, lambda row: f"line {content.line(row)}")
    path = path_of_landmarks(points, source)
    refuse_remote(points, LANDMARKS, source, lambda row: f"line {content.line(row)}")
    return clip_of_landmarks(
        points[times.kept],
        content.values[times.kept, :, 3:].min(axis=-1),
        times.seconds,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=times.defects,
            notes=[times.note, path],
            columns=content.columns,
        ),
    )


def _separator(source: Source) -> str:
    return max(_SEPARATORS, key=source.head[0].count)


def _names(source: Source) -> list[str]:
    """The names in the first line, in lower case."""
    return [name.strip().strip('"').lower() for name in source.head[0].split(_separator(source))]


def _is_long(names: list[str]) -> bool:
    return {_MARK, "x", "y", "z"} <= set(names) and len(names) < 20


def _landmarks(names: list[str]) -> dict[int, tuple[int, str]]:
    """Column -> the landmark's number and the field: x, y, z, visibility or presence.

    Numbers that begin at 1 and end at 33, as in "x1" … "v33", are one too high.
    """
    found: dict[int, tuple[int, str]] = {}
    numbered: dict[int, tuple[int, str]] = {}
    for column, name in enumerate(names):
        parts = _COLUMN.fullmatch(name)
        if parts is None:
            continue
        named, field = parts["name"], _FIELDS[parts["field"] or parts["first"]]
        if named is None:
            numbered[column] = int(parts["number"] or parts["last"]), field
        elif named in NUMBER:
            found[column] = NUMBER[named], field
    numbers = {number for number, _ in numbered.values()}
    first = 1 if len(LANDMARKS) in numbers and 0 not in numbers else 0
    found |= {
        column: (number - first, field)
        for column, (number, field) in numbered.items()
        if number - first < len(LANDMARKS)
    }
    return found


@dataclass(frozen=True)
class _Content:
    """columns: of the table; clock: (T,), if it has one, and name: of its column; values: (T, 33, 5), x, y,
    z, visibility, presence; line: of a frame."""

    columns: int
    clock: Array | None
    name: str
    values: Array
    line: Callable[[int], int]


def _wide(names: list[str], line: int, source: Source) -> _Content:
    """The content of a table with one row per frame."""
    index_of_columns(names, source, line)
    clock = clock_column(names)
    table = parse_sparse_table(
        source,
        start=line,
        width=len(names),
        separator=_separator(source),
        keep_empty_rows=clock is None,
    )
    values = np.full((len(table.values), len(LANDMARKS), 5), np.nan)
    values[..., 3:] = 1.0
    fields = ("x", "y", "z", "visibility", "presence")
    for column, (number, field) in _landmarks(names).items():
        values[:, number, fields.index(field)] = table.values[:, column]
    return _Content(
        len(names), None if clock is None else table.values[:, clock], names[clock or 0], values, table.line
    )


def _long(names: list[str], line: int, source: Source) -> _Content:
    """The content of a table with the landmark's number in the row."""
    index_of_columns(names, source, line)
    mark = names.index(_MARK)
    # What stands before the number is the frame's, what stands behind it the landmark's.
    separator, size = _separator(source), len(names) - mark
    # The first frame may be one without a person, of which the last cells are empty.
    first_rows = source.lines[line : line + _ROWS]
    width = max([len(names), *(len(row.rstrip(f" {separator}").split(separator)) for row in first_rows)])
    if (width - mark) % size:
        raise source.error(
            expected=f"{mark} numbers of the frame and {size} of each landmark",
            found=f"{width}",
            line=line + 1,
        )
    table = parse_sparse_table(source, start=line, width=width, separator=separator)
    rows = table.values[:, mark:].reshape(len(table.values), -1, size)
    numbers = rows[..., 0]
    nobody: Mask = np.asarray(np.isnan(numbers).all(axis=1))
    wrong = ~np.isin(numbers, np.arange(len(LANDMARKS))) & ~nobody[:, None]
    if wrong.any():
        row, place = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"a landmark's number, 0 to {len(LANDMARKS) - 1}",
            found=f"{numbers[row, place]:g}",
            line=table.line(row),
        )
    frame = _frames(table, mark, numbers)
    values = np.full((frame[-1] + 1, len(LANDMARKS), 5), np.nan)
    values[..., 3:] = 1.0
    there = np.flatnonzero(~nobody)
    landmarks = numbers[there].astype(np.intp)
    for field, name in enumerate(("x", "y", "z", "visibility", "presence")):
        if name in names:
            values[frame[there, None], landmarks, field] = rows[there, :, names.index(name) - mark]
    clock = clock_column(names[:mark])
    firsts = np.flatnonzero(np.diff(frame, prepend=-1))
    return _Content(
        width,
        None if clock is None else table.values[firsts, clock],
        names[clock or 0],
        values,
        lambda row: table.line(int(firsts[row])),
    )


def _frames(table: Table, mark: int, numbers: Array) -> NDArray[np.intp]:
    """The frame (R,) of each row: a new one begins where the numbers before the landmark's change."""
    rows = table.values[:, :mark]
    if numbers.shape[1] > 1:
        return np.arange(len(rows))
    if not mark:
        # Nothing but landmarks: their numbers begin anew in each frame.
        return np.cumsum(np.diff(numbers[:, 0], prepend=np.inf) <= 0) - 1
    same = (rows[1:] == rows[:-1]) | (np.isnan(rows[1:]) & np.isnan(rows[:-1]))
    return np.concatenate([[0], np.cumsum(~same.all(axis=1))])

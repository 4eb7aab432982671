"""The table that both `.skl` recorders write: a header of column names, then one line per frame.

Four columns per joint, `Name_X Name_Y Name_Z Name_tracked`, among others (timestamp, framenum, gyro, floor).
tracked: 0 not tracked, 1 inferred, 2 tracked. The recorders separate columns by tabs. What people make of
such files is read too: commas or semicolons between columns, decimal commas, quotes, comments (#) above the
header, `Name.x`, times in another unit or as dates, no times.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.column_names import index_of_columns, require_columns
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.numbers import parse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import clock_column
from kinemimic.pipeline.readers.clocks.dates import DATES, seconds_of_dates
from kinemimic.pipeline.readers.kinect.kinect_values import STEPS, check_states

FIELDS: tuple[str, ...] = ("X", "Y", "Z", "tracked")
# Of either sensor, in Hz.
RATE = 30.0
# Unit of a clock -> ticks per second; the SDK's ticks are 100 ns.
CLOCKS: dict[str, float] = {"s": 1.0, "ms": 1e3, "µs": 1e6, "100 ns": 1e7, "ns": 1e9}
_COLUMN = re.compile(r"([a-z]+)_(x|y|z|tracked)$")
_COMMENT, _NUMBER = "#", "framenum"
# Joints that a Kinect v1 lacks. Three of them are more than a misspelt name.
_ONLY_V2 = {"spinebase", "spinemid", "neck", "spineshoulder", "handtipleft", "handtipright", "thumbleft"}
_MIN_V2_NAMES = 3


@dataclass(frozen=True)
class Header:
    """columns: lower-case name -> column; joints: as written, in the order of their columns; clock: the
    column of times, if there is one; line: its number; separator: of the columns, None for white space."""

    columns: dict[str, int]
    joints: tuple[str, ...]
    clock: int | None
    line: int
    separator: str | None


def joint_columns(source: Source) -> list[str]:
    """The lower-case joint names for which the header has columns, one entry per column.

    Empty if it has no states: such a table may come from anywhere, in any unit and axes.
    """
    header = next((line for line in source.head if not line.startswith(_COMMENT)), "")
    found = [match for name in _names(header) if (match := _COLUMN.match(name.lower()))]
    return [match[1] for match in found] if any(match[2] == "tracked" for match in found) else []


def is_kinect_v2(joints: Sequence[str]) -> bool:
    """True if these lower-case joint names are a Kinect v2's."""
    return len(_ONLY_V2.intersection(joints)) >= _MIN_V2_NAMES


def header_of(source: Source) -> Header:
    """The header: the first line that is neither blank nor a comment. CaptureError if it has a name twice."""
    after_blank = range(source.blank_lines, len(source.lines))
    at = next(k for k in after_blank if source.lines[k].strip() and source.lines[k][0] != _COMMENT)
    names = _names(source.lines[at])
    columns = index_of_columns([name.lower() for name in names], source, at + 1)
    joints = [name.rpartition("_")[0] for name in names if _COLUMN.match(name.lower())]
    return Header(
        columns, tuple(dict.fromkeys(joints)), clock_column(names), at + 1, _separator(source.lines[at])
    )


def _separator(header: str) -> str | None:
    return next((mark for mark in ";," if mark in header), None)


def _names(header: str) -> list[str]:
    """The names of the columns, spelt with an underscore before the field."""
    separator = _separator(header)
    names = header.strip().removesuffix(separator or "").split(separator)
    return [name.strip().strip('"').replace(".", "_") for name in names]


def unread_columns(names: Sequence[str], sensor: str) -> list[str]:
    """A note about what has columns like a joint and is none of the sensor's, such as a ball."""
    listed = ", ".join(names[:6])[:120] + (" …" if len(names) > 6 else "")
    return [f"no joints of a {sensor}, not read: {listed}"] if names else []


@dataclass(frozen=True)
class Frames:
    """times: (T,) seconds, increasing; points: (T, J, 3) as in the file; states: (T, J); defects: lines that
    were dropped; notes, facts: for the reading, how the times are known."""

    times: Array
    points: Array
    states: NDArray[np.uint8]
    defects: list[Defect]
    notes: list[str]
    facts: dict[str, Any]


def frames_of(
    source: Source, header: Header, joints: Sequence[str], *, sensor: str, usual_clocks: Sequence[str]
) -> Frames:
    """The frames of the given joints (J,), in that order; every column is found by its name.

    sensor: its name; usual_clocks: units (keys of CLOCKS) in which its recorders write times; another one
    has a note. Without times, the frames are the sensor's 30 a second, which the gait must confirm
    (`quality/rules/assumed_rate.py`). Raises CaptureError for a missing column and for values that the column
    cannot have.
    """
    columns = require_columns(
        header.columns,
        [f"{joint}_{field}" for joint in joints for field in FIELDS],
        source,
        header.line,
        expected=f"{', '.join(FIELDS)} of {len(joints)} joints",
        key=str.lower,
    )
    table = parse_table(
        _plain(source, header), start=header.line, width=len(header.columns), separator=header.separator
    )
    start = columns[0]
    contiguous = columns == list(range(start, start + len(columns)))
    # A slice is a view; a list of columns copies every number.
    chosen = table.values[:, start : start + len(columns)] if contiguous else table.values[:, columns]
    values = chosen.reshape(len(chosen), len(joints), len(FIELDS))
    points = values[..., :3]
    check_states(values[..., 3], joints, lambda frame: f"line {table.line(frame)}", source)
    refuse_remote(points, joints, source, table.where, any_unit=True)
    states = values[..., 3].astype(np.uint8)
    if header.clock is None:
        facts = {"assumed_rate": {"rate": RATE, "declared": None, "sensor": sensor}}
        number = header.columns.get(_NUMBER)
        if number is not None and np.median(np.diff(table.values[:, number], prepend=0.0)[1:]) == 1.0:
            numbers = table.values[:, number]
            later, defects = increasing_times(numbers)
            times = (numbers[later] - numbers[later][0]) / RATE
            notes = [f"no time in the file: times are frame numbers at {RATE:g} Hz"]
            return Frames(times, points[later], states[later], defects, notes, facts)
        notes = [f"no time in the file: {RATE:g} Hz"]
        return Frames(np.arange(len(points)) / RATE, points, states, [], notes, facts)
    clock = table.values[:, header.clock]
    # .NET's ticks since the year 1 are 6.4e17, which a float holds to 13 µs.
    invalid = ~(np.abs(clock) < 2.0**63)  # NaN too
    if invalid.any():
        row = int(np.argmax(invalid))
        raise source.error(expected="a timestamp", found=f"{clock[row]:g}", line=table.line(row))
    later, defects = increasing_times(clock)
    if defects:
        clock, points, states = clock[later], points[later], states[later]
    unit = _unit(clock, usual_clocks[0], source)
    notes = [] if unit in usual_clocks else [f"times in {unit}, by their steps"]
    if _has_dates(source.lines[header.line :], header):
        notes = ["times are dates or times of day"]
    return Frames(clock / CLOCKS[unit], points, states, defects, notes, {"clock": unit})


def _unit(clock: Array, usual: str, source: Source) -> str:
    """The unit in which the median step of an increasing clock (T,) is nearest to the sensor's; of a single
    frame, the usual one.

    Microseconds and ticks of 100 ns are only ten times apart: steps of 10 to 100 ms tell them from each
    other.
    """
    if len(clock) < 2:
        return usual
    step = float(np.median(np.diff(clock)))
    unit = min(CLOCKS, key=lambda unit: abs(np.log(RATE * step / CLOCKS[unit])))
    if not STEPS[0] <= step / CLOCKS[unit] <= STEPS[1]:
        raise source.error(
            expected=f"timestamps with steps of {1e3 * STEPS[0]:g} to {1e3 * STEPS[1]:g} ms, in one of "
            f"{', '.join(CLOCKS)}",
            found=f"a median step of {step:g}",
        )
    return unit


def _plain(source: Source, header: Header) -> Source:
    """The table, line by line, without quotes and decimal commas, dates as seconds, and zeros for words in
    columns that are not read."""
    rows = source.lines[header.line :]
    try:
        words = _columns_of_words(rows, header)
        if words:
            rows = list(_without(words, rows, header))
    except csv.Error as error:
        raise source.error(
            expected="rows of numbers", found=str(error), line=_bad_row(rows, header)
        ) from None
    dated = _has_dates(rows, header)
    decimal_commas = header.separator != "," and b"," in source.content
    if not (words or dated or decimal_commas or b'"' in source.content):
        return source
    body = "\n".join(rows).replace('"', "")
    if decimal_commas:
        body = body.replace(",", ".")
    if dated:
        body = "\n".join(_with_seconds(body.split("\n"), header, source))
    text = "\n".join([*source.lines[: header.line], body])
    return source.with_text(text)


def _columns_of_words(rows: Sequence[str], header: Header) -> list[int]:
    """Columns that are not read (neither a joint's nor the clock) and have no number in the first row."""
    first = next((row for row in rows if row.strip()), "")
    read = {column for name, column in header.columns.items() if _COLUMN.match(name)} | {header.clock}
    cells = _cells(first, header)
    return [k for k, cell in enumerate(cells) if k not in read and to_number(cell.replace(",", ".")) is None]


def _without(words: Sequence[int], rows: Sequence[str], header: Header) -> Iterator[str]:
    for row in rows:
        cells = _cells(row, header)
        yield (header.separator or "\t").join(
            "0" if k in words and k < len(header.columns) else cell for k, cell in enumerate(cells)
        )


def _cells(row: str, header: Header) -> list[str]:
    """The cells of a row; a separator within quotes separates nothing."""
    if header.separator is None and "\t" not in row:
        return row.split()
    return next(csv.reader([row], delimiter=header.separator or "\t"), [])


def _bad_row(rows: Sequence[str], header: Header) -> int:
    """Number of the line at which splitting into cells fails."""
    for line, row in enumerate(rows, header.line + 1):
        try:
            _cells(row, header)
        except csv.Error:
            return line
    return header.line + 1


def _has_dates(rows: Sequence[str], header: Header) -> bool:
    """Whether the first row has a date and time of day in the clock's column."""
    first = _cells(next((row for row in rows if row.strip()), ""), header)
    return header.clock is not None and header.clock < len(first) and ":" in first[header.clock]


def _with_seconds(rows: Sequence[str], header: Header, source: Source) -> Iterator[str]:
    """The rows with seconds for the dates of their clock."""
    clock = header.clock or 0
    cells_of_rows = [_cells(row, header) for row in rows]
    dated = [clock < len(cells) and bool(row.strip()) for cells, row in zip(cells_of_rows, rows, strict=True)]
    seconds = seconds_of_dates(
        cells[clock] for cells, has_date in zip(cells_of_rows, dated, strict=True) if has_date
    )
    for line, (cells, has_date) in enumerate(zip(cells_of_rows, dated, strict=True), header.line + 1):
        if has_date:
            time = next(seconds)
            if np.isnan(time):
                raise source.error(
                    expected=f"{DATES}, as in the first line of numbers",
                    found=repr(cells[clock].strip()[:40]),
                    line=line,
                )
            cells[clock] = f"{time:.6f}"
        yield (header.separator or "\t").join(cells)

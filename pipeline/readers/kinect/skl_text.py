"""The table that both `.skl` recorders write: a header of column names, then one line per frame.

Four columns per joint, `Name_X Name_Y Name_Z Name_tracked`, among others (timestamp, framenum, gyro, floor).
tracked: 0 not tracked, 1 inferred, 2 tracked.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.column_names import index_of_columns, require_columns
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_values import STEPS, check_states

FIELDS: tuple[str, ...] = ("X", "Y", "Z", "tracked")
_COLUMN = re.compile(r"([a-z]+)_(x|y|z|tracked)$")
# Joints that a Kinect v1 lacks. Three of them are more than a misspelt name.
_ONLY_V2 = {"spinebase", "spinemid", "neck", "spineshoulder", "handtipleft", "handtipright", "thumbleft"}
_MIN_V2_NAMES = 3


@dataclass(frozen=True)
class Header:
    """columns: lower-case name -> column; joints: as written, in the order of their columns; line: its
    number."""

    columns: dict[str, int]
    joints: tuple[str, ...]
    line: int


def joint_columns(line: str) -> list[str]:
    """The lower-case joint names for which a header has columns, one entry per column."""
    return [match.group(1) for name in line.lower().split() if (match := _COLUMN.match(name))]


def is_kinect_v2(joints: Sequence[str]) -> bool:
    """True if these lower-case joint names are a Kinect v2's."""
    return len(_ONLY_V2.intersection(joints)) >= _MIN_V2_NAMES


def header_of(source: Source) -> Header:
    """The header: the first line that is not blank. CaptureError if it has a name twice."""
    names, line = source.head[0].split(), source.blank_lines + 1
    columns = index_of_columns([name.lower() for name in names], source, line)
    joints = [name.rpartition("_")[0] for name in names if _COLUMN.match(name.lower())]
    return Header(columns, tuple(dict.fromkeys(joints)), line)


@dataclass(frozen=True)
class Frames:
    """times: (T,) seconds, increasing; unit: of the file's clock; points: (T, J, 3) as in the file; states:
    (T, J); defects: lines that were dropped."""

    times: Array
    unit: str
    points: Array
    states: NDArray[np.uint8]
    defects: list[Defect]


def frames_of(source: Source, header: Header, joints: Sequence[str], units: dict[str, float]) -> Frames:
    """The frames of the given joints (J,), in that order; every column is found by its name.

    units: possible units of the clock -> ticks per second; the one whose median step is a Kinect's is taken.
    Raises CaptureError for a missing column and for values that the column cannot have.
    """
    wanted = ["timestamp", *(f"{joint}_{field}" for joint in joints for field in FIELDS)]
    columns = require_columns(
        header.columns,
        wanted,
        source,
        header.line,
        expected=f"a timestamp and X, Y, Z, tracked of {len(joints)} joints",
        key=str.lower,
    )
    table = parse_table(source, start=header.line, width=len(header.columns))
    clock = table.values[:, columns[0]]
    # Beyond 2**53 a float cannot hold whole ticks.
    invalid = ~(np.abs(clock) < 2.0**53)
    if invalid.any():
        line = table.line(int(np.argmax(invalid)))
        raise source.error(expected="a timestamp", found="a non-finite number", line=line)
    start = columns[1]
    contiguous = columns[1:] == list(range(start, start + len(columns) - 1))
    # A slice is a view; a list of columns copies every number.
    chosen = table.values[:, start : start + len(columns) - 1] if contiguous else table.values[:, columns[1:]]
    values = chosen.reshape(len(clock), len(joints), len(FIELDS))
    states, points = values[..., 3], values[..., :3]
    check_states(states, joints, lambda frame: f"line {table.line(frame)}", source)
    refuse_remote(points, joints, source, table.line)
    later, defects = increasing_times(clock)
    unit = _unit(clock[later], units, source)
    if not defects:
        return Frames(clock / units[unit], unit, points, states.astype(np.uint8), defects)
    return Frames(clock[later] / units[unit], unit, points[later], states[later].astype(np.uint8), defects)


def _unit(clock: Array, units: dict[str, float], source: Source) -> str:
    """The unit for which the median step of an increasing clock (T,) is a Kinect's."""
    step = float(np.median(np.diff(clock))) if len(clock) > 1 else STEPS[0] * max(units.values())
    for unit, ticks in units.items():
        if STEPS[0] <= step / ticks <= STEPS[1]:
            return unit
    ranges = " or ".join(
        f"in {unit}, with steps of {STEPS[0] * ticks:g} to {STEPS[1] * ticks:g}"
        for unit, ticks in units.items()
    )
    raise source.error(expected=f"timestamps {ranges}", found=f"a median step of {step:g}")

"""The table that both `.skl` recorders write: a header of column names, then one line a frame.

Per joint four columns `Name_X Name_Y Name_Z Name_tracked`, among others (timestamp, framenum, gyro, floor).
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
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source

FIELDS: tuple[str, ...] = ("X", "Y", "Z", "tracked")
# Kinects give a frame every 33 ms, and a slow recorder one in three or four.
STEPS = (0.005, 0.5)
_COLUMN = re.compile(r"([a-z]+)_(x|y|z|tracked)$")
# A Kinect v1 has none of these; three are told apart from a slip in one name.
_ONLY_V2 = {"spinebase", "spinemid", "neck", "spineshoulder", "handtipleft", "handtipright", "thumbleft"}
_ENOUGH_NAMES = 3


@dataclass(frozen=True)
class Header:
    """columns: name in lower case -> column; joints: as written, in the sequence of their columns."""

    columns: dict[str, int]
    joints: tuple[str, ...]
    line: int


def joint_columns(line: str) -> list[str]:
    """The joints, in lower case, that a header has columns for: one entry a column."""
    return [match.group(1) for name in line.lower().split() if (match := _COLUMN.match(name))]


def of_kinect_v2(joints: Sequence[str]) -> bool:
    """True if joints, in lower case, are those of a Kinect v2."""
    return len(_ONLY_V2.intersection(joints)) >= _ENOUGH_NAMES


def header_of(source: Source) -> Header:
    """The header: the first line that is not blank; CaptureError if a name stands there twice."""
    names, line = source.head[0].split(), source.blank_lines + 1
    columns = {name.lower(): column for column, name in enumerate(names)}
    if len(columns) != len(names):
        lower = [name.lower() for name in names]
        twice = next(name for name in names if lower.count(name.lower()) > 1)
        raise source.error(
            expected="column names once each", found=f"{twice[:40]} twice", where=f"line {line}"
        )
    joints = [name.rpartition("_")[0] for name in names if _COLUMN.match(name.lower())]
    return Header(columns, tuple(dict.fromkeys(joints)), line)


@dataclass(frozen=True)
class Frames:
    """times: (T,) seconds, increasing; unit: of the file's clock; points: (T, J, 3) as in the file;
    states: (T, J); defects: lines that were left out."""

    times: Array
    unit: str
    points: Array
    states: NDArray[np.uint8]
    defects: list[Defect]


def frames_of(source: Source, header: Header, joints: Sequence[str], units: dict[str, float]) -> Frames:
    """The frames of the named joints (J,), in that sequence; every column is found by its name.

    units: those that the clock may have -> ticks a second; the one whose usual step is a Kinect's is taken.
    Raises CaptureError for a missing column, and for what cannot be a number of that column.
    """
    wanted = ["timestamp", *(f"{joint}_{field}" for joint in joints for field in FIELDS)]
    missing = [name for name in wanted if name.lower() not in header.columns]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise source.error(
            expected=f"a timestamp and X, Y, Z, tracked of {len(joints)} joints",
            found=f"no column {', '.join(missing[:3])}{more}",
            where=f"line {header.line}",
        )
    table = parse_table(source, start=header.line, width=len(header.columns))
    columns = [header.columns[name.lower()] for name in wanted]
    clock = table.values[:, columns[0]]
    # Beyond 2**53 a clock has no whole ticks left.
    wrong = ~(np.abs(clock) < 2.0**53)
    if wrong.any():
        where = f"line {table.line(int(np.argmax(wrong)))}"
        raise source.error(expected="a timestamp", found="no finite number", where=where)
    start = columns[1]
    side_by_side = columns[1:] == list(range(start, start + len(columns) - 1))
    # A slice is a view, a list of columns a copy of every number.
    chosen = (
        table.values[:, start : start + len(columns) - 1] if side_by_side else table.values[:, columns[1:]]
    )
    values = chosen.reshape(len(clock), len(joints), len(FIELDS))
    states, points = values[..., 3], values[..., :3]
    wrong_states = (states != 0.0) & (states != 1.0) & (states != 2.0)
    if wrong_states.any():
        frame, joint = (int(k) for k in np.argwhere(wrong_states)[0])
        raise source.error(
            expected=f"0, 1 or 2 in {joints[joint]}_tracked",
            found=f"{states[frame, joint]:g}",
            where=f"line {table.line(frame)}",
        )
    refuse_remote(points, joints, source, table.line)
    later, defects = increasing_times(clock)
    unit = _unit(clock[later], units, source)
    if not defects:
        return Frames(clock / units[unit], unit, points, states.astype(np.uint8), defects)
    return Frames(clock[later] / units[unit], unit, points[later], states[later].astype(np.uint8), defects)


def _unit(clock: Array, units: dict[str, float], source: Source) -> str:
    """The unit in which the usual step of an increasing clock (T,) is a Kinect's."""
    step = float(np.median(np.diff(clock))) if len(clock) > 1 else STEPS[0] * max(units.values())
    for unit, ticks in units.items():
        if STEPS[0] <= step / ticks <= STEPS[1]:
            return unit
    ranges = " or ".join(
        f"in {unit}, with steps of {STEPS[0] * ticks:g} to {STEPS[1] * ticks:g}"
        for unit, ticks in units.items()
    )
    raise source.error(expected=f"timestamps {ranges}", found=f"a usual step of {step:g}")

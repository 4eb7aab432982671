"""Azure Kinect body tracking as tables: positions and, in a second file, orientations, by named columns.

A row is one body in one frame: timestamp (µs), body_idx, then for each of the SDK's 32 joints "PELVIS (c)",
its confidence, and "PELVIS (x)", (y), (z) in mm; in the second file (w), (x), (y), (z) of its orientation.
PyMoCapViewer shows such pairs. Fields are separated by semicolons or commas. A frame without anybody has no
row. Joints, axes and the frames of the joints: azure_joints.py.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.column_names import (
    index_of_columns,
    require_columns,
    semicolon_or_comma,
)
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import Table, decimal_points, parse_table
from kinemimic.pipeline.readers.base.paired_files import other_half, required_half
from kinemimic.pipeline.readers.base.people import found_again, other_people
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.azure_joints import (
    AZURE_JOINTS,
    OLD_NAMES,
    STATE_OF_CONFIDENCE,
    WORLD_FROM_CAMERA,
    azure_skeleton,
)
from kinemimic.pipeline.readers.kinect.kinect_values import check_quaternions, sensor_clock

FORMAT = Format(
    name="Azure Kinect body tracking CSV",
    sensor="Azure Kinect",
    holds="times, positions and orientations of 32 joints, any number of people",
    recognised_by="a header with timestamp, body_idx and columns PELVIS (x) … EAR_RIGHT (z)",
    columns=(130,),
    sidecar_file="optional: the orientations of the recording, `orientations` for `positions` in the name",
)
_CLOCK, _BODY = "timestamp", "body_idx"
# Fields of a joint in either file; quaternions in our order.
_POSITION, _ORIENTATION = "cxyz", "xyzw"
_HALVES = ("positions", "orientations")
# Microseconds; larger times are damage, and a float could not hold them exactly.
_MAX_TIME = 2**53
_MM = 1000.0


def recognises(source: Source) -> bool:
    """True if the first line is a header with the clock, the body and most joints."""
    names = _names(source)
    joints = sum(f"{joint} (x)" in names for joint in AZURE_JOINTS)
    return {_CLOCK, _BODY} <= set(names) and joints > len(AZURE_JOINTS) // 2


def read(source: Source) -> Clip:
    """The clip of the person seen in most frames, 32 joints, with rotations if their file is in the same
    folder.

    Either file may be passed. Other people are dropped and counted. Where others are seen and that person is
    not, every joint is missing. Raises CaptureError for orientations without positions, or a pair that does
    not match.
    """
    half = _half(source)
    positions, orientations, notes = half, None, []
    if half.is_positions:
        found = other_half(source, *_HALVES)
        orientations = None if found is None else _half(found)
        if orientations is None:
            notes.append("no file of orientations in the same folder: rotations follow from positions")
    else:
        positions, orientations = _half(required_half(source, *reversed(_HALVES))), half
        if not positions.is_positions:
            raise positions.source.error(expected="columns PELVIS (c) … of positions", found="orientations")
    if orientations is not None:
        _check_pair(positions, orientations)
    begins, times = positions.frames()
    later, defects = sensor_clock(times, lambda frame: positions.where(int(begins[frame])), positions.source)
    frame_of_row = np.searchsorted(begins, np.arange(len(positions.people)), side="right") - 1
    again = found_again(times[frame_of_row], positions.people, positions.values[..., 1:])
    people = [set(group.tolist()) for group in np.split(again.people, begins[1:])]
    main_person = Counter(again.people[again.kept].tolist()).most_common(1)[0][0]
    rows = np.flatnonzero(again.kept & (again.people == main_person))
    frames = frame_of_row[rows]

    points = np.full((len(times), len(AZURE_JOINTS), 3), np.nan)
    states = np.zeros(points.shape[:2], dtype=np.uint8)
    points[frames] = positions.values[rows, :, 1:] / _MM
    states[frames] = positions.states()[rows]
    # Of the rows, which have lines; the frames are of the main person alone.
    refuse_remote(positions.values[..., 1:] / _MM, AZURE_JOINTS, positions.source, positions.where, unit="mm")
    skeleton, rotations = azure_skeleton(), None
    if orientations is not None:
        turns = np.full((len(times), len(AZURE_JOINTS), 4), np.nan)
        turns[frames] = orientations.values[rows]
        check_quaternions(orientations.values, AZURE_JOINTS, orientations.where, orientations.source)
        rotations = child_to_parent(turns[later], skeleton, WORLD_FROM_CAMERA)
    return clip_of_points(
        skeleton,
        times[later],
        points[later],
        states[later],
        format=FORMAT,
        reading=reading(
            units="mm",
            units_rule="the format's",
            defects=[*defects, *again.defects(), *other_people(people, main_person)],
            notes=notes,
            columns=positions.width,
        ),
        world_from_file=WORLD_FROM_CAMERA,
        rotations=rotations,
    )


@dataclass(frozen=True)
class _Half:
    """One of the two files. clock: (R,) µs; people: (R,) body of each row; values: (R, 32, 4), confidence and
    position, or orientation."""

    source: Source
    table: Table
    width: int
    is_positions: bool
    clock: Array
    people: NDArray[np.int64]
    values: Array

    def where(self, row: int) -> str:
        return f"line {self.table.line(row)}"

    def frames(self) -> tuple[NDArray[np.intp], Array]:
        """The first row of each frame, and the frames' times in seconds; one row per body and frame."""
        begins = np.flatnonzero(np.concatenate([[True], np.diff(self.clock) != 0.0]))
        frame = np.searchsorted(begins, np.arange(len(self.clock)), side="right") - 1
        _, firsts = np.unique(np.stack([frame, self.people]), axis=1, return_index=True)
        if len(firsts) < len(frame):
            again = int(np.setdiff1d(np.arange(len(frame)), firsts)[0])
            raise self.source.error(
                expected="one row for each body of a frame",
                found=f"a second row of body {self.people[again]} at the same time",
                where=self.where(again),
            )
        return begins, self.clock[begins] * 1e-6

    def states(self) -> States:
        """States (R, 32) of the joints."""
        levels = self.values[..., 0]
        wrong = ~np.isin(levels, np.arange(len(STATE_OF_CONFIDENCE)))
        if wrong.any():
            row, joint = (int(k) for k in np.argwhere(wrong)[0])
            raise self.source.error(
                expected=f"a confidence of {AZURE_JOINTS[joint]}, 0 to 3",
                found=f"{levels[row, joint]:g}",
                where=self.where(row),
            )
        return STATE_OF_CONFIDENCE[levels.astype(np.intp)]


def _names(source: Source) -> list[str]:
    """The names in the header, with the joints in today's spelling."""
    names = [name.strip() for name in source.head[0].split(semicolon_or_comma(source))]
    for old, new in OLD_NAMES.items():
        names = [name.replace(f"{old} (", f"{new} (") for name in names]
    return names


def _half(source: Source) -> _Half:
    names, line = _names(source), source.blank_lines + 1
    index = index_of_columns(names, source, line)
    is_positions = "PELVIS (w)" not in index
    fields = _POSITION if is_positions else _ORIENTATION
    wanted = [_CLOCK, _BODY, *(f"{joint} ({field})" for joint in AZURE_JOINTS for field in fields)]
    columns = require_columns(
        index,
        wanted,
        source,
        line,
        expected=f"the {_HALVES[0] if is_positions else _HALVES[1]} of the Azure Kinect's 32 joints",
    )
    separator = semicolon_or_comma(source)
    table = parse_table(
        decimal_points(source, separator, line), start=line, width=len(names), separator=separator
    )
    values = table.values[:, columns]
    clock, people = values[:, 0], values[:, 1]
    for wrong, expected, column in (
        (~((clock >= 0) & (clock < _MAX_TIME)), "a timestamp in µs", clock),
        (~(np.abs(people) < 1e9) | (people != np.round(people)), "a whole number as body_idx", people),
    ):
        if wrong.any():
            row = int(np.argmax(wrong))
            raise source.error(expected=expected, found=f"{column[row]:g}", line=table.line(row))
    joints = values[:, 2:].reshape(len(values), len(AZURE_JOINTS), len(fields))
    return _Half(source, table, len(names), is_positions, clock, people.astype(np.int64), joints)


def _check_pair(positions: _Half, orientations: _Half) -> None:
    """Raise CaptureError unless both files have the same bodies at the same times."""
    if orientations.is_positions:
        raise orientations.source.error(expected="columns PELVIS (w) … of orientations", found="positions")
    if len(positions.clock) != len(orientations.clock):
        raise orientations.source.error(
            expected=f"as many rows as in {positions.source.path.name}, {len(positions.clock)}",
            found=f"{len(orientations.clock)}",
            advice="one of the two is cut off",
        )
    other = (positions.clock != orientations.clock) | (positions.people != orientations.people)
    if other.any():
        row = int(np.argmax(other))
        raise orientations.source.error(
            expected=f"body {positions.people[row]} at {positions.clock[row]:.0f} µs, as in "
            f"{positions.source.path.name}",
            found=f"body {orientations.people[row]} at {orientations.clock[row]:.0f} µs",
            where=orientations.where(row),
        )

"""The rows of a custom table as arrays of frames and joints; a row holds a whole frame or one joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.dates import DATES, seconds_of_dates
from kinemimic.pipeline.readers.custom_table.description import DATE, SECONDS, Column, Description, Joint
from kinemimic.pipeline.readers.custom_table.states import (
    states_are_words,
    states_of_numbers,
    states_of_words,
)
from kinemimic.pipeline.readers.custom_table.table import Cells, Words

Indices = NDArray[np.intp]

# In metres. Larger values are damage or another unit: no sensor or laboratory reaches that far.
MAX_COORDINATE = 1000.0
# No angle is this large, in any unit.
_MAX_ANGLE = 1e6
# Larger than any clock, in any unit.
_LARGEST_TIME = 2.0**63
# Limits in seconds of the median time step; outside them, the unit of time is wrong.
TIME_STEPS = (0.0002, 2.0)


@dataclass(frozen=True)
class Rows:
    """T frames of the description's J joints, in the file's units and axes, NaN where a value is missing.

    times: (T,) seconds, strictly increasing; points: (T, J, 3); rotations: (T, J, 3, 4 or 0) as in the file;
    states: (T, J), or None without a column of states; defects: what was wrong with the rows.
    """

    times: Array
    points: Array
    rotations: Array
    states: NDArray[np.uint8] | None
    defects: list[Defect]


def rows_of(source: Source, description: Description, name: str) -> Rows:
    """The frames of a source; CaptureError names the line that contradicts the description."""
    cells = Cells(source, description.text, name)
    table = _Reader(cells, description)
    frames, joints, first = table.frame_and_joint_of_rows()
    times = table.times(first)
    later, defects = increasing_times(times)
    if later.sum() > 1:
        step = float(np.median(np.diff(times[later])))
        if not TIME_STEPS[0] <= step <= TIME_STEPS[1]:
            cells.fail(
                "time.unit",
                expected=f"steps of {TIME_STEPS[0]:g} to {TIME_STEPS[1]:g} s",
                found=f"a median of {step:g} s",
            )
    shape = (len(first), len(description.joints))
    points = table.fill(frames, joints, [joint.position for joint in description.joints], (*shape, 3))
    rotations = table.fill(
        frames,
        joints,
        [joint.quaternion or joint.euler for joint in description.joints],
        (*shape, max(len(joint.quaternion or joint.euler) for joint in description.joints)),
    )
    # Some recorders write infinity for a joint that was not seen.
    points[np.isinf(points)] = np.nan
    remote = np.abs(points) > MAX_COORDINATE / description.space.metres
    if remote.any():
        frame, joint, axis = (int(k) for k in np.argwhere(remote)[0])
        cells.fail(
            "space.unit",
            expected=f"at most {MAX_COORDINATE:g} m",
            found=f"{points[frame, joint, axis]:g} {description.space.unit}",
            line=cells.line(int(first[frame])),
        )
    rotations[~(np.abs(rotations) < _MAX_ANGLE)] = np.nan
    states = table.states(frames, joints, shape)
    # All rows are kept in most files, and then need no copy.
    kept = slice(None) if later.all() else later
    return Rows(times[kept], points[kept], rotations[kept], None if states is None else states[kept], defects)


class _Reader:
    """Reads all columns that a description needs in one pass."""

    def __init__(self, cells: Cells, description: Description) -> None:
        self.cells, self.description = cells, description
        self.states_are_words = states_are_words(description.states)
        numbers: list[int] = []
        words: list[int] = []
        for joint in description.joints:
            for columns in (joint.position, joint.quaternion, joint.euler):
                numbers += self._column_indices(columns, joint)
            (words if self.states_are_words else numbers).extend(self._column_indices(joint.state, joint))
        clock = description.clock
        if clock.column is not None:
            (words if clock.unit == DATE else numbers).append(cells.index(clock.column, "time.column"))
        # If the column of frame numbers is also the clock, it is read as a time.
        self.clock_marks_frames = description.frame_column in (None, description.clock.column)
        if description.joint_column is not None:
            words.append(cells.index(description.joint_column, "columns.joint"))
        if description.frame_column is not None and not self.clock_marks_frames:
            words.append(cells.index(description.frame_column, "columns.frame"))
        numbers, words = sorted(set(numbers)), sorted(set(words))
        self.values, texts = cells.read(numbers, words)
        self.slot_of_column = {column: k for k, column in enumerate(numbers)}
        self.words = dict(zip(words, texts, strict=True))
        self.clock = None if clock.column is None else self._clock(cells.index(clock.column, "time.column"))

    def _clock(self, column: int) -> Array:
        """The clock of each row (R,), in its unit; seconds of dates."""
        if column in self.slot_of_column:
            return self.values[:, self.slot_of_column[column]]
        dates = self.words[column]
        times = np.array([*seconds_of_dates(dates.known[code] for code in dates.codes)])
        if np.isnan(times).any():
            row = int(np.argmax(np.isnan(times)))
            self.cells.fail(
                "time.unit",
                expected=DATES,
                found=repr(dates.known[dates.codes[row]]),
                line=self.cells.line(row),
            )
        return times

    def _column_indices(self, columns: Sequence[Column], joint: Joint) -> list[int]:
        return [self.cells.index(column, f"the columns of {joint.name}") for column in columns]

    def frame_and_joint_of_rows(self) -> tuple[Indices, Indices, Indices]:
        """The frame and the joint of each row (-1: all joints, or one not described), and one row of each
        frame."""
        count, rows = len(self.description.joints), len(self.values)
        if self.description.text.rows == "frame":
            return np.arange(rows), np.full(rows, -1), np.arange(rows)
        column = self.description.joint_column
        if column is None:
            if rows % count:
                self.cells.fail(
                    "joints",
                    expected=f"{count} rows per frame, one for each joint",
                    found=f"{rows} rows: {count - rows % count} are missing from the last frame",
                )
            joints = np.arange(rows) % count
            starts = joints == 0
        else:
            joint_names = self.words[self.cells.index(column, "columns.joint")]
            named = {joint.named: k for k, joint in enumerate(self.description.joints)}
            missing = [name for name in named if name not in joint_names.known]
            if missing:
                self.cells.fail(
                    "joints",
                    expected=f"rows of {', '.join(missing[:3])}",
                    found=f"rows of {', '.join(joint_names.known[1:21])}",
                )
            joints = np.array([named.get(name, -1) for name in joint_names.known], dtype=np.intp)[
                joint_names.codes
            ]
            starts = self._frame_starts(joint_names.codes)
        frames = np.cumsum(starts) - 1
        self._refuse_repeated_joints(frames, joints)
        return frames, joints, np.flatnonzero(starts)

    def _frame_starts(self, joint_names: Indices) -> NDArray[np.bool_]:
        """The rows at which a frame starts: a new frame number or time, else the first joint of the file."""
        frame = self.description.frame_column
        if frame is not None and not self.clock_marks_frames:
            numbers = self.words[self.cells.index(frame, "columns.frame")].codes
            changes = numbers[1:] != numbers[:-1]
        elif self.clock is not None:
            changes = self.clock[1:] != self.clock[:-1]
        else:
            return np.asarray(joint_names == joint_names[0])
        return np.concatenate([[True], changes])

    def _refuse_repeated_joints(self, frames: Indices, joints: Indices) -> None:
        """Raise CaptureError if a joint occurs twice in a frame."""
        seen = joints >= 0
        keys = frames[seen] * len(self.description.joints) + joints[seen]
        order = np.argsort(keys, kind="stable")
        repeated = np.flatnonzero(np.diff(keys[order]) == 0)
        if len(repeated):
            row = int(np.flatnonzero(seen)[order[repeated + 1]].min())
            name = self.description.joints[int(joints[row])].named
            self.cells.fail(
                "columns.frame",
                expected="each joint once per frame",
                found=f"{name} twice",
                line=self.cells.line(row),
            )

    def times(self, first: Indices) -> Array:
        """Seconds (T,) of the frames, given a row of each."""
        clock = self.description.clock
        if self.clock is None:
            return np.arange(len(first)) / (clock.rate or 1.0)
        times = self.clock[first]
        wrong = ~(np.abs(times) < _LARGEST_TIME)  # NaN too
        if wrong.any():
            frame = int(np.argmax(wrong))
            found = "none" if np.isnan(times[frame]) else f"{times[frame]:g}"
            line = self.cells.line(int(first[frame]))
            self.cells.fail("time.column", expected="a time", found=found, line=line)
        return times / (clock.rate or 1.0) if clock.counted else times * SECONDS.get(clock.unit, 1.0)

    def fill(
        self,
        frames: Indices,
        joints: Indices,
        columns: Sequence[Sequence[Column]],
        shape: tuple[int, int, int],
    ) -> Array:
        """Values (T, J, n) of each joint's columns."""
        joined = [
            [
                self.slot_of_column[column]
                for column in self._column_indices(of_joint, self.description.joints[joint])
            ]
            for joint, of_joint in enumerate(columns)
        ]
        if self.description.text.rows == "frame" and all(len(slots) == shape[2] for slots in joined):
            return self.values[:, np.array(joined, dtype=np.intp).ravel()].reshape(shape)
        filled: Array = np.full(shape, np.nan)
        for joint, slots in enumerate(joined):
            if slots:
                rows = joints == joint if self.description.text.rows == "joint" else slice(None)
                filled[frames[rows], joint] = self.values[rows][:, slots]
        return filled

    def states(self, frames: Indices, joints: Indices, shape: tuple[int, int]) -> NDArray[np.uint8] | None:
        """States (T, J): as in the columns; tracked without a column, missing without a row."""
        joints_of_description = self.description.joints
        if not any(joint.state for joint in joints_of_description):
            return None
        states = np.full(shape, 2, dtype=np.uint8)
        for k, joint in enumerate(joints_of_description):
            if not joint.state:
                continue
            rows = (
                np.flatnonzero(joints == k)
                if self.description.text.rows == "joint"
                else np.arange(len(joints))
            )
            (column,) = self._column_indices(joint.state, joint)
            if self.states_are_words:
                written = self.words[column]
                here = Words(written.codes[rows], written.known)
                known, codes = states_of_words(here, self.description.states)
            else:
                numbers = self.values[rows, self.slot_of_column[column]]
                known, codes = states_of_numbers(numbers, self.description.states)
            if not known.all():
                row = int(rows[int(np.argmin(known))])
                words = self.words.get(column)
                found = (
                    words.known[words.codes[row]]
                    if words
                    else f"{self.values[row, self.slot_of_column[column]]:g}"
                )
                self.cells.fail(
                    "states",
                    expected=f"a state of {joint.name}",
                    found=repr(str(found)),
                    line=self.cells.line(row),
                )
            states[:, k] = 0
            states[frames[rows], k] = codes
        return states

"""A described table's rows to arrays of frames and joints, whether a row holds a frame or one joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.toml_keys import Column
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.frame_defects import in_sequence
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.description import Description, Joint
from kinemimic.pipeline.readers.custom_table.states import in_words, states_of_numbers, states_of_words
from kinemimic.pipeline.readers.custom_table.table import Cells, Words

Whole = NDArray[np.intp]

# Farther off is damage, or another unit: no sensor or laboratory reaches that far.
FARTHEST = 1000.0
# No angle grows so large, in whatever unit.
_MOST_TURNS = 1e6
# A usual step outside of these is no recorder's: the unit of time is another one.
STEPS = (0.0002, 2.0)


@dataclass(frozen=True)
class Rows:
    """T frames of the description's J joints, in its units and axes, NaN where there is nothing.

    times: (T,) seconds, strictly increasing; points: (T, J, 3); turns: (T, J, 3, 4 or 0) as written;
    states: (T, J) or None where no column tells; defects: what was wrong with them.
    """

    times: Array
    points: Array
    turns: Array
    states: NDArray[np.uint8] | None
    defects: list[Defect]


def rows_of(source: Source, description: Description, name: str) -> Rows:
    """The frames of a source; CaptureError names the line that is not as described."""
    cells = Cells(source, description.text, name)
    table = _Reader(cells, description)
    frames, joints, first = table.places()
    times = table.times(first)
    later, defects = in_sequence(times)
    if later.sum() > 1:
        step = float(np.median(np.diff(times[later])))
        if not STEPS[0] <= step <= STEPS[1]:
            cells.fail(
                "time.unit", expected=f"steps of {STEPS[0]:g} to {STEPS[1]:g} s", found=f"usually {step:g} s"
            )
    shape = (len(first), len(description.joints))
    points = table.fill(frames, joints, [joint.position for joint in description.joints], (*shape, 3))
    turns = table.fill(
        frames,
        joints,
        [joint.quaternion or joint.euler for joint in description.joints],
        (*shape, max(len(joint.quaternion or joint.euler) for joint in description.joints)),
    )
    # Infinity is a way to say that nothing was seen.
    points[np.isinf(points)] = np.nan
    far = np.abs(points) > FARTHEST / description.space.metres
    if far.any():
        frame, joint, axis = (int(k) for k in np.argwhere(far)[0])
        cells.fail(
            "space.unit",
            expected=f"at most {FARTHEST:g} m",
            found=f"{points[frame, joint, axis]:g} {description.space.unit}",
            line=cells.line(int(first[frame])),
        )
    turns[~(np.abs(turns) < _MOST_TURNS)] = np.nan
    states = table.states(frames, joints, shape)
    # Rows are mostly kept all, and need no copy then.
    kept = slice(None) if later.all() else later
    return Rows(times[kept], points[kept], turns[kept], None if states is None else states[kept], defects)


class _Reader:
    """The columns that a description needs, read at once."""

    def __init__(self, cells: Cells, description: Description) -> None:
        self.cells, self.description = cells, description
        self.wordy = in_words(description.states)
        numbers: list[int] = []
        words: list[int] = []
        for joint in description.joints:
            for columns in (joint.position, joint.quaternion, joint.euler):
                numbers += self._at(columns, joint)
            (words if self.wordy else numbers).extend(self._at(joint.state, joint))
        if description.clock.column is not None:
            numbers.append(cells.index(description.clock.column, "time.column"))
        # Frame numbers may be the clock too: then they are read as such.
        self.by_clock = description.frame_column in (None, description.clock.column)
        if description.joint_column is not None:
            words.append(cells.index(description.joint_column, "columns.joint"))
        if description.frame_column is not None and not self.by_clock:
            words.append(cells.index(description.frame_column, "columns.frame"))
        numbers, words = sorted(set(numbers)), sorted(set(words))
        self.values, texts = cells.read(numbers, words)
        self.slot = {column: k for k, column in enumerate(numbers)}
        self.words = dict(zip(words, texts, strict=True))

    def _at(self, columns: Sequence[Column], joint: Joint) -> list[int]:
        return [self.cells.index(column, f"the columns of {joint.name}") for column in columns]

    def places(self) -> tuple[Whole, Whole, Whole]:
        """Of each row its frame and its joint (-1: all, or none that is described); of each frame a row."""
        count, rows = len(self.description.joints), len(self.values)
        if not self.description.text.long:
            return np.arange(rows), np.full(rows, -1), np.arange(rows)
        column = self.description.joint_column
        if column is None:
            if rows % count:
                self.cells.fail(
                    "joints",
                    expected=f"{count} rows a frame, one for each joint",
                    found=f"{rows} rows: the last frame lacks {count - rows % count}",
                )
            joints = np.arange(rows) % count
            begins = joints == 0
        else:
            names = self.words[self.cells.index(column, "columns.joint")]
            named = {joint.named: k for k, joint in enumerate(self.description.joints)}
            lacking = [name for name in named if name not in names.known]
            if lacking:
                self.cells.fail(
                    "joints",
                    expected=f"rows of {', '.join(lacking[:3])}",
                    found=f"rows of {', '.join(names.known[1:21])}",
                )
            joints = np.array([named.get(name, -1) for name in names.known], dtype=np.intp)[names.codes]
            begins = self._begins(names.codes)
        frames = np.cumsum(begins) - 1
        self._once(frames, joints)
        return frames, joints, np.flatnonzero(begins)

    def _begins(self, names: Whole) -> NDArray[np.bool_]:
        """Where a frame begins: with another frame number, or time, or else with the file's first joint."""
        frame = self.description.frame_column
        if frame is not None and not self.by_clock:
            numbers = self.words[self.cells.index(frame, "columns.frame")].codes
            changes = numbers[1:] != numbers[:-1]
        elif (clock := self.description.clock.column) is not None:
            times = self.values[:, self.slot[self.cells.index(clock, "time.column")]]
            changes = times[1:] != times[:-1]
        else:
            return np.asarray(names == names[0])
        return np.concatenate([[True], changes])

    def _once(self, frames: Whole, joints: Whole) -> None:
        seen = joints >= 0
        places = frames[seen] * len(self.description.joints) + joints[seen]
        order = np.argsort(places, kind="stable")
        twice = np.flatnonzero(np.diff(places[order]) == 0)
        if len(twice):
            row = int(np.flatnonzero(seen)[order[twice + 1]].min())
            name = self.description.joints[int(joints[row])].named
            self.cells.fail(
                "columns.frame",
                expected="each joint once a frame",
                found=f"{name} twice",
                line=self.cells.line(row),
            )

    def times(self, first: Whole) -> Array:
        """Seconds (T,) of the frames that begin at these rows."""
        clock = self.description.clock
        if clock.column is None:
            return np.arange(len(first)) / (clock.rate or 1.0)
        times: Array = self.values[first, self.slot[self.cells.index(clock.column, "time.column")]]
        if not np.isfinite(times).all():
            row = int(first[np.flatnonzero(~np.isfinite(times))[0]])
            self.cells.fail("time.column", expected="a time", found="none", line=self.cells.line(row))
        return times / (clock.rate or 1.0) if clock.counted else times * clock.seconds

    def fill(
        self, frames: Whole, joints: Whole, columns: Sequence[Sequence[Column]], shape: tuple[int, int, int]
    ) -> Array:
        """Values (T, J, n) of each joint's columns."""
        joined = [
            [self.slot[column] for column in self._at(of_joint, self.description.joints[joint])]
            for joint, of_joint in enumerate(columns)
        ]
        if not self.description.text.long and all(len(slots) == shape[2] for slots in joined):
            return self.values[:, np.array(joined, dtype=np.intp).ravel()].reshape(shape)
        filled: Array = np.full(shape, np.nan)
        for joint, slots in enumerate(joined):
            if slots:
                rows = joints == joint if self.description.text.long else slice(None)
                filled[frames[rows], joint] = self.values[rows][:, slots]
        return filled

    def states(self, frames: Whole, joints: Whole, shape: tuple[int, int]) -> NDArray[np.uint8] | None:
        """States (T, J): what the columns say; tracked without a column, missing without a row."""
        described = self.description.joints
        if not any(joint.state for joint in described):
            return None
        states = np.full(shape, 2, dtype=np.uint8)
        for k, joint in enumerate(described):
            if not joint.state:
                continue
            rows = np.flatnonzero(joints == k) if self.description.text.long else np.arange(len(joints))
            (column,) = self._at(joint.state, joint)
            if self.wordy:
                written = self.words[column]
                here = Words(written.codes[rows], written.known)
                known, codes = states_of_words(here, self.description.states)
            else:
                numbers = self.values[rows, self.slot[column]]
                known, codes = states_of_numbers(numbers, self.description.states)
            if not known.all():
                row = int(rows[int(np.argmin(known))])
                words = self.words.get(column)
                found = words.known[words.codes[row]] if words else f"{self.values[row, self.slot[column]]:g}"
                self.cells.fail(
                    "states",
                    expected=f"a state of {joint.name}",
                    found=repr(str(found)),
                    line=self.cells.line(row),
                )
            states[:, k] = 0
            states[frames[rows], k] = codes
        return states

"""The landmarks in a MediaPipe table, of either layout: a row per frame and person, or per landmark."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import says_time
from kinemimic.pipeline.readers.clocks.video_clock import is_frame_number
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, NUMBER
from kinemimic.pipeline.readers.landmarks.landmark_columns import FIELDS, field_columns, landmark_columns
from kinemimic.pipeline.readers.landmarks.one_person import is_person
from kinemimic.pipeline.readers.landmarks.words_in_table import with_numbers_for_words

_ROWS = 1000  # that show the width of a table


@dataclass(frozen=True)
class Landmarks:
    """columns: of the table; beside: name -> what the rows say (R,) beside the landmarks; values: (R, 33, 5),
    the FIELDS; line: of a row."""

    columns: int
    beside: dict[str, Array]
    values: Array
    line: Callable[[int], int]


def table_of_frames(names: Sequence[str], line: int, separator: str, source: Source) -> Landmarks:
    """Of a table with one row per frame and person; line: of its header. Raises CaptureError for damage."""
    landmarks = landmark_columns(names)
    times = [column for column, name in enumerate(names) if says_time(name)]
    table = parse_sparse_table(
        with_numbers_for_words(source, line, separator, numeric=landmarks, times=times, known={}),
        start=line,
        width=len(names),
        separator=separator,
        keep_empty_rows=not times,
    )
    values = _unseen(len(table.values))
    for column, (number, field) in landmarks.items():
        values[:, number, FIELDS.index(field)] = table.values[:, column]
    beside = {name: table.values[:, k] for k, name in enumerate(names) if k not in landmarks}
    return Landmarks(len(names), beside, values, table.line)


def table_of_landmarks(
    names: Sequence[str], mark: int, line: int, separator: str, source: Source
) -> Landmarks:
    """Of a table with the landmark's number, or name, in the row, in column `mark`; line: of its header.

    Raises CaptureError for damage, and for other landmarks.
    """
    # What stands before the number is the frame's, what stands behind it the landmark's.
    size = len(names) - mark
    fields = {field: column - mark for field, column in field_columns(names).items() if column > mark}
    times = [column for column, name in enumerate(names) if says_time(name)]
    source = with_numbers_for_words(
        source,
        line,
        separator,
        numeric={mark + column for column in fields.values()},
        times=times,
        known={mark: NUMBER},
    )
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
    frame = _frames(table.values[:, _of_a_frame(names[:mark])], numbers)
    values = _unseen(frame.max() + 1)
    there = np.flatnonzero(~nobody)
    landmarks = numbers[there].astype(np.intp)
    for field, column in fields.items():
        values[frame[there, None], landmarks, FIELDS.index(field)] = rows[there, :, column]
    firsts = np.unique(frame, return_index=True)[1]
    return Landmarks(
        width,
        {name: table.values[firsts, column] for column, name in enumerate(names[:mark])},
        values,
        lambda row: table.line(int(firsts[row])),
    )


def _unseen(rows: int) -> Array:
    """Values (rows, 33, 5) of landmarks without a place, which are visible as far as is known."""
    values = np.full((rows, len(LANDMARKS), len(FIELDS)), np.nan)
    values[..., 3:] = 1.0
    return values


def _of_a_frame(names: Sequence[str]) -> list[int]:
    """The columns by which frames, and people in them, are told apart; all if none is named like that."""
    told = [k for k, name in enumerate(names) if says_time(name) or is_frame_number(name) or is_person(name)]
    return told or list(range(len(names)))


def _frames(beside: Array, numbers: Array) -> NDArray[np.intp]:
    """The frame (R,) of each row, from what tells it apart (R, n), and the landmarks' numbers (R, k).

    A new one begins where the former change. A landmark that a frame has already is of another person, who
    gets a frame at the same time.
    """
    if numbers.shape[1] > 1:
        return np.arange(len(beside))
    if not beside.shape[1]:
        # Nothing but landmarks: their numbers begin anew in each frame.
        return np.cumsum(np.diff(numbers[:, 0], prepend=np.inf) <= 0) - 1
    same = (beside[1:] == beside[:-1]) | (np.isnan(beside[1:]) & np.isnan(beside[:-1]))
    frame = np.concatenate([[0], np.cumsum(~same.all(axis=1))])
    # The place of each row among those of its frame with the same landmark.
    landmark = frame * (len(LANDMARKS) + 1) + np.nan_to_num(numbers[:, 0], nan=len(LANDMARKS)).astype(np.intp)
    order = np.argsort(landmark, kind="stable")
    begins = np.flatnonzero(np.diff(landmark[order], prepend=-1))
    person = np.empty_like(frame)
    person[order] = np.arange(len(frame)) - np.repeat(begins, np.diff([*begins, len(frame)]))
    return np.unique(frame * (person.max() + 1) + person, return_inverse=True)[1].astype(np.intp)

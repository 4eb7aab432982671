"""Read joints.csv and times.csv of a depth recording."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.readers.base.source import Source

MAX_JOINTS = 200
_REQUIRED = ("frame", "joint", "u", "v")
_OPTIONAL = ("depth", "state")
# Joints may be outside the image, but not this far.
_MAX_PIXEL = 1e5
_MAX_DEPTH = 100.0  # metres
_MAX_FRAME = 1e12


@dataclass(frozen=True)
class JointTable:
    """names: (J,) in order of appearance; pixels: (T, J, 2) and depth: (T, J) metres, NaN where not given;
    states: (T, J) as given, TRACKED without such a column; frames_without_image: number of frames in the
    table but not in the recording; has_depth: whether any depth is given."""

    names: tuple[str, ...]
    pixels: Array
    depth: Array
    states: NDArray[np.uint8]
    frames_without_image: int
    has_depth: bool


def read_joints(source: Source, frames: Sequence[int], units: float) -> JointTable:
    """The joints' pixels in all of `frames` (ascending); units: of depth per metre.

    The header names the columns: frame, joint, u, v and, optionally, depth and state (0, 1, 2). CaptureError
    names the line of the first mistake.
    """
    columns, rows = _rows(source, _REQUIRED, _OPTIONAL)
    frame_column, joint_column, u_column, v_column = (columns[name] for name in _REQUIRED)
    depth_column, state_column = (columns.get(name) for name in _OPTIONAL)
    index: dict[str, int] = {}
    joints, numbers = array("q"), array("d")
    for line, fields in rows:
        name = fields[joint_column].strip()
        joint = index.setdefault(name, len(index))
        if not name or len(index) > MAX_JOINTS:
            found = "none" if not name else "more"
            wanted = f"names of at most {MAX_JOINTS} joints"
            raise source.error(expected=wanted, found=found, line=line)
        joints.append(joint)
        numbers.append(_number(source, line, "frame", fields[frame_column], 0.0, _MAX_FRAME))
        for column in (u_column, v_column):
            field = fields[column]
            numbers.append(_number(source, line, "u and v", field, -_MAX_PIXEL, _MAX_PIXEL))
        depth_field = fields[depth_column] if depth_column is not None else ""
        numbers.append(_number(source, line, "depth", depth_field, 0.0, _MAX_DEPTH * units))
        state = fields[state_column] if state_column is not None else f"{TRACKED}"
        numbers.append(_number(source, line, "state", state, 0.0, float(TRACKED)))
        numbers.append(line)
    values = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 6) if numbers else np.empty((0, 6))
    return _table(source, tuple(index), np.array(joints, dtype=np.intp), values, np.array(frames), units)


def _table(
    source: Source,
    names: tuple[str, ...],
    joints: NDArray[np.intp],
    values: Array,
    frames: NDArray[np.int64],
    units: float,
) -> JointTable:
    if not names:
        raise source.error(expected="joints below the header", found="none")
    for column, name, kind in ((0, "frame", "a whole number"), (4, "state", "0, 1 or 2")):
        wrong = values[:, column] != np.floor(values[:, column])
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            found = f"{values[row, column]:g}"
            raise source.error(expected=f"{kind} as {name}", found=found, line=int(values[row, 5]))
    numbers = values[:, 0].astype(np.int64)
    _, first = np.unique(numbers * len(names) + joints, return_index=True)
    if len(first) < len(numbers):
        row = int(np.setdiff1d(np.arange(len(numbers)), first)[0])
        found = f"{names[joints[row]]} of frame {numbers[row]} again"
        raise source.error(expected="each joint once per frame", found=found, line=int(values[row, 5]))
    rows_of_frames = np.searchsorted(frames, numbers)
    in_recording = frames[np.minimum(rows_of_frames, len(frames) - 1)] == numbers
    shape = (len(frames), len(names))
    pixels, depth = np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    states = np.zeros(shape, dtype=np.uint8)
    indices = (rows_of_frames[in_recording], joints[in_recording])
    metres = np.where(values[in_recording, 3] > 0, values[in_recording, 3], np.nan) / units
    pixels[indices], depth[indices] = values[in_recording, 1:3], metres
    states[indices] = values[in_recording, 4].astype(np.uint8)
    frames_without_image = len(np.unique(numbers[~in_recording]))
    return JointTable(names, pixels, depth, states, frames_without_image, bool(np.isfinite(depth).any()))


def read_times(source: Source, frames: Sequence[int]) -> Array:
    """Seconds (T,) of the frames, from a table of frame and time; CaptureError if a time is missing or
    decreases."""
    columns, rows = _rows(source, ("frame", "time"), ())
    times: dict[float, float] = {}
    for line, fields in rows:
        frame = _number(source, line, "frame", fields[columns["frame"]], 0.0, _MAX_FRAME)
        times[frame] = _number(source, line, "time", fields[columns["time"]], -1e12, 1e12)
    missing = [frame for frame in frames if not np.isfinite(times.get(frame, np.nan))]
    if missing:
        found = f"none for frame {missing[0]}" + (f" and {len(missing) - 1} more" if len(missing) > 1 else "")
        raise source.error(expected="a time for every depth image", found=found)
    clock = np.array([times[frame] for frame in frames])
    back = np.flatnonzero(np.diff(clock) <= 0)
    if len(back):
        where = f"frame {frames[int(back[0]) + 1]}"
        found = f"{clock[back[0] + 1]:g} s after {clock[back[0]]:g} s"
        raise source.error(expected="increasing times", found=found, where=where)
    return clock


def _rows(
    source: Source, required: tuple[str, ...], optional: tuple[str, ...]
) -> tuple[dict[str, int], Iterator[tuple[int, list[str]]]]:
    """Columns by name, and the lines below the header with their numbers."""
    reader = csv.reader(source.lines)
    try:
        header = [field.strip().lower() for field in next(reader, [])]
    except csv.Error as error:
        raise source.error(expected="comma separated values", found=str(error), where="line 1") from None
    columns = {name: header.index(name) for name in (*required, *optional) if name in header}
    missing = [name for name in required if name not in columns]
    if missing or len(set(header)) != len(header):
        found = f"no {', '.join(missing)}" if missing else "one twice"
        raise source.error(expected=f"a header with {', '.join(required)}", found=found, where="line 1")

    def rows() -> Iterator[tuple[int, list[str]]]:
        try:
            for fields in reader:
                if not fields:
                    continue
                if len(fields) != len(header):
                    raise source.error(
                        expected=f"{len(header)} fields", found=f"{len(fields)}", line=reader.line_num
                    )
                yield reader.line_num, fields
        except csv.Error as error:
            raise source.error(
                expected="comma separated values", found=str(error), line=reader.line_num
            ) from None

    return columns, rows()


def _number(source: Source, line: int, name: str, field: str, low: float, high: float) -> float:
    """The number in a field; NaN for an empty one, where that is allowed."""
    text = field.strip()
    if name in ("u and v", "depth", "time") and (not text or text.lower() == "nan"):
        return float("nan")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if low <= value <= high and "_" not in text:
        return value
    raise _wrong(source, line, name, text, low, high)


def _wrong(source: Source, line: int, name: str, text: str, low: float, high: float) -> CaptureError:
    return source.error(
        expected=f"a number from {low:g} to {high:g} as {name}",
        found=repr(text[:40]) if text else "nothing",
        line=line,
    )

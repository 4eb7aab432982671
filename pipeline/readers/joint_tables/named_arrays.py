"""Archives of numpy with names: positions (frames, joints, 3) and a name for each joint or marker.

Simulators' libraries of human motion are such archives (Isaac Lab: body_positions, body_names). They are laid
out as a table with a header, and read as one. Nothing is unpickled.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.readers.array_files.npz import array_shapes, read_arrays
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import is_rate, says_time, seconds_of
from kinemimic.pipeline.readers.clocks.video_clock import stated_rate
from kinemimic.pipeline.readers.joint_tables import joint_table, marker_csv

FORMAT = Format(
    name="named joint array",
    sensor="unknown",
    holds="positions of joints or markers with names",
    recognised_by="an .npz archive with positions of shape (frames, joints, 3) and as many names",
    binary=True,
)
_FEWEST = len(REQUIRED)
# As text they take ten times as many bytes, and zeros are packed a thousandfold: three hours of 50 joints.
_MOST_NUMBERS = 2**25
# Of several arrays of that shape, places are none of these (MuJoCo's xipos are centres of mass), and rather
# called so.
_NO_PLACES = re.compile(r"vel|acc|rot|euler|angle|angular|force|moment|offset|ipos|mass|com\b", re.IGNORECASE)
_PLACES = re.compile(r"pos|point|joint|marker|coord|xyz|data", re.IGNORECASE)


def recognises(source: Source) -> bool:
    """True if names of legs, or of markers, are as many as an array's joints."""
    return _choice(source) is not None


def read(source: Source) -> Clip:
    """The clip of the joints, as of a table of joints, or of the markers, as of a table of markers.

    Raises CaptureError for a damaged file, and as these do.
    """
    choice = _choice(source)
    assert choice is not None  # noqa: S101 (recognises() holds)
    places, names = choice
    points = _numbers(read_arrays(source, [places])[places], places, source)
    table = _table(names, points, _times(len(points), source), source)
    if marker_csv.recognises(table):
        return marker_csv.read(table)
    if joint_table.recognises(table):
        return joint_table.clip_of_table(table, FORMAT)
    raise source.error(
        expected=f"places of a body's joints in {places}, and a name for each",
        found="others, a name twice, or no joint of the trunk (spine, neck or shoulders)",
        advice="save it as CSV and describe its columns (`kinemimic inspect --suggest` drafts that)",
    )


def _choice(source: Source) -> tuple[str, tuple[str, ...]] | None:
    """The name of the array of places, and the joints' names."""
    shapes = array_shapes(source)
    for name in sorted(name for name, shape in shapes.items() if len(shape) == 1 and shape[0] >= _FEWEST):
        try:
            words = read_arrays(source, [name])[name]
        except CaptureError:
            continue
        if words.dtype.kind not in "US" or not _is_body(joints := tuple(map(_text, words.tolist()))):
            continue
        fitting = [
            places
            for places, shape in sorted(shapes.items())
            if len(shape) == 3
            and 0 < 3 * len(joints) * shape[0] <= _MOST_NUMBERS
            and shape[1:] == (len(joints), 3)
            and not _NO_PLACES.search(places)
        ]
        if fitting:
            return max(fitting, key=lambda places: bool(_PLACES.search(places))), joints
    return None


def _is_body(names: tuple[str, ...]) -> bool:
    return set(REQUIRED) <= joints_by_name(names).keys() or marker_csv.has_pelvis(names)


def _text(word: Any) -> str:
    return word.decode("latin-1") if isinstance(word, bytes) else str(word)


def _numbers(values: NDArray[Any], name: str, source: Source) -> Array:
    if values.dtype.kind not in "fiu":
        raise source.error(expected=f"numbers in {name}", found=f"{values.dtype}")
    return values.astype(np.float64)


def _times(count: int, source: Source) -> Array | None:
    """The archive's times of the frames (T,), or seconds at its rate; None if it has neither."""
    shapes = array_shapes(source)
    clock = next((name for name in sorted(shapes) if says_time(name) and shapes[name] == (count,)), None)
    if clock is not None:
        values = _numbers(read_arrays(source, [clock])[clock], clock, source)
        seconds, kept, *_ = seconds_of(values, clock, source, lambda row: f"frame {row}")
        return seconds - seconds[0] if kept.all() else values
    rate = next((name for name in sorted(shapes) if is_rate(name) and shapes[name] in ((), (1,))), None)
    if rate is None:
        return None
    stated = stated_rate(rate, read_arrays(source, [rate])[rate].reshape(-1)[0].item(), source)
    return np.arange(count) / stated.hertz


def _table(names: tuple[str, ...], points: Array, times: Array | None, source: Source) -> Source:
    """The text of a table with a column for each axis of each joint."""
    rows = points.reshape(len(points), -1)
    header = [f'"{name}_{axis}"' for name in names for axis in "xyz"]
    if times is not None:
        rows, header = np.column_stack([times, rows]), ["time", *header]
    lines = (",".join(f"{value:.12g}" for value in row.tolist()) for row in rows)
    return source.with_text("\n".join([",".join(header), *lines]) + "\n")

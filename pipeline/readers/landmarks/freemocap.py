"""FreeMoCap: MediaPipe's landmarks triangulated from several cameras, in a recording's folder.

The folder holds output_data/ with body_3d_xyz.csv (most versions put the tracker in front:
mediapipe_body_3d_xyz.csv): a column for each coordinate of each of the 33 landmarks, "body_nose_x" or
"nose_x", and a row per frame, in millimetres, Z up once the recording is aligned with the ground. FreeMoCap
writes no times there, frames are those of the videos; a column of times, or of frame numbers, that somebody
added is read. Either the folder or the table may be passed. Without a table, the folder's array is read; the
tables and arrays of other trackers are joint tables and joint arrays.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns, require_columns
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import says_time
from kinemimic.pipeline.readers.clocks.video_clock import times_of_frames
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, LEGS, clip_of_landmarks, leg_length

FORMAT = Format(
    name="FreeMoCap",
    sensor="several videos, through FreeMoCap",
    holds="positions of 33 landmarks",
    recognised_by="a header body_nose_x, or nose_x in millimetres, with x, y and z of all landmarks, and no "
    "visibility; or a folder with output_data/",
    width_in_header=True,
)
UNIT = "mm"
OUTPUT_FOLDER = "output_data"
# The body by file name, best first; the last is of the first versions.
_BODIES = (
    "body_3d_xyz.csv", "*_body_3d_xyz.csv", "*_body_3d_xyz.npy", "mediaPipeSkel_3d_body_hands_face.npy",
)  # fmt: skip
_PREFIX = "body_"
# A leg in metres is shorter, one in millimetres longer, and an unprefixed table in metres is MediaPipe's.
_LONG_LEG = 10.0
# Where such legs are looked for: people may come into view late.
_SEARCHED, _ROWS = 2**22, 16


def is_freemocap(path: Path) -> bool:
    """True for a recording's folder, or its output_data."""
    return path.is_dir() and (path.name == OUTPUT_FOLDER or (path / OUTPUT_FOLDER).is_dir())


def body_table(folder: Path) -> Path:
    """The table or array of the body in a recording's folder; CaptureError if there is none."""
    inner = folder if folder.name == OUTPUT_FOLDER else folder / OUTPUT_FOLDER
    found = next((path for name in _BODIES for path in sorted(inner.glob(name)) if path.is_file()), None)
    if found is None:
        raise CaptureError(
            folder,
            expected=f"{OUTPUT_FOLDER}/{_BODIES[0]}, the body of a FreeMoCap recording",
            found="no such file",
            advice="let FreeMoCap process the recording first",
        )
    return found


def recognises(source: Source) -> bool:
    """True if the first line names the coordinates of most landmarks and little else, with FreeMoCap's prefix
    or above a body in millimetres."""
    names = _names(source)
    there = set(names)
    wanted = _coordinates()
    found = sum(name in there for name in wanted)
    if found <= 0.8 * len(wanted) or len(names) > found + 6:
        return False
    return _PREFIX in source.head[0].lower() or _has_long_legs(source, names)


def read(source: Source) -> Clip:
    """The clip of the nodes that the landmarks give; without times, at 30 Hz.

    Raises CaptureError for a damaged header or table, and coordinates outside any room.
    """
    names, line = _names(source), source.blank_lines + 1
    index = index_of_columns(names, source, line)
    columns = require_columns(index, _coordinates(), source, line, expected="x, y and z of the 33 landmarks")
    table = parse_sparse_table(
        source,
        start=line,
        width=len(names),
        separator=",",
        keep_empty_rows=not any(map(says_time, names)),
    )
    unit = source.unit or UNIT
    points = table.values[:, columns].reshape(-1, len(LANDMARKS), 3) * UNITS[unit]
    for leg in LEGS:
        if not np.isfinite(points[:, LANDMARKS.index(leg)]).all(axis=-1).any():
            raise source.error(
                expected="hips, knees and ankles", found=f"no {leg.replace('_', ' ')} in any frame"
            )
    refuse_remote(points, LANDMARKS, source, table.where, unit=unit)
    beside = {name: table.values[:, column] for name, column in index.items() if column not in columns}
    times = times_of_frames(len(points), beside, source, table.where)
    return clip_of_landmarks(
        points[times.kept],
        None,
        times.seconds,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the format's",
            defects=[*times.defects, *zero_frames(points[times.kept])],
            notes=[times.note],
            columns=len(names),
        ),
        world_from_file=IDENTITY,
    )


def _names(source: Source) -> list[str]:
    """The names in the first line, without the prefix of newer versions."""
    return [name.strip().strip('"').lower().removeprefix(_PREFIX) for name in source.head[0].split(",")]


def _coordinates() -> list[str]:
    return [f"{landmark}_{axis}" for landmark in LANDMARKS for axis in "xyz"]


def _has_long_legs(source: Source, names: list[str]) -> bool:
    """Whether thigh and shank are too long for metres in the first rows that show both legs."""
    # A coordinate that has no column is the NaN at the end.
    columns = [names.index(name) if name in names else len(names) for name in _coordinates()]
    rows = source.text[:_SEARCHED].split("\n")[source.blank_lines + 1 :]
    cells = (row.split(",") for row in rows)
    # A number that a cell lacks, or that is damaged, is NaN.
    values = ([*(_number(cell) for cell in row), np.nan] for row in cells if len(row) == len(names))
    points = (np.array(row)[columns].reshape(len(LANDMARKS), 3) for row in values)
    seen = list(islice((frame for frame in points if leg_length(frame[None]) > 0.0), _ROWS))
    return bool(seen) and leg_length(np.array(seen)) >= _LONG_LEG


def _number(cell: str) -> float:
    value = to_number(cell)
    return np.nan if value is None else value

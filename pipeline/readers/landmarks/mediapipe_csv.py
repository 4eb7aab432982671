"""MediaPipe's 33 pose landmarks as a table. There is no official layout; programs write two.

Either one row per frame, with a column for each number of each landmark: "landmark_0_x", "L0_x", "x0" or
"left_knee_x", with visibility and presence. Or the landmark's number in the row:
"Frame,Time (ms),Landmark,X,Y,Z,Visibility", with one row per landmark, or with all landmarks of a frame one
after the other under the header of the first. A frame without a person has empty cells. Only landmarks in
metres are a capture (blaze_pose.py).
"""

from __future__ import annotations

import re

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.video_clock import times_of_frames
from kinemimic.pipeline.readers.landmarks.blaze_pose import (
    LANDMARKS,
    LEGS,
    NUMBER,
    clip_of_landmarks,
    path_of_landmarks,
)
from kinemimic.pipeline.readers.landmarks.landmark_columns import landmark_columns, mark_column, names_pelvis
from kinemimic.pipeline.readers.landmarks.landmark_table import table_of_frames, table_of_landmarks
from kinemimic.pipeline.readers.landmarks.one_person import rows_of_one_person

FORMAT = Format(
    name="MediaPipe landmarks CSV",
    sensor="a video, through MediaPipe",
    holds="positions of 33 landmarks in metres, their visibility",
    recognised_by="a header with x, y, z of numbered or named landmarks, or a column Landmark",
    width_in_header=True,
)
_SEPARATORS = (",", ";", "\t")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def recognises(source: Source) -> bool:
    """True if the first line names x, y and z of most landmarks of the legs, or has a column Landmark.

    A table of half of the landmarks and a pelvis is of another sensor.
    """
    names = _names(source)
    if mark_column(names) is not None:
        return True
    found = set(landmark_columns(names).values())
    if sum((NUMBER[leg], field) in found for leg in LEGS for field in "xyz") <= 1.5 * len(LEGS):
        return False
    return len({number for number, _ in found}) > 0.5 * len(LANDMARKS) or not names_pelvis(names)


def read(source: Source) -> Clip:
    """The clip of the nodes that the landmarks give, of the person seen in most rows; without times and frame
    numbers, at 30 Hz.

    Raises CaptureError for image landmarks, missing legs, and a damaged header or table.
    """
    names, line = _names(source), source.blank_lines + 1
    index_of_columns(names, source, line)
    mark, separator = mark_column(names), _separator(source)
    if mark is None:
        content = table_of_frames(names, line, separator, source)
    else:
        content = table_of_landmarks(names, mark, line, separator, source)
    rows, others = rows_of_one_person(content.beside, content.values[..., :3])
    values = content.values[rows]
    points = values[..., :3]

    def where(row: int) -> str:
        return f"line {content.line(int(rows[row]))}"

    for leg in LEGS:
        if not np.isfinite(points[:, NUMBER[leg]]).all(axis=-1).any():
            raise source.error(expected="hips, knees and ankles", found=f"no {leg.replace('_', ' ')}")
    beside = {name: numbers[rows] for name, numbers in content.beside.items()}
    times = times_of_frames(len(rows), beside, source, where)
    path = path_of_landmarks(points, source)
    refuse_remote(points, LANDMARKS, source, where)
    return clip_of_landmarks(
        points[times.kept],
        values[times.kept, :, 3:].min(axis=-1),
        times.seconds,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*times.defects, *others],
            notes=[times.note, path],
            columns=content.columns,
        ),
    )


def _separator(source: Source) -> str:
    return max(_SEPARATORS, key=source.head[0].count)


def _names(source: Source) -> list[str]:
    """The names in the first line, in lower case, with words apart: "leftKneeX" is left_knee_x."""
    names = (name.strip().strip('"') for name in source.head[0].split(_separator(source)))
    return [_HUMP.sub("_", name).lower() for name in names]

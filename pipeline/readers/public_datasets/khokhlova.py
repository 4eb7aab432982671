"""Khokhlova's gait recordings of a Kinect v2: positions and orientations, 202 numbers per line.

M. Khokhlova, C. Migniot, A. Dipanda, "3D point cloud descriptor for posture recognition", and the gait pilot
studies after it. Separated by white space: index, milliseconds since the start, then 25 times state, X, Y, Z,
qx, qy, qz, qw in the SDK's order; metres in camera space, absolute orientations. While nobody is seen, the
line holds zeros, mostly too few. The recorder polled the sensor at about 60 Hz: more than every second line
repeats the pose before bit for bit, which noise never does.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.kinect_values import (
    begins_with_rows,
    check_quaternions,
    check_states,
    sensor_clock,
)

FORMAT = Format(
    name="Khokhlova positions and quaternions",
    sensor="Kinect v2",
    holds="times, positions, states and orientations of 25 joints",
    recognised_by="lines of 202 numbers: index, ms, then state, position and unit quaternion of 25 joints",
    columns=(177, 202),
)
_JOINT_WIDTH = 8
_WIDTH = 2 + _JOINT_WIDTH * len(SDK_JOINTS)
# A line without a person has no states.
_EMPTY_WIDTH = _WIDTH - len(SDK_JOINTS)


def recognises(source: Source) -> bool:
    """True if the first lines are an integer index and ms, then a pose or (some) zeros."""
    return begins_with_rows(source, None, _is_line)


def read(source: Source) -> Clip:
    """The clip of the 25 joints with rotations: one frame per line with a person and a new pose."""
    table = parse_table(source, width=_WIDTH, drop_other_widths=True)
    rows = table.values
    present = rows[:, 2:].any(axis=1)
    if not present.any():
        raise source.error(expected="a person", found="zeros in every line")
    # If all are present, a view instead of a copy.
    lines = np.arange(len(rows)) if present.all() else np.flatnonzero(present)
    rows = rows if present.all() else rows[present]

    def where(row: int) -> str:
        return table.where(int(lines[row]))

    times = rows[:, 1] / 1000.0
    frames = rows[:, 2:].reshape(len(rows), len(SDK_JOINTS), _JOINT_WIDTH)
    check_states(frames[..., 0], SDK_JOINTS, where, source)
    refuse_remote(frames[..., 1:4], SDK_JOINTS, source, where)
    check_quaternions(frames[..., 4:], SDK_JOINTS, where, source)
    is_new = np.concatenate([[True], (rows[1:, 2:] != rows[:-1, 2:]).any(axis=1)])
    indices = np.flatnonzero(is_new)
    is_new[indices], defects = sensor_clock(times[indices], lambda row: where(int(indices[row])), source)
    kept = frames if is_new.all() else frames[is_new]
    skeleton = kinect_v2_skeleton()
    return clip_of_points(
        skeleton,
        times[is_new],
        kept[:, FROM_SDK, 1:4],
        kept[:, FROM_SDK, 0].astype(np.uint8),
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=_defects(table.dropped + int((~present).sum()), int((~is_new).sum()), len(rows), defects),
            columns=_WIDTH,
        ),
        rotations=child_to_parent(kept[:, FROM_SDK, 4:], skeleton, Y_UP_TO_Z_UP),
    )


def _defects(empty: int, repeated: int, lines: int, of_clock: list[Defect]) -> list[Defect]:
    """Defects of the dropped lines: without a whole person, or polled before the sensor had a new frame;
    of_clock: the defects of the other lines' times."""
    found: list[Defect] = []
    if empty:
        text = f"{empty} lines without a whole person (zeros or too few numbers), dropped"
        found.append(Defect("zero_frames", empty, "frames", "repaired", text))
    clock_defects = [defect for defect in of_clock if defect.action == "flagged"]
    found += clock_defects
    if repeated := repeated - sum(defect.count for defect in clock_defects):
        text = f"{repeated} of {lines} lines repeat a pose or a time: polled faster than the sensor, dropped"
        found.append(Defect("duplicate_frames", repeated, "frames", "repaired", text))
    return found


def _is_line(row: list[float]) -> bool:
    if not (_EMPTY_WIDTH <= len(row) <= _WIDTH and row[0].is_integer() and row[1].is_integer()):
        return False
    return _is_pose(row[2:]) if len(row) == _WIDTH else row.count(0.0) >= _EMPTY_WIDTH // 2


def _is_pose(values: list[float]) -> bool:
    joints = [values[k : k + _JOINT_WIDTH] for k in range(0, len(values), _JOINT_WIDTH)]
    return all(joint[0] in (0.0, 1.0, 2.0) for joint in joints) and all(
        norm == 0.0 or abs(norm - 1.0) < 0.05
        for norm in (sum(part * part for part in joint[4:]) for joint in joints)
    )

"""Nuitrack's CSV recorder, from its documented layout ("CSV Recorder", github.com/3DiVi/nuitrack-sdk).

A row is one user in one frame: timestamp (µs), serial of the sensor, id of the user, and JOINT_WAIST.x, .y,
.z of every joint in metres, after some of them the angle between two bones (JOINT_LEFT_KNEE.rot), which is
not read. X points to the sensor's right, Y up, Z away from it. Not tested on a recording.
"""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.column_names import index_of_columns, require_columns
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table
from kinemimic.pipeline.readers.base.people import found_again, other_people
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import seconds_of

FORMAT = Format(
    name="Nuitrack CSV",
    sensor="depth camera, through Nuitrack",
    holds="times and positions of 19 joints, any number of users",
    recognised_by="a header with timestamp, id and columns JOINT_WAIST.x …",
    width_in_header=True,
)
_CLOCK, _USER, _SERIAL = "timestamp", "id", "serial"
# The whole name of a column: keys of JSON may begin like it.
_COLUMN = re.compile(r"joint_[a-z_]+\.(x|y|z|rot)")
# Node -> the joint.
JOINTS: dict[str, str] = {
    "hip_center": "WAIST", "spine": "TORSO", "shoulder_center": "NECK", "head": "HEAD",
    **{
        f"{joint}_{side}": f"{side}_{joint}".upper()
        for side in ("left", "right")
        for joint in ("shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle")
    },
}  # fmt: skip


def recognises(source: Source) -> bool:
    """True if the first line names the clock and Nuitrack's joints."""
    names = set(_names(source))
    joints = sum(_COLUMN.fullmatch(name) is not None for name in names)
    return {_CLOCK, "joint_waist.x"} <= names or joints > 30


def read(source: Source) -> Clip:
    """The clip of the user seen in most rows; other users are dropped and counted.

    Raises CaptureError for a damaged header or table.
    """
    names, line = _names(source), source.blank_lines + 1
    index = index_of_columns(names, source, line)
    nodes = tuple(node for node in NODES if node in JOINTS)
    wanted = [
        _CLOCK, _USER, *(f"joint_{JOINTS[node].lower()}.{axis}" for node in nodes for axis in "xyz"),
    ]  # fmt: skip
    columns = require_columns(index, wanted, source, line, expected="Nuitrack's joints")
    table = parse_sparse_table(
        _without_serial(source, names, line), start=line, width=len(names), separator=_separator(source)
    )
    values = table.values[:, columns]
    clock, users = values[:, 0], values[:, 1]
    wrong = ~(np.abs(users) < 1e9)  # NaN too
    if wrong.any():
        row = int(np.argmax(wrong))
        raise source.error(expected="a number as id", found=f"{users[row]:g}", line=table.line(row))
    found = found_again(clock, users.astype(np.int64), values[:, 2:].reshape(len(values), len(nodes), 3))
    main = Counter(found.people[found.kept].tolist()).most_common(1)[0][0]
    rows = np.flatnonzero(found.kept & (found.people == main))
    times, later, defects, _ = seconds_of(
        clock[rows], f"{_CLOCK} (us)", source, lambda row: f"line {table.line(int(rows[row]))}"
    )
    points = values[rows, 2:].reshape(len(rows), len(nodes), 3)
    refuse_remote(
        points,
        [JOINTS[node] for node in nodes],
        source,
        lambda row: table.where(int(rows[row])),
        any_unit=True,
    )
    seen: dict[float, set[int]] = {}
    for time, user in zip(clock.tolist(), found.people.tolist(), strict=True):
        seen.setdefault(time, set()).add(user)
    return clip_of_points(
        skeleton_of(nodes),
        times,
        # With X to the right, the axes are left-handed; a Kinect's X points to the left.
        points[later] * np.array([-1.0, 1.0, 1.0]),
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*defects, *found.defects(), *other_people(list(seen.values()), main)],
            columns=len(names),
        ),
    )


def _separator(source: Source) -> str:
    return max(",;\t", key=source.head[0].count)


def _names(source: Source) -> list[str]:
    """The names in the first line, in lower case; that of an index column is empty in pandas' files."""
    names = [name.strip().strip('"').lower() for name in source.head[0].split(_separator(source))]
    return ["index", *names[1:]] if names[0] == "" else names


def _without_serial(source: Source, names: list[str], line: int) -> Source:
    """The table with zeros for the sensor's serial, which is a word."""
    if _SERIAL not in names:
        return source
    separator, column = _separator(source), names.index(_SERIAL)
    rows = []
    for text in source.lines[line:]:
        cells = text.split(separator)
        if len(cells) > column and text.strip():
            cells[column] = "0"
        rows.append(separator.join(cells))
    return source.with_text("\n".join([*source.lines[:line], *rows]))

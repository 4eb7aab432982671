"""Joints that JSON lists without names: their names beside the frames, or the body that they make.

Programs that lift videos or triangulate them write such lists (MMPose, EasyMocap, OpenPose): of three or four
numbers for each joint, or of all numbers in a row.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.readers.landmarks.joint_sets import COUNTS, FIELDS_OF_ROW, joint_set_of
from kinemimic.pipeline.readers.landmarks.unnamed_joints import is_flat

# Columns as `joint_json` names them: "people.keypoints.12.x", "12.score"; or "pose_keypoints_3d.37".
_OF_JOINT = re.compile(r"(?P<list>(?:.*\.)?)(?P<number>\d{1,4})\.(?P<field>\w+)")
_IN_ROW = re.compile(r"(?P<list>(?:.*\.)?)(?P<number>\d{1,4})")
_SURE = ("w", "visibility", "score", "confidence", "conf", "presence", "v", "c")
# Objects around the list of names.
_DEPTH = 4

Row = Mapping[str, Any]


class Listed(NamedTuple):
    """points: (R, J, 3), NaN where a row lacks a joint; visibility: (R, J, 1 or 0); columns: theirs."""

    points: Array
    visibility: Array
    columns: frozenset[str]


def joint_names(value: Any, depth: int = _DEPTH) -> list[str] | None:
    """The joints' names in a document, as a list or by their numbers; None where it does not name legs."""
    if depth == 0 or not value or not isinstance(value, dict | list):
        return None
    names = list(value.values() if isinstance(value, dict) else value)
    if all(isinstance(name, str) for name in names):
        in_order = isinstance(value, list) or all(f"{k}" == key for k, key in enumerate(value))
        return names if in_order and joints_by_name(tuple(names)).keys() >= set(REQUIRED) else None
    inner: Iterable[Any] = names if isinstance(value, dict) else names[:1]
    return next((found for one in inner if (found := joint_names(one, depth - 1))), None)


def with_names(rows: Sequence[Row], names: Sequence[str]) -> list[dict[str, Any]]:
    """The rows with names in the place of numbers, in lists of as many joints."""
    renamed = {
        f"{name}{number}.{field}": f"{name}{names[number]}.{field}"
        for name, fields in _lists(_columns(rows)).items()
        if {number for number, _ in fields} == set(range(len(names)))
        for number, field in fields
    }
    return [{renamed.get(column, column): cell for column, cell in row.items()} for row in rows]


def listed_joints(rows: Sequence[Row]) -> Listed | None:
    """The first list whose joints make a body, else the first of places in a picture; None without one."""
    found = [one for columns in _tables(_columns(rows)) if (one := _values(rows, columns)) is not None]
    flat = [one for one in found if one.points.any() and is_flat(one.points)]
    bodies = (one for one in found if not is_flat(one.points) and joint_set_of(one.points) is not None)
    return next(bodies, flat[0] if flat else None)


def _columns(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(column for row in rows for column in row))


def _lists(columns: Sequence[str]) -> dict[str, list[tuple[int, str]]]:
    """Name of a list -> the number and the field of each of its columns."""
    lists: dict[str, list[tuple[int, str]]] = {}
    for match in filter(None, map(_OF_JOINT.fullmatch, columns)):
        lists.setdefault(match["list"], []).append((int(match["number"]), match["field"]))
    return lists


def _tables(columns: Sequence[str]) -> Iterator[list[list[str]]]:
    """The columns of each joint, of every list of as many joints as a known set."""
    for name, fields in _lists(columns).items():
        joints = 1 + max(number for number, _ in fields)
        given = {field for _, field in fields}
        sure = next((field for field in _SURE if field in given), None)
        if joints in COUNTS and set("xyz") <= given:
            yield [[f"{name}{k}.{field}" for field in ("x", "y", "z", sure) if field] for k in range(joints)]
    rows: dict[str, int] = {}
    for match in filter(None, map(_IN_ROW.fullmatch, columns)):
        rows[match["list"]] = max(rows.get(match["list"], 0), 1 + int(match["number"]))
    for name, width in rows.items():
        step = FIELDS_OF_ROW.get(width)
        if step is not None:
            yield [[f"{name}{k + axis}" for axis in range(step)] for k in range(0, width, step)]


def _values(rows: Sequence[Row], joints: Sequence[Sequence[str]]) -> Listed | None:
    """The numbers in these columns of each joint; None for words, and for numbers beyond any float."""
    columns = [column for joint in joints for column in joint]
    cells = [[row.get(column, np.nan) for column in columns] for row in rows]
    if any(isinstance(cell, str) for line in cells for cell in line):
        return None
    try:
        values = np.array(cells, dtype=np.float64).reshape(len(rows), len(joints), -1)
    except OverflowError:  # JSON has integers of any size
        return None
    return Listed(values[..., :3], values[..., 3:], frozenset(columns))

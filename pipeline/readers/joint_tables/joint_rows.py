"""Tables of joints without names, a frame in each row: what saving a joint array as text gives.

Without a header, or with numbers in it ("0", "x12"), and perhaps times or frame numbers in front. The joints
are those of the set in which they make a body, as of joint arrays; sensors' orders, whose tables may hold
other columns too, are joint tables.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.description import Text
from kinemimic.pipeline.readers.custom_table.suggest_body import time_unit
from kinemimic.pipeline.readers.custom_table.suggest_names import joints_of_header
from kinemimic.pipeline.readers.custom_table.suggest_orders import ORDERS
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet, sheet_of
from kinemimic.pipeline.readers.custom_table.table import Cells
from kinemimic.pipeline.readers.landmarks.joint_sets import (
    AZURE_KINECT,
    COUNTS,
    FIELDS_OF_ROW,
    KINECT_V1,
    KINECT_V2,
    joint_set_of,
)
from kinemimic.pipeline.readers.landmarks.one_person import rows_of_one_person
from kinemimic.pipeline.readers.landmarks.unnamed_joints import clip_of_unnamed, is_flat

FORMAT = Format(
    name="joint rows",
    sensor="unknown, often a video",
    holds=f"positions of {', '.join(map(str, sorted(COUNTS)[:-1]))} or {max(COUNTS)} joints",
    recognised_by="rows of three or four numbers for each joint, without names, that make a body",
)
_ORDERED = frozenset(map(len, ORDERS.values()))
# Columns in front of the joints: an index, a time.
_MOST_BEFORE = 2


class _Columns(NamedTuple):
    """joints: (J, 3 or 4) columns of each joint; beside: column -> what it is called."""

    joints: list[tuple[int, ...]]
    beside: dict[int, str]


def recognises(source: Source) -> bool:
    """True if the first rows make a body in a known order that is no sensor's, or are as many places in a
    picture, which is said when they are read."""
    return _columns(source) is not None


def read(source: Source) -> Clip:
    """The clip of the nodes that the joints give; CaptureError for damaged rows."""
    found = _columns(source)
    assert found is not None  # noqa: S101 (recognises() holds)
    sheet, columns = found
    text = Text(
        separator=sheet.separator,
        decimal=sheet.decimal,
        header=sheet.header,
        first_row=sheet.first,
        comment=sheet.comment,
    )
    wanted = sorted({column for joint in columns.joints for column in joint} | columns.beside.keys())
    table, _ = Cells(source, text, "the table").read(wanted, [])
    values = np.full((len(table), sheet.width), np.nan)
    values[:, wanted] = table
    numbers = values[:, columns.joints]
    beside = {name: values[:, column] for column, name in columns.beside.items()}
    own, people = rows_of_one_person(beside, numbers[..., :3])
    return clip_of_unnamed(
        numbers[own, :, :3],
        numbers[own, :, 3:],
        source,
        format=FORMAT,
        beside={name: given[own] for name, given in beside.items()},
        rate=None,
        defects=people,
    )


def _columns(source: Source) -> tuple[Sheet, _Columns] | None:
    try:
        sheet = _below_numbers(sheet_of(source))
    except CaptureError:
        return None
    if all(name.isdecimal() or not name for name in sheet.names):
        choices = [_in_row(sheet, first) for first in range(_MOST_BEFORE + 1)]
    else:
        choices = [_numbered(sheet)]
    return next(((sheet, one) for one in choices if one is not None and _is_body(sheet, one)), None)


def _below_numbers(sheet: Sheet) -> Sheet:
    """The table without the numbers of its columns that pandas writes above them."""
    above = sheet.values[0][np.isfinite(sheet.values[0])]
    if sheet.names or len(above) < sheet.width - 1 or not np.array_equal(above, np.arange(len(above))):
        return sheet
    return replace(sheet, first=sheet.first + 1, values=sheet.values[1:])


def _in_row(sheet: Sheet, first: int) -> _Columns | None:
    """The joints one after the other from a column on; those before it only increase."""
    fields = FIELDS_OF_ROW.get(sheet.width - first)
    if fields is None or sheet.words:
        return None
    beside = {}
    for column in range(first):
        values = sheet.values[:, column]
        if not (np.diff(values) >= 0.0).all():
            return None
        unit = time_unit(values, "")
        beside[column] = "frame" if unit is None or unit[0] == "frame" else "time"
    joints = [tuple(range(k, k + fields)) for k in range(first, sheet.width, fields)]
    return _Columns(joints, beside)


def _numbered(sheet: Sheet) -> _Columns | None:
    """The joints that the header numbers, in its order."""
    named = {name: one for name, one in joints_of_header(sheet.names).items() if one.position}
    if len(named) not in COUNTS or joints_by_name(tuple(named)):
        return None
    sure = all(one.state for one in named.values())
    joints = [(*one.position, *(one.state if sure else ())) for one in named.values()]
    taken = {column for joint in joints for column in joint} | sheet.words.keys()
    return _Columns(joints, {k: name for k, name in enumerate(sheet.names) if k not in taken})


def _is_body(sheet: Sheet, columns: _Columns) -> bool:
    points: Array = sheet.values[:, [joint[:3] for joint in columns.joints]]
    if is_flat(points):
        return len(columns.joints) not in _ORDERED
    joint_set = joint_set_of(points)
    return joint_set is not None and joint_set not in (KINECT_V1, KINECT_V2, AZURE_KINECT)

"""A description of your own columns, read from a small TOML file: docs/describe-your-columns.md.

Errors are one line that names the key. The result names the columns of each joint, so that the reader
(custom_table.py) needs no patterns and steps.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct

from kinemimic.pipeline.files.validation.records import RecordError, convert
from kinemimic.pipeline.files.validation.toml_file import parse_toml
from kinemimic.pipeline.kinematics.rotations import ORDERS
from kinemimic.pipeline.readers.custom_table.description import (
    MAX_COLUMNS,
    QUATERNIONS,
    Clock,
    Column,
    Description,
    Joint,
    Space,
    States,
    Text,
    Turns,
)

# The first key of a description, because the folder may contain other TOML files too.
SCHEMA_KEY = "kinemimic"
_MAX_JOINTS = 500
_PARTS = ("position", "quaternion", "euler", "state")  # quantities for which a joint can have columns

_Three = Annotated[tuple[Column, Column, Column], Meta(description="a list of 3 columns")]
_Four = Annotated[tuple[Column, Column, Column, Column], Meta(description="a list of 4 columns")]
_Length = Annotated[float, Meta(ge=-1e6, le=1e6)]


class _Parts(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    position: _Three | None = None
    quaternion: _Four | None = None
    euler: _Three | None = None
    state: Column | None = None

    def columns(self, part: str) -> tuple[Column, ...]:
        """The columns of a part; empty if it has none."""
        found: tuple[Column, ...] | Column | None = getattr(self, part)
        return () if found is None else found if isinstance(found, tuple) else (found,)


class _Columns(_Parts, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Columns of every joint: {joint} stands for its name, `step` counts columns from one to the next."""

    step: Annotated[int, Meta(ge=1, le=MAX_COLUMNS)] | None = None
    joint: Column | None = None
    frame: Column | None = None


class _Joint(_Parts, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The keys of a joint that override those of all joints."""

    name: str | None = None
    offset: tuple[_Length, _Length, _Length] | None = None
    parent: str | None = None


_NameOrJoint = Annotated[str | _Joint, Meta(description="the joint's name in the file, or a table")]
_Names = Annotated[tuple[str, ...] | dict[str, _NameOrJoint], Meta(description="a list or a table of joints")]


class File(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All keys of a description."""

    kinemimic: Annotated[Literal[1], Meta(description="1, the version of this description")]
    files: tuple[Annotated[str, Meta(description='a pattern such as "*.csv"')], ...] = ()
    table: Text = Text()
    columns: _Columns = _Columns()
    time: Clock
    space: Space = Space()
    rotations: Turns | None = None
    states: States = States()
    joints: _Names


def parse(path: Path, content: str) -> Description:
    """The description in a TOML file's text; CaptureError names the first mistake's key."""
    values = parse_toml(path, content)
    values.setdefault("time", {})  # whose keys are missed by name
    file = convert(values, File, path)
    try:
        joints = _joints(file)
        _check_rotations(file.rotations, joints)
    except RecordError as error:
        raise error.of_file(path) from None
    return Description(
        path=path,
        text=file.table,
        clock=file.time,
        space=file.space,
        turns=file.rotations or Turns(),
        states=file.states,
        joints=joints,
        joint_column=file.columns.joint,
        frame_column=file.columns.frame,
        files=file.files,
    )


def _joints(file: File) -> tuple[Joint, ...]:
    named = file.joints if isinstance(file.joints, dict) else dict.fromkeys(file.joints, "")
    if len(named) != len(file.joints):
        raise RecordError("joints", expected="names in quotes, each once", found=repr(list(file.joints)))
    if not 1 <= len(named) <= _MAX_JOINTS:
        raise RecordError("joints", expected=f"1 to {_MAX_JOINTS} joints", found=f"{len(named)}")
    shared, long = file.columns, file.table.rows == "joint"
    for key in ("joint", "frame"):
        if getattr(shared, key) is not None and not long:
            expected = 'table.rows = "joint" with this key'
            raise RecordError("columns", key, expected=expected, found='rows = "frame"')
    for part in _PARTS:
        _check_names(("columns", part), shared.columns(part), file.table)
        if len(named) > 1 and not long:
            _check_apart(part, shared.columns(part), shared.step)
    joints = []
    for index, (name, value) in enumerate(named.items()):
        own = value if isinstance(value, _Joint) else _Joint(name=value or None)
        called = name if own.name is None else own.name
        columns = {
            part: own.columns(part) or _placed(shared.columns(part), called, index * (shared.step or 0))
            for part in _PARTS
        }
        for part in _PARTS:
            _check_names(("joints", name, part), own.columns(part), file.table)
        if own.parent is not None and (own.parent == name or own.parent not in ("", *named)):
            expected = "the name of another joint"
            raise RecordError("joints", name, "parent", expected=expected, found=repr(own.parent))
        if not (columns["position"] or own.offset or own.parent == ""):
            expected = "columns of its position, or an offset"
            raise RecordError("joints", name, "position", expected=expected, found="none")
        joints.append(Joint(name, called, offset=own.offset, parent=own.parent, **columns))
    return tuple(joints)


def _placed(columns: tuple[Column, ...], called: str, further: int) -> tuple[Column, ...]:
    """One joint's columns: its name in the pattern, or an offset from the first joint's columns."""
    return tuple(
        column.replace("{joint}", called) if isinstance(column, str) else column + further
        for column in columns
    )


def _check_names(key: tuple[str, ...], columns: tuple[Column, ...], text: Text) -> None:
    if text.header == 0 and any(isinstance(column, str) for column in columns):
        expected = "column numbers, as the table has no header"
        advice = "give the line with the names as table.header"
        raise RecordError(*key, expected=expected, found=repr(list(columns)), advice=advice)


def _check_apart(part: str, columns: tuple[Column, ...], step: int | None) -> None:
    """Joints that share columns of one row would all stand in one place."""
    for column in columns:
        if isinstance(column, str) and "{joint}" not in column:
            expected = "{joint} in the name, in place of the name of each joint"
            raise RecordError("columns", part, expected=expected, found=repr(column))
        if isinstance(column, int) and not step:
            expected = "the number of columns from one joint to the next"
            raise RecordError("columns", "step", expected=expected, found=f"none beside {part}")


def _check_rotations(turns: Turns | None, joints: tuple[Joint, ...]) -> None:
    euler, quaternion = (any(getattr(joint, part) for joint in joints) for part in ("euler", "quaternion"))
    order = turns.order if turns else ""
    expected, found = "", repr(order) if order else "none"
    if euler and quaternion:
        expected, found = "quaternions or Euler angles", "columns of both"
    elif euler and order not in ORDERS:
        expected = 'the intrinsic order of the Euler angles, such as "ZXY"'
    elif turns and not (euler or quaternion):
        expected, found = "columns.quaternion or columns.euler with this table", "none"
    elif quaternion and order not in ("", *QUATERNIONS):
        expected = f"one of {', '.join(QUATERNIONS)}"
    if expected:
        raise RecordError("rotations", "order", expected=expected, found=found)

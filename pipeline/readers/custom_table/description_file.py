"""A description of one's own columns, read from a small TOML file: docs/describe-your-columns.md.

Every mistake in it is one line that names the key. What comes out names the columns of each joint, so that
the reader (described.py) needs to know nothing of patterns and steps.
"""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.toml_keys import MAX_COLUMNS, Column, Keys, parse_toml
from kinemimic.pipeline.kinematics.rotations import ORDERS
from kinemimic.pipeline.quality.rules.length_units import UNITS
from kinemimic.pipeline.readers.custom_table.description import (
    Clock,
    Description,
    Joint,
    Space,
    States,
    Text,
    Turns,
)

SCHEMA = 1
# The first key of a description: other TOML files lie beside captures too.
SCHEMA_KEY = "kinemimic"
SEPARATORS: dict[str, str | None] = {
    "auto": None,
    "space": r"\s+",
    "tab": "\t",
    "comma": ",",
    "semicolon": ";",
}
SECONDS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "100ns": 1e-7, "frame": 1.0}
LENGTHS: dict[str, float] = {name: UNITS[name] for name in ("m", "cm", "mm", "inch")}
_AXES = "XYZ"
# Python's codecs of single names, and one that always fails; none is of a file, and the first two take hours.
_NO_ENCODINGS = ("punycode", "idna", "undefined")
_MAX_LINES = 10_000
_MAX_JOINTS = 500
# What a joint has columns of, and how many.
_PARTS = {"position": 3, "quaternion": 4, "euler": 3, "state": 1}


def parse(path: Path, content: str) -> Description:
    """The description in a TOML file's text; CaptureError names the first mistake's key."""
    values = parse_toml(path, content)
    keys = Keys(path, "", values)
    if keys.get(SCHEMA_KEY) != SCHEMA:
        keys.fail(
            SCHEMA_KEY, expected=f"{SCHEMA}, the version of this description", found=values.get(SCHEMA_KEY)
        )
    tables = {key: keys.table(key) for key in ("table", "columns", "time", "space", "rotations", "states")}
    listed, files = keys.get("joints"), keys.marks("files")
    # Misspelt tables first: everything else would be found wanting because of them.
    keys.finish()
    if not all(isinstance(pattern, str) for pattern in files):
        keys.fail("files", expected='a list of patterns such as "*.csv"', found=list(files))
    text = _text(tables["table"])
    joints = _joints(keys, listed, tables["columns"], text)
    return Description(
        path=path,
        text=text,
        clock=_clock(tables["time"]),
        space=_space(tables["space"]),
        turns=_turns(tables["rotations"], joints),
        states=_states(tables["states"]),
        joints=joints,
        joint_column=tables["columns"].column("joint"),
        frame_column=tables["columns"].column("frame"),
        files=tuple(str(pattern) for pattern in files),
    )


def _text(keys: Keys) -> Text:
    separator = keys.choice("separator", tuple(SEPARATORS), "auto")
    decimal = keys.choice("decimal", (".", ","), ".")
    if decimal == "," and separator == "comma":
        keys.fail("decimal", expected="'.' where the separator is a comma", found="','")
    encoding = keys.text("encoding", "")
    if encoding:
        try:
            known = codecs.lookup(encoding).name not in _NO_ENCODINGS
        except (LookupError, ValueError):  # the latter of a name with a NUL
            known = False
        if not known:
            keys.fail("encoding", expected='an encoding such as "utf-8" or "latin-1"', found=repr(encoding))
    header = keys.whole("header", 0, 0, _MAX_LINES)
    first = keys.whole("first_row", header + 1, header + 1, _MAX_LINES)
    comment = keys.text("comment", "")
    if len(comment) > 1 or comment.isalnum() or (comment and comment in "+-.\"'"):
        keys.fail("comment", expected="one character that begins no number", found=repr(comment))
    long = keys.choice("rows", ("frame", "joint"), "frame") == "joint"
    missing = keys.marks("missing")
    keys.finish()
    return Text(SEPARATORS[separator], decimal, encoding, header, first, comment or None, missing, long)


def _clock(keys: Keys) -> Clock:
    column = keys.column("column")
    unit = keys.choice("unit", tuple(SECONDS), "s")
    rate = keys.number("rate", 0.1, 10_000.0)
    counted = column is None or unit == "frame"
    if counted and rate is None:
        keys.fail("rate", expected="frames per second, where no column holds a time", found="none")
    if not counted and rate is not None:
        keys.fail(
            "rate",
            expected="no rate beside a column of times",
            found=f"{rate:g}",
            advice='leave one out, or say unit = "frame" for a column of frame numbers',
        )
    keys.finish()
    return Clock(column, SECONDS[unit], counted, rate)


def _space(keys: Keys) -> Space:
    unit = keys.get("unit")
    if isinstance(unit, str) or unit is None:
        name = keys.choice("unit", tuple(LENGTHS), "m")
        metres = LENGTHS[name]
    else:
        metres = keys.number("unit", 1e-6, 1e3) or 1.0
        name = f"{metres:g} m"
    up, forward = (_axis(keys, key, default) for key, default in (("up", "Y"), ("forward", "Z")))
    if abs(up @ forward) > 0:
        keys.fail("forward", expected="another axis than space.up", found=repr(keys.get("forward") or "Z"))
    left = np.cross(up, forward)
    if keys.get("left") is not None:
        left = _axis(keys, "left", "X")
        if abs(left @ up) + abs(left @ forward) > 0:
            keys.fail("left", expected="the third axis", found=repr(keys.get("left")))
    local = keys.choice("relative_to", ("world", "parent"), "world") == "parent"
    keys.finish()
    return Space(metres, name, np.stack([forward, left, up]), local)


def _axis(keys: Keys, key: str, default: str) -> Array:
    value = keys.text(key, default)
    sign, letter = (-1.0, value[1:]) if value.startswith("-") else (1.0, value.removeprefix("+"))
    if len(letter) != 1 or letter.upper() not in _AXES:
        keys.fail(key, expected="X, Y or Z, with a minus for the opposite direction", found=repr(value))
    axis = np.zeros(3)
    axis[_AXES.index(letter.upper())] = sign
    return axis


def _turns(keys: Keys, joints: tuple[Joint, ...]) -> Turns:
    euler = any(joint.euler for joint in joints)
    if euler and any(joint.quaternion for joint in joints):
        keys.fail("order", expected="quaternions or Euler angles", found="columns of both")
    if euler and keys.get("order") is None:
        keys.fail("order", expected='the intrinsic order of the Euler angles, such as "ZXY"', found="none")
    choices = ORDERS if euler else ("xyzw", "wxyz")
    order = keys.choice("order", choices, "xyzw")
    degrees = keys.choice("unit", ("deg", "rad"), "deg") == "deg"
    world = keys.choice("relative_to", ("parent", "world"), "parent") == "world"
    if keys.values and not euler and not any(joint.quaternion for joint in joints):
        keys.fail("order", expected="columns.quaternion or columns.euler with this table", found="none")
    keys.finish()
    return Turns(order, degrees, world)


def _states(keys: Keys) -> States:
    missing, inferred, tracked = (keys.marks(key) for key in ("missing", "inferred", "tracked"))
    listed = bool(missing or inferred or tracked)
    inferred_from = keys.number("inferred_from", -1e6, 1e6)
    tracked_from = keys.number("tracked_from", -1e6, 1e6)
    if tracked_from is not None and listed:
        keys.fail("tracked_from", expected="either bounds or lists of values", found="both")
    if inferred_from is not None and (tracked_from is None or inferred_from > tracked_from):
        keys.fail("inferred_from", expected="a bound below states.tracked_from", found=f"{inferred_from:g}")
    keys.finish()
    if not listed:
        missing, inferred, tracked = (0.0,), (1.0,), (2.0,)
    lowest = -np.inf if inferred_from is None else inferred_from
    return States(missing, inferred, tracked, lowest, tracked_from)


def _joints(keys: Keys, listed: Any, columns: Keys, text: Text) -> tuple[Joint, ...]:
    if isinstance(listed, list):
        named: dict[str, Any] = {name: name for name in listed if isinstance(name, str)}
        if len(named) != len(listed):
            keys.fail("joints", expected="names in quotes, each once", found=repr(listed))
    elif isinstance(listed, dict):
        named = listed
    else:
        keys.fail("joints", expected="a list or a table of joints", found=listed)
    if not 1 <= len(named) <= _MAX_JOINTS:
        keys.fail("joints", expected=f"1 to {_MAX_JOINTS} joints", found=f"{len(named)}")
    step = columns.whole("step", 0, 1, MAX_COLUMNS)
    shared = {key: _columns(columns, key, count) for key, count in _PARTS.items()}
    for key in ("joint", "frame"):
        if columns.column(key) is not None and not text.long:
            columns.fail(key, expected='table.rows = "joint" with this key', found='rows = "frame"')
    columns.finish()
    for key, these in shared.items():
        _check_names(columns, key, these, text)
        if len(named) > 1 and not text.long:
            _check_apart(columns, key, these, step)
    joints = []
    for index, (name, value) in enumerate(named.items()):
        if not isinstance(value, str | dict):
            keys.fail(f"joints.{name}", expected="the joint's name in the file, or a table", found=value)
        own = Keys(keys.path, f"joints.{name}", {"name": value} if isinstance(value, str) else value)
        called = own.text("name", name)
        common = {key: _placed(these, called, index * step) for key, these in shared.items()}
        joints.append(_joint(own, name, called, common, tuple(named), text))
    return tuple(joints)


def _joint(
    keys: Keys,
    name: str,
    called: str,
    common: Mapping[str, tuple[Column, ...]],
    names: tuple[str, ...],
    text: Text,
) -> Joint:
    """A joint of `names`: its own columns, else those that it has in common with the others."""
    parts: dict[str, tuple[Column, ...]] = {}
    for key, count in _PARTS.items():
        exact = _columns(keys, key, count)
        _check_names(keys, key, exact, text)
        parts[key] = exact or common[key]
    offset, parent = keys.numbers("offset", 3), keys.get("parent")
    keys.finish()
    if parent is not None and (parent == name or parent not in ("", *names)):
        keys.fail("parent", expected="the name of another joint", found=repr(parent))
    if not (parts["position"] or offset or parent == ""):
        keys.fail("position", expected="columns of its position, or an offset", found=None)
    return Joint(name, called, offset=offset, parent=parent, **parts)


def _columns(keys: Keys, key: str, count: int) -> tuple[Column, ...]:
    """The columns under a key, a single one for a count of 1; empty if it is not there."""
    if count > 1:
        return keys.columns(key, count) or ()
    column = keys.column(key)
    return () if column is None else (column,)


def _placed(columns: tuple[Column, ...], named: str, further: int) -> tuple[Column, ...]:
    """One joint's columns: its name in the pattern, or so many columns further than the first joint's."""
    return tuple(
        column.replace("{joint}", named) if isinstance(column, str) else column + further
        for column in columns
    )


def _check_names(keys: Keys, key: str, columns: tuple[Column, ...], text: Text) -> None:
    if text.header == 0 and any(isinstance(column, str) for column in columns):
        keys.fail(
            key,
            expected="column numbers, as the table has no header",
            found=repr(list(columns)),
            advice="say in table.header which line has the names",
        )


def _check_apart(keys: Keys, key: str, columns: tuple[Column, ...], step: int) -> None:
    """Joints that share columns of one row would all stand in one place."""
    for column in columns:
        if isinstance(column, str) and "{joint}" not in column:
            keys.fail(key, expected="{joint} in the name, where each joint's own goes", found=repr(column))
        if isinstance(column, int) and not step:
            keys.fail(
                "step", expected="how many columns further the next joint stands", found=f"none beside {key}"
            )

"""A description of a file's columns, with the structure of its TOML tables.

See docs/describe-your-columns.md for all keys. description_file.py reads a description, and custom_table.py
uses it to read a capture.
"""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.validation.records import RecordError, one_of
from kinemimic.pipeline.kinematics.rotations import ORDERS
from kinemimic.pipeline.quality.rules.length_units import UNITS

# More columns than any recorder writes: a Kinect v2 with everything has some 300.
MAX_COLUMNS = 10_000
SEPARATORS = {"auto": None, "space": r"\s+", "tab": "\t", "comma": ",", "semicolon": ";"}
SECONDS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "100ns": 1e-7, "frame": 1.0}
# The unit of a time column of dates or times of day, which are words.
DATE = "date"
LENGTHS: dict[str, float] = {name: UNITS[name] for name in ("m", "cm", "mm", "inch")}
QUATERNIONS = ("xyzw", "wxyz")
# Python's codecs for single names, and one that always fails; none is a file encoding, and the first two take
# hours.
_NO_ENCODINGS = ("punycode", "idna", "undefined")
_LARGEST = 1.7e308

Column = Annotated[
    Annotated[int, Meta(ge=1, le=MAX_COLUMNS)] | Annotated[str, Meta(pattern=r"\S")],
    Meta(description=f"a column: its name in the header, or its number from 1 to {MAX_COLUMNS}"),
]
_Mark = Annotated[
    str | Annotated[float, Meta(ge=-_LARGEST, le=_LARGEST)], Meta(description="text in quotes or a number")
]
_Marks = tuple[_Mark, ...]
_Axis = Annotated[
    str,
    Meta(pattern=r"\A[+-]?[XYZxyz]\Z", description="X, Y or Z, with a minus for the opposite direction"),
]
_Bound = Annotated[float, Meta(ge=-1e6, le=1e6)]


class Text(Struct, frozen=True, forbid_unknown_fields=True):
    """[table]. separator: of SEPARATORS; header: line of the names from 1, or 0; missing: marks of a missing
    value; rows: what a row holds, a frame or one joint."""

    separator: Annotated[str, one_of(tuple(SEPARATORS))] = "auto"
    decimal: Annotated[str, one_of((".", ","))] = "."
    encoding: str = ""
    header: Annotated[int, Meta(ge=0, le=10_000)] = 0
    first_row: Annotated[int, Meta(ge=1, le=10_000)] | None = None
    comment: str = ""
    missing: _Marks = ()
    rows: Literal["frame", "joint"] = "frame"

    def __post_init__(self) -> None:
        if self.decimal == "," and self.separator == "comma":
            raise RecordError("decimal", expected="'.' where the separator is a comma", found="','")
        if self.encoding and not _is_encoding(self.encoding):
            expected = 'an encoding such as "utf-8" or "latin-1"'
            raise RecordError("encoding", expected=expected, found=repr(self.encoding))
        if self.first <= self.header:
            expected = f"a whole number from {self.header + 1} to 10000"
            raise RecordError("first_row", expected=expected, found=f"{self.first}")
        mark = self.comment
        if len(mark) > 1 or mark.isalnum() or (mark and mark in "+-.\"'"):
            expected = "one character that cannot begin a number"
            raise RecordError("comment", expected=expected, found=repr(mark))

    @property
    def first(self) -> int:
        """The first line of data, from 1."""
        return self.header + 1 if self.first_row is None else self.first_row


class Clock(Struct, frozen=True, forbid_unknown_fields=True):
    """[time]: times are column x SECONDS[unit], or dates, or, for frame numbers and without a column, frame /
    rate."""

    column: Column | None = None
    unit: Annotated[str, one_of((*SECONDS, DATE))] = "s"
    rate: Annotated[float, Meta(ge=0.1, le=10_000.0)] | None = None

    def __post_init__(self) -> None:
        if self.counted and self.rate is None:
            expected = "frames per second, where no column holds a time"
            raise RecordError("rate", expected=expected, found="none")
        if not self.counted and self.rate is not None:
            advice = 'leave one out, or use unit = "frame" for a column of frame numbers'
            expected = "no rate in addition to a column of times"
            raise RecordError("rate", expected=expected, found=f"{self.rate:g}", advice=advice)

    @property
    def counted(self) -> bool:
        """Whether frames are counted, not timed."""
        return self.column is None or self.unit == "frame"


class Space(Struct, frozen=True, forbid_unknown_fields=True, rename={"length": "unit"}):
    """[space]: the unit of length, by name or in metres, and the directions of the person's axes."""

    length: Annotated[str, one_of(tuple(LENGTHS))] | Annotated[float, Meta(ge=1e-6, le=1e3)] = "m"
    up: _Axis = "Y"
    forward: _Axis = "Z"
    left: _Axis | None = None
    relative_to: Literal["world", "parent"] = "world"

    def __post_init__(self) -> None:
        up, forward, left = (axis[-1].upper() for axis in (self.up, self.forward, self.left or "?"))
        if forward == up:
            raise RecordError("forward", expected="another axis than space.up", found=repr(self.forward))
        if left in (up, forward):
            raise RecordError("left", expected="the third axis", found=repr(self.left))

    @property
    def metres(self) -> float:
        """Of a unit of length."""
        return LENGTHS[self.length] if isinstance(self.length, str) else self.length

    @property
    def unit(self) -> str:
        """Its name."""
        return self.length if isinstance(self.length, str) else f"{self.length:g} m"

    @property
    def axes(self) -> Array:
        """(3, 3) rows are our X (forward), Y (left), Z (up) in the file's axes, of determinant -1 for a
        left-handed file."""
        up, forward = _direction(self.up), _direction(self.forward)
        left = np.cross(up, forward) if self.left is None else _direction(self.left)
        return np.stack([forward, left, up])


class Turns(Struct, frozen=True, forbid_unknown_fields=True):
    """[rotations]: order of a quaternion's numbers ("xyzw" if empty), or intrinsic Euler order."""

    order: Annotated[str, one_of((*QUATERNIONS, *ORDERS))] = ""
    unit: Literal["deg", "rad"] = "deg"
    relative_to: Literal["parent", "world"] = "parent"


class States(Struct, frozen=True, forbid_unknown_fields=True):
    """[states]: values of a state column; or, with `tracked_from`, bounds of a confidence."""

    missing: _Marks = ()
    inferred: _Marks = ()
    tracked: _Marks = ()
    inferred_from: _Bound = -np.inf
    tracked_from: _Bound | None = None

    def __post_init__(self) -> None:
        if self.tracked_from is not None and (self.missing or self.inferred or self.tracked):
            raise RecordError("tracked_from", expected="either bounds or lists of values", found="both")
        if self.inferred_from > (-np.inf if self.tracked_from is None else self.tracked_from):
            found = f"{self.inferred_from:g}"
            raise RecordError("inferred_from", expected="a bound below states.tracked_from", found=found)

    @property
    def marks(self) -> tuple[Sequence[str | float], ...]:
        """Values that mean 0, 1 and 2."""
        listed = self.missing, self.inferred, self.tracked
        return listed if any(listed) else ((0.0,), (1.0,), (2.0,))


@dataclass(frozen=True)
class Joint:
    """name: in the clip; named: in the file; columns are empty where there are none; offset: (3,) from the
    parent in the file's unit; parent: a joint's name, "" for the root, None where the 20 nodes decide."""

    name: str
    named: str
    position: tuple[Column, ...]
    state: tuple[Column, ...]
    quaternion: tuple[Column, ...]
    euler: tuple[Column, ...]
    offset: tuple[float, ...] | None
    parent: str | None


@dataclass(frozen=True)
class Description:
    """A file's columns; joint_column and frame_column only where a row holds one joint."""

    path: Path
    text: Text
    clock: Clock
    space: Space
    turns: Turns
    states: States
    joints: tuple[Joint, ...]
    joint_column: Column | None
    frame_column: Column | None
    files: tuple[str, ...]


def _is_encoding(name: str) -> bool:
    try:
        return codecs.lookup(name).name not in _NO_ENCODINGS
    except (LookupError, ValueError):  # the latter of a name with a NUL
        return False


def _direction(axis: str) -> Array:
    direction = np.zeros(3)
    direction["XYZ".index(axis[-1].upper())] = -1.0 if axis.startswith("-") else 1.0
    return direction

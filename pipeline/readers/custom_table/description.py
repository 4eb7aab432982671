"""What a description says of a file's columns: docs/describe-your-columns.md has every key.

description_file.py makes it of a TOML file, described.py reads a capture by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kinemimic.pipeline.arrays import Array

# More columns than any recorder writes: a Kinect v2 with everything has some 300.
MAX_COLUMNS = 10_000
Column = str | int  # its name in the header, or its number from 1


@dataclass(frozen=True)
class Text:
    """How the text is cut: separator None is found out; header: line of the names from 1, or 0; first: first
    line of data; missing: marks of a missing value; long: a row holds one joint, not one frame."""

    separator: str | None
    decimal: str
    encoding: str
    header: int
    first: int
    comment: str | None
    missing: tuple[str | float, ...]
    long: bool


@dataclass(frozen=True)
class Clock:
    """Times are column x seconds, or, for frame numbers (counted) and without a column, frame / rate."""

    column: Column | None
    seconds: float
    counted: bool
    rate: float | None


@dataclass(frozen=True)
class Space:
    """metres: per unit; unit: its name; axes: (3, 3) rows are our X (forward), Y (left), Z (up) in the file's
    axes, of determinant -1 for a left-handed file; local: positions are in the parent's frame."""

    metres: float
    unit: str
    axes: Array
    local: bool


@dataclass(frozen=True)
class Turns:
    """How rotations are written: order "xyzw", "wxyz" or an intrinsic Euler order; degrees; world: each is
    relative to the world, not to the parent."""

    order: str
    degrees: bool
    world: bool


@dataclass(frozen=True)
class States:
    """Values of a state column that mean 0, 1 and 2; or, with `tracked_from`, bounds of a confidence."""

    missing: tuple[str | float, ...]
    inferred: tuple[str | float, ...]
    tracked: tuple[str | float, ...]
    inferred_from: float
    tracked_from: float | None


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

"""Headers that name every joint or marker once, or in three columns, and leave out the axes, as hand-made
tables, pandas and Kinetics Toolkit have them: "LASI,,", "LASI,LASI,LASI", "LASI,LASI.1,LASI.2", "LASI[0] …".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import islice

from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.joint_tables.stacked_header import is_data
from kinemimic.pipeline.readers.optical.marker_names import SIDES, landmarks

_SEPARATORS = (",", ";", "\t")
_SEARCHED = 64  # lines in which the header stands
_FEWEST = 5  # joints of a body, at least
_MOST_BEFORE = 3  # columns in front of the first joint: time, frame …
_NUMBERED = re.compile(r"(.*\S)[\[_. ](\d)\]?")


def with_axes(source: Source) -> Source:
    """The source with the axes in its header; itself if the header has others, or is no such header.

    The last of four columns of a joint is the constant of homogeneous coordinates.
    """
    lines = list(islice(source.lines, _SEARCHED))
    separator = max(_SEPARATORS, key=lambda mark: sum(line.count(mark) for line in lines))
    rows = [[cell.strip().strip('"').strip() for cell in line.split(separator)] for line in lines]
    first = next((k for k, row in enumerate(rows) if len(row) > 3 * _FEWEST and is_data(row)), 0)
    if first == 0 or len(rows[first - 1]) != len(rows[first]):
        return source
    names = rows[first - 1]
    for start in range(_MOST_BEFORE + 1):
        for width in (3, 4):
            joints = _joints(names[start:], width)
            if joints is not None and _show_legs(joints):
                axes = (*(f"_{axis}" for axis in "xyz"), *[" constant"] * (width - 3))
                spelt = [f"{name}{axis}" for name in joints for axis in axes]
                header = separator.join([*names[:start], *spelt])
                return source.with_text(
                    "\n".join([*source.lines[: first - 1], header, *source.lines[first:]])
                )
    return source


def _show_legs(names: Sequence[str]) -> bool:
    """Whether the names are of joints or markers of both legs, rather than any words with numbers."""
    found = landmarks(names)
    return set(REQUIRED) <= joints_by_name(tuple(names)).keys() or all(
        f"{landmark}_{side}" in found for landmark in ("asis", "knee_lateral") for side in SIDES
    )


def _joints(names: Sequence[str], width: int) -> list[str] | None:
    """The joints' names, if each has `width` successive columns without axes; None for another header."""
    if len(names) % width or len(names) < width * _FEWEST:
        return None
    groups = [names[k : k + width] for k in range(0, len(names), width)]
    joints = [_joint(group) for group in groups]
    known = [name for name in joints if name is not None]
    return known if len(known) == len(groups) == len(set(known)) else None


def _joint(group: Sequence[str]) -> str | None:
    """The name in the columns of one joint: once, in each, or numbered from 0 or 1; None if there is none."""
    name, *others = group
    if not name or to_number(name) is not None:
        return None
    if set(others) <= {""} or set(others) == {name}:
        return name
    numbered = [_NUMBERED.fullmatch(one) for one in group]
    if numbered[0] is None and all(numbered[1:]):  # pandas: the second one is the first with a number
        found = [(name, 0), *((match[1], int(match[2])) for match in numbered[1:] if match)]
    else:
        found = [(match[1], int(match[2])) for match in numbered if match]
    stems, numbers = {stem for stem, _ in found}, [number for _, number in found]
    if len(found) != len(group) or len(stems) != 1 or numbers[0] not in (0, 1):
        return None
    return found[0][0] if numbers == [*range(numbers[0], numbers[0] + len(group))] else None

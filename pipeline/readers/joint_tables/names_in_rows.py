"""Tables that repeat the joints' names in every row: "HipLeft,Tracked,0.1,0.9,2.3,KneeLeft,…", perhaps in
brackets.

Programs that convert a recording of Kinect Studio write such rows (KinectXEFTools), and so do data sets
(IntelliRehabDS).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source

_BETWEEN = re.compile(r"[,;:|=\s()\[\]{}<>\"']+")
# The SDKs' words for states of joints and hands.
_STATES = frozenset((
    "tracked", "inferred", "nottracked", "none", "low", "medium", "high", "open", "closed", "lasso",
    "unknown", "true", "false",
))  # fmt: skip
_AXES = "XYZ"


def with_names_above(source: Source) -> Source:
    """The source with such names in its header, in the line above the rows; itself if it is no such table.

    Where a header is as long as the rows, its names follow those of the joints; else the first three numbers
    behind a joint's name are its place, and a word is its state.
    """
    rows = [row for line in source.head[:-1] if _names_legs(row := _parts(line))]
    if len(rows) < 2:
        return source
    width = len(rows[-1])
    rows = [row for row in rows if len(row) == width]
    names = _names(rows)
    if not joints_by_name(tuple(names.values())).keys() >= set(REQUIRED):
        return source
    parts = [_parts(line) for line in source.lines]
    is_row = [len(row) == width and all(row[k] == name for k, name in names.items()) for row in parts]
    first = is_row.index(True)
    above = next((row for row in parts[:first] if len(row) == width), None)
    header = _header(names, rows[0], above)
    lines = [
        "\t".join(part for k, part in enumerate(row) if k not in names) if is_one else ""
        for row, is_one in zip(parts, is_row, strict=True)
    ]
    return source.with_text("\n".join([*lines[: max(first - 1, 0)], "\t".join(header), *lines[first:]]))


def _parts(line: str) -> list[str]:
    return [part for part in _BETWEEN.split(line) if part]


def _names_legs(row: Sequence[str]) -> bool:
    """Whether a line has the joints' names, and at least a place of each."""
    words = tuple(part for part in row if to_number(part) is None)
    enough = len(row) - len(words) >= 3 * len(REQUIRED)
    return enough and joints_by_name(words).keys() >= set(REQUIRED)


def _names(rows: Sequence[Sequence[str]]) -> dict[int, str]:
    """Column -> the joint that it names in all rows, and that no other column does."""
    words = {k: word for k, word in enumerate(rows[0]) if all(row[k] == word for row in rows)}
    return {
        k: word
        for k, word in words.items()
        if to_number(word) is None and word.lower() not in _STATES and rows[0].count(word) == 1
    }


def _header(names: Mapping[int, str], row: Sequence[str], above: Sequence[str] | None) -> list[str]:
    """The names of the other columns: the joint's, and what it holds."""
    header, joint, numbers = [], "", 0
    for column, part in enumerate(row):
        if column in names:
            joint, numbers = names[column], 0
        elif above is not None:
            header.append(f"{joint} {above[column]}".strip())
        elif to_number(part) is None:
            header.append(f"{joint} state" if joint else f"word {column}")
        else:
            of_joint = f"{joint} {_AXES[numbers] if numbers < len(_AXES) else f'number {numbers}'}"
            header.append(of_joint if joint else f"number {column}")
            numbers += 1
    return header

"""Lines of numbers to an array, fast, with the line of the first mistake in the error.

numpy's own C parser (`loadtxt`) does the work; only a table that it refuses is looked at line by line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.errors import CaptureError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Table:
    """values: (rows, columns); dropped: lines that were left out because they have another width."""

    values: Array
    lines: Sequence[str]
    first: int
    dropped: int = 0
    kept: NDArray[np.intp] | None = None

    def line(self, row: int) -> int:
        """The number in the file, from 1, of the line that row stands on."""
        filled = [k for k, line in enumerate(self.lines) if line.strip()]
        return self.first + filled[row if self.kept is None else int(self.kept[row])]


def parse_table(
    source: Source,
    *,
    start: int = 0,
    stop: int | None = None,
    width: int | None = None,
    separator: str | None = None,
    drop_others: bool = False,
) -> Table:
    """The numbers of source.lines[start:stop], blank lines skipped; NaN and infinities pass.

    width: the numbers each line must have (by default as many as the first); separator: None for any white
    space, else one character, which may also stand once behind the last number. drop_others: lines of
    another width are left out and counted (a recorder that writes short lines while nobody is there),
    instead of an error.
    CaptureError names the first line with another count or with something that is no number, and says if the
    file has no such line at all.
    """
    lines = source.lines[start:stop]
    if separator is not None:
        lines = [line.rstrip(" ").removesuffix(separator) for line in lines]
    first = next((line for line in lines if line.strip()), None)
    if first is None:
        raise source.error(expected="lines of numbers", found="none", where=f"line {start + 1}")
    wanted = len(_fields(first, separator)) if width is None else width
    if drop_others:
        return _of_width(source, lines, start, wanted, separator)
    if len(_fields(first, separator)) != wanted:
        _complain(source, lines, start, wanted, separator)
    try:
        values = _parse(lines, separator)
    except ValueError:
        _complain(source, lines, start, wanted, separator)
    if values.shape[1] != wanted:
        _complain(source, lines, start, wanted, separator)
    return Table(values, lines, start + 1)


def _of_width(source: Source, lines: Sequence[str], start: int, width: int, separator: str | None) -> Table:
    """The lines of that width alone."""
    filled = [line for line in lines if line.strip()]
    kept = [row for row, line in enumerate(filled) if _has_width(line, width, separator)]
    if not kept:
        raise source.error(expected=f"lines of {width} numbers", found="none of that length")
    try:
        values = _parse([filled[row] for row in kept], separator)
    except ValueError:
        _complain(source, lines, start, width, separator, drop_others=True)
    return Table(values, lines, start + 1, len(filled) - len(kept), np.array(kept))


def _has_width(line: str, width: int, separator: str | None) -> bool:
    """Counting separators is ten times as fast as splitting; only odd white space needs the latter."""
    if separator is None and ("  " in line or "\t" in line):
        return len(line.split()) == width
    return line.strip().count(separator or " ") == width - 1


def _parse(lines: Sequence[str], separator: str | None) -> Array:
    return np.loadtxt(lines, dtype=np.float64, delimiter=separator, comments=None, ndmin=2)


def _fields(line: str, separator: str | None) -> list[str]:
    return line.split(separator)


def _complain(
    source: Source,
    lines: Sequence[str],
    start: int,
    width: int,
    separator: str | None,
    *,
    drop_others: bool = False,
) -> NoReturn:
    last = max(k for k, line in enumerate(lines) if line.strip())
    for k, line in enumerate(lines):
        fields = _fields(line, separator) if line.strip() else []
        if not fields or (drop_others and not _has_width(line, width, separator)):
            continue
        where = f"line {start + k + 1}"
        if len(fields) != width:
            raise source.error(
                expected=f"{width} numbers",
                found=f"{len(fields)}",
                where=where,
                advice="the file is cut off there" if k == last and len(fields) < width else None,
            )
        for field in fields:
            if not _is_number(field):
                raise source.error(expected="a number", found=f"{field.strip()[:40]!r}", where=where)
    raise CaptureError(source.path, expected=f"lines of {width} numbers", found="something else")


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    # Python takes "1_000"; a file of numbers has no such thing.
    return "_" not in field

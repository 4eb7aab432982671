"""Lines of numbers to an array, fast, with the line of the first mistake in the error.

A large table of one plain separator goes through Arrow's CSV parser, which rounds as Python does and takes
two thirds of the time of numpy's own C parser (`loadtxt`); that takes what is small, where importing Arrow
would cost more than it saves, or laid out in any other way. Only a table that both refuse is looked at line
by line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.source import Source

_LARGE = 2**19
# Where the layout of a large table is looked up.
_PREFIX, _LOOK = 2**20, 1000


@dataclass(frozen=True)
class Table:
    """values: (rows, columns); dropped: lines that were left out because they have another width."""

    values: Array
    source: Source
    start: int
    dropped: int = 0
    left_out: frozenset[int] = frozenset()

    def line(self, row: int) -> int:
        """The number in the file, from 1, of the line that row stands on."""
        lines = self.source.lines[self.start :]
        filled = [k for k, line in enumerate(lines) if line.strip()]
        kept = [k for number, k in enumerate(filled) if number not in self.left_out]
        return self.start + 1 + kept[row]


def parse_table(
    source: Source,
    *,
    start: int = 0,
    width: int | None = None,
    separator: str | None = None,
    words: int = 0,
    drop_others: bool = False,
) -> Table:
    """The numbers of source.lines[start:], blank lines skipped; NaN and infinities pass.

    width: the fields each line must have (by default as many as the first); separator: None for any white
    space, else one character, which may also stand once behind the last number. words: so many of the fields,
    the first, are no numbers, and are left out (not looked at) in the values. drop_others: lines of
    another width are left out and counted (a recorder that writes short lines while nobody is there),
    instead of an error.
    CaptureError names the first line with another count or with something that is no number, and says if the
    file has no such line at all.
    """
    if len(source.content) >= _LARGE:
        quick = _with_arrow(source, start, width, separator, words, drop_others=drop_others)
        if quick is not None:
            return quick
    lines: Sequence[str] = source.lines[start:]
    if separator is not None:
        lines = [line.rstrip(" ").removesuffix(separator) for line in lines]
    first = next((line for line in lines if line.strip()), None)
    if first is None:
        raise source.error(expected="lines of numbers", found="none", where=f"line {start + 1}")
    wanted = len(first.split(separator)) if width is None else width
    if drop_others:
        return _of_width(source, lines, start, wanted, separator)
    if len(first.split(separator)) != wanted:
        _complain(source, lines, start, wanted, separator, words)
    try:
        values = _parse([line.split(separator, words)[-1] for line in lines] if words else lines, separator)
    except ValueError:
        _complain(source, lines, start, wanted, separator, words)
    if values.shape[1] != wanted - words:
        _complain(source, lines, start, wanted, separator, words)
    return Table(values, source, start)


def _with_arrow(
    source: Source, start: int, width: int | None, separator: str | None, words: int, *, drop_others: bool
) -> Table | None:
    """The table if it is as plain as most are: one separator between any two numbers; else None."""
    import pyarrow as pa  # noqa: PLC0415 (see the top)
    from pyarrow import csv  # noqa: PLC0415

    if not source.content.isascii():
        return None
    example = _line_of_width(source, start, width, separator)
    if example is None:
        return None
    between = separator or ("\t" if "\t" in example else " ")
    fields = example.split(between)
    columns = len(fields) if width is None else width
    names = [f"{k}" for k in range(columns)]
    wanted = names[words:]
    # A separator behind the last number makes one more column, of nothing.
    closed = len(fields) == columns + 1 and not fields[-1].strip()
    if not closed and len(fields) != columns:
        return None
    others: list[int] = []

    def other(row: Any) -> str:
        # Other white space between its numbers does not make a line another width.
        if not drop_others or not row.text.strip() or _has_width(row.text, columns, separator):
            return "error"
        others.append(row.number - 1 - start)
        return "skip"

    try:
        table = csv.read_csv(
            pa.BufferReader(source.content),
            csv.ReadOptions(
                use_threads=False,
                block_size=2**20,
                skip_rows=start,
                column_names=[*names, "end"] if closed else names,
            ),
            csv.ParseOptions(delimiter=between, quote_char=False, invalid_row_handler=other),
            csv.ConvertOptions(
                check_utf8=False,
                null_values=[],
                column_types=dict.fromkeys(wanted, pa.float64()),
                include_columns=wanted,
            ),
        )
    except pa.ArrowException:
        return None
    if table.num_rows == 0:
        return None
    values = np.empty((table.num_rows, len(wanted)))
    for k, column in enumerate(table.columns):
        begin = 0
        for chunk in column.chunks:
            values[begin : begin + len(chunk), k] = chunk.to_numpy()
            begin += len(chunk)
    return Table(values, source, start, len(others), frozenset(others))


def _line_of_width(source: Source, start: int, width: int | None, separator: str | None) -> str | None:
    """The first line that has so many numbers, from which the layout is told; looked for in the first MiB."""
    for raw in source.content[:_PREFIX].split(b"\n", start + _LOOK)[start : start + _LOOK]:
        line = raw.decode("ascii")
        bare = line.rstrip(" ").removesuffix(separator or "")
        if bare.strip() and (width is None or len(bare.split(separator)) == width):
            return line
    return None


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
    left_out = frozenset(range(len(filled))) - frozenset(kept)
    return Table(values, source, start, len(left_out), left_out)


def _has_width(line: str, width: int, separator: str | None) -> bool:
    """Counting separators is ten times as fast as splitting; only odd white space needs the latter."""
    if separator is None and ("  " in line or "\t" in line):
        return len(line.split()) == width
    return line.strip().count(separator or " ") == width - 1


def _parse(lines: Sequence[str], separator: str | None) -> Array:
    return np.loadtxt(lines, dtype=np.float64, delimiter=separator, comments=None, ndmin=2)


def _complain(
    source: Source,
    lines: Sequence[str],
    start: int,
    width: int,
    separator: str | None,
    words: int = 0,
    *,
    drop_others: bool = False,
) -> NoReturn:
    last = max(k for k, line in enumerate(lines) if line.strip())
    for k, line in enumerate(lines):
        fields = line.split(separator) if line.strip() else []
        if not fields or (drop_others and not _has_width(line, width, separator)):
            continue
        where = f"line {start + k + 1}"
        # Words between lines of numbers are the header of another recording.
        header = 0 < k < last and to_number(fields[0]) is None and to_number(fields[-1]) is None and not words
        joined = "two files seem to be joined there: part them" if header else None
        if len(fields) != width:
            raise source.error(
                expected=f"{width} numbers",
                found=f"{len(fields)}",
                where=where,
                advice="the file is cut off there" if k == last and len(fields) < width else joined,
            )
        for field in fields[words:]:
            if to_number(field) is None:
                raise source.error(
                    expected="a number", found=f"{field.strip()[:40]!r}", where=where, advice=joined
                )
    raise CaptureError(source.path, expected=f"lines of {width} numbers", found="something else")


def numbers_of(line: str, separator: str | None) -> list[float] | None:
    """The numbers of a line that holds nothing else, else None; a separator may stand behind the last."""
    fields = line.strip().removesuffix(separator or "").split(separator)
    found = [to_number(field) for field in fields]
    return None if None in found else [value for value in found if value is not None]


def to_number(field: str) -> float | None:
    """The number that a field holds, NaN and infinities too; None for anything else."""
    try:
        # Python takes "1_000"; a file of numbers has no such thing.
        return None if "_" in field else float(field)
    except ValueError:
        return None

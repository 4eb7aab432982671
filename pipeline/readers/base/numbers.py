"""Parse lines of numbers into an array, with the line of the first mistake in the error.

A large table with one plain separator goes through Arrow's CSV parser, which rounds as Python does and takes
two thirds of the time of numpy's C parser (`loadtxt`). numpy parses small tables, for which importing Arrow
would cost more than it saves, and any other layout. Only a table that both refuse is checked line by line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.source import Source

_LARGE = 2**19
# The part of a large table from which its layout is detected.
_LAYOUT_BYTES, _LAYOUT_LINES = 2**20, 1000
# What writers put into the cell of a value that they do not have, in lower case.
_EMPTY = frozenset(("", "null", "none", "na", "n/a"))
# What programs compiled by Microsoft's compilers write for NaN and infinity, and the marks of it.
_NAN_OF_C = re.compile(r"[-+]?(?:1\.#(?:IND|QNAN|SNAN|INF)0*|nan\((?:ind|snan)\))", re.IGNORECASE)
_MARKS_OF_C = (b"#IND", b"#QNAN", b"#SNAN", b"#INF", b"nan(")
# The one comma of a number; "1,234.5" and "1,234,567" have commas between thousands.
_DECIMAL_COMMA = re.compile(r"(?<![\d.,])(\d*),(\d+)(?![\d.,])")


@dataclass(frozen=True)
class Table:
    """values: (rows, columns); dropped: number of lines omitted because they have another width."""

    values: Array
    source: Source
    start: int
    dropped: int = 0
    left_out: frozenset[int] = frozenset()

    def line(self, row: int) -> int:
        """Line number in the file, from 1, of a row."""
        lines = self.source.lines[self.start :]
        filled = [k for k, line in enumerate(lines) if line.strip()]
        kept = [k for number, k in enumerate(filled) if number not in self.left_out]
        return self.start + 1 + kept[row]

    def where(self, row: int) -> str:
        """Place of a row, for a message."""
        return f"line {self.line(row)}"


def parse_table(
    source: Source,
    *,
    start: int = 0,
    width: int | None = None,
    separator: str | None = None,
    label_columns: int = 0,
    drop_other_widths: bool = False,
) -> Table:
    """The numbers of source.lines[start:]; blank lines are skipped, NaN and infinities pass.

    width: required number of fields per line (default: as many as in the first line). separator: None for any
    white space, else one character, which may also follow the last number. label_columns: number of leading
    fields that are not numbers; they are skipped unread. drop_other_widths: omit and count lines of another
    width instead of raising (some recorders write short lines while nobody is tracked).

    Raises CaptureError naming the first line with another number of fields or with something that is not a
    number, or saying that there is no such line at all.
    """
    if any(mark in source.content for mark in _MARKS_OF_C):
        source = source.with_text(_NAN_OF_C.sub("nan", "\n".join(source.lines)))
    if len(source.content) >= _LARGE:
        table = _with_arrow(
            source, start, width, separator, label_columns, drop_other_widths=drop_other_widths
        )
        if table is not None:
            return table
    lines: Sequence[str] = source.lines[start:]
    if separator is not None:
        lines = [line.rstrip(" ").removesuffix(separator) for line in lines]
    first = next((line for line in lines if line.strip()), None)
    if first is None:
        raise source.error(expected="lines of numbers", found="none", line=start + 1)
    wanted = len(first.split(separator)) if width is None else width
    if drop_other_widths:
        return _rows_of_width(source, lines, start, wanted, separator)
    if len(first.split(separator)) != wanted:
        _raise_first_mistake(source, lines, start, wanted, separator, label_columns)
    try:
        values = _parse(
            [line.split(separator, label_columns)[-1] for line in lines] if label_columns else lines,
            separator,
        )
    except ValueError:
        _raise_first_mistake(source, lines, start, wanted, separator, label_columns)
    if values.shape[1] != wanted - label_columns:
        _raise_first_mistake(source, lines, start, wanted, separator, label_columns)
    return Table(values, source, start)


def parse_sparse_table(
    source: Source, *, start: int, width: int, separator: str, keep_empty_rows: bool = False
) -> Table:
    """Like `parse_table`, with NaN for empty cells and words for "none", and decimal commas where commas do
    not separate.

    keep_empty_rows: a row of nothing but empty cells is a row of NaN, as it must be where a row's place is
    its time, unless no filled row follows; else it is skipped. Most files have neither empty cells nor
    decimal commas, so they are searched for only if the table cannot be parsed without.
    """
    try:
        return parse_table(source, start=start, width=width, separator=separator)
    except CaptureError:
        lines = decimal_points(source, separator, start).lines
        body = list(lines[start:])
        while body and not body[-1].strip(separator + " "):
            body.pop()
        empty = separator.join(["nan"] * width) if keep_empty_rows else ""
        rows = []
        for row in body:
            if row.strip(separator + " "):
                cells = row.split(separator)
                if len(cells) == width + 1 and not cells[-1].strip():
                    cells.pop()
                rows.append(separator.join("nan" if is_empty(cell) else cell for cell in cells))
            else:
                rows.append(empty if separator in row else "")
        filled = source.with_text("\n".join([*lines[:start], *rows]))
        return parse_table(filled, start=start, width=width, separator=separator)


def decimal_points(source: Source, separator: str | None, start: int = 0) -> Source:
    """The file with points for the decimal commas of lines[start:], as files from a German Windows have
    them; itself if commas separate its numbers, or it has none."""
    if separator == "," or b"," not in source.content:
        return source
    body = _DECIMAL_COMMA.sub(r"\1.\2", "\n".join(source.lines[start:]))
    return source.with_text("\n".join([*source.lines[:start], body]))


def _with_arrow(
    source: Source,
    start: int,
    width: int | None,
    separator: str | None,
    label_columns: int,
    *,
    drop_other_widths: bool,
) -> Table | None:
    """The table if its numbers are separated by exactly one separator, as in most files; else None."""
    import pyarrow as pa  # noqa: PLC0415 (see the module docstring)
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
    wanted = names[label_columns:]
    # A trailing separator makes one more, empty column.
    trailing_separator = len(fields) == columns + 1 and not fields[-1].strip()
    if not trailing_separator and len(fields) != columns:
        return None
    dropped: list[int] = []

    def other_width(row: Any) -> str:
        # A line with other white space between its numbers may still have the right width.
        if not drop_other_widths or not row.text.strip() or _has_width(row.text, columns, separator):
            return "error"
        dropped.append(row.number - 1 - start)
        return "skip"

    try:
        table = csv.read_csv(
            pa.BufferReader(source.content),
            csv.ReadOptions(
                use_threads=False,
                block_size=2**20,
                skip_rows=start,
                column_names=[*names, "end"] if trailing_separator else names,
            ),
            csv.ParseOptions(delimiter=between, quote_char=False, invalid_row_handler=other_width),
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
    return Table(values, source, start, len(dropped), frozenset(dropped))


def _line_of_width(source: Source, start: int, width: int | None, separator: str | None) -> str | None:
    """The first line with that many numbers, which shows the layout; searched in the first MiB."""
    for raw in source.content[:_LAYOUT_BYTES].split(b"\n", start + _LAYOUT_LINES)[
        start : start + _LAYOUT_LINES
    ]:
        line = raw.decode("ascii")
        bare = line.rstrip(" ").removesuffix(separator or "")
        if bare.strip() and (width is None or len(bare.split(separator)) == width):
            return line
    return None


def _rows_of_width(
    source: Source, lines: Sequence[str], start: int, width: int, separator: str | None
) -> Table:
    """The table of only those lines that have the given width."""
    filled = [line for line in lines if line.strip()]
    kept = [row for row, line in enumerate(filled) if _has_width(line, width, separator)]
    if not kept:
        raise source.error(expected=f"lines of {width} numbers", found="none of that length")
    try:
        values = _parse([filled[row] for row in kept], separator)
    except ValueError:
        _raise_first_mistake(source, lines, start, width, separator, drop_other_widths=True)
    left_out = frozenset(range(len(filled))) - frozenset(kept)
    return Table(values, source, start, len(left_out), left_out)


def _has_width(line: str, width: int, separator: str | None) -> bool:
    """Whether the line has this many fields. Counting separators is ten times as fast as splitting; only
    irregular white space needs splitting."""
    if separator is None and ("  " in line or "\t" in line):
        return len(line.split()) == width
    return line.strip().count(separator or " ") == width - 1


def _parse(lines: Sequence[str], separator: str | None) -> Array:
    return np.loadtxt(lines, dtype=np.float64, delimiter=separator, comments=None, ndmin=2)


def _raise_first_mistake(
    source: Source,
    lines: Sequence[str],
    start: int,
    width: int,
    separator: str | None,
    label_columns: int = 0,
    *,
    drop_other_widths: bool = False,
) -> NoReturn:
    last = max(k for k, line in enumerate(lines) if line.strip())
    for k, line in enumerate(lines):
        fields = line.split(separator) if line.strip() else []
        if not fields or (drop_other_widths and not _has_width(line, width, separator)):
            continue
        # Words between lines of numbers are the header of a second recording.
        header = (
            0 < k < last
            and to_number(fields[0]) is None
            and to_number(fields[-1]) is None
            and not label_columns
        )
        joined_advice = "two files seem to be joined there: split them" if header else None
        if len(fields) != width:
            cut_off = k == last and len(fields) < width
            raise source.error(
                expected=f"{width} numbers",
                found=f"{len(fields)}",
                line=start + k + 1,
                advice="the file is cut off there"
                if cut_off
                else joined_advice or "mend or delete that line",
            )
        for field in fields[label_columns:]:
            if to_number(field) is None:
                raise source.error(
                    expected="a number",
                    found=f"{field.strip()[:40]!r}",
                    line=start + k + 1,
                    advice=joined_advice,
                )
    raise CaptureError(source.path, expected=f"lines of {width} numbers", found="something else")


def numbers_of(line: str, separator: str | None) -> list[float] | None:
    """The numbers of a line that holds nothing else, else None; a separator may follow the last number."""
    fields = line.strip().removesuffix(separator or "").split(separator)
    found = [to_number(field) for field in fields]
    return None if None in found else [value for value in found if value is not None]


def is_empty(cell: str) -> bool:
    """Whether a cell holds nothing, or a word for it such as NULL."""
    return cell.strip().lower() in _EMPTY


def to_number(field: str) -> float | None:
    """The number in a field, including NaN and infinities; None for anything else."""
    try:
        # float() accepts "1_000"; files of numbers do not contain such literals.
        return None if "_" in field else float(field)
    except ValueError:
        return None

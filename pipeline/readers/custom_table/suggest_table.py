"""The form of a text as a table: separator, decimal mark, header, rows and marks of missing values."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.table import WHITE_SPACE, fields_of

# Enough lines to detect the form of a table, and enough rows to detect a body.
_SAMPLED_LINES = 200
_MAX_ROWS = 2000
_SEPARATORS: dict[str, str] = {"tab": "\t", "semicolon": ";", "comma": ",", "space": WHITE_SPACE}
# What pandas takes as a missing value by default.
_EMPTY = frozenset({"", "nan", "na", "n/a", "null", "none", "-nan", "#n/a", "<na>"})
_SENTINELS = (-9999.0, -999.0, -99999.0, 9999.0, 99999.0, 999.0)
# Larger values are not a position, angle or time; the square is still finite.
_MAX_VALUE = 1e30
_COMMENTS = ("#", "%", "!")


@dataclass(frozen=True)
class Sheet:
    """The form and the cells of a table.

    separator: as in a description; header, first: line numbers from 1 (header 0: none); names: (w,) of the
    columns, or empty; values: (R, w) of the first rows, NaN where there is no number; words: the cells of the
    columns that hold words; marks: marks of missing values, as TOML values; comment: the mark of lines to
    skip, or ""; even: no line of another width is among the first rows.
    """

    separator: str
    decimal: str
    header: int
    first: int
    names: tuple[str, ...]
    values: Array
    words: dict[int, tuple[str, ...]]
    marks: tuple[str, ...]
    comment: str
    even: bool

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.values.shape[1])


def sheet_of(source: Source) -> Sheet:
    """The table in a text; CaptureError if there is none."""
    numbered = ((number, text) for number, text in enumerate(source.lines, 1) if text.strip())
    lines = list(islice(numbered, _MAX_ROWS + _SAMPLED_LINES))
    comment = next((mark for mark in _COMMENTS if any(text.startswith(mark) for _, text in lines)), "")
    filled = [(n, text) for n, text in lines if not (comment and text.startswith(comment))]
    # Sampled from the whole file: recorders write other lines until a person is tracked.
    separator, width = _detect_separator(
        [text for _, text in filled[:: max(1, len(filled) // _SAMPLED_LINES)]]
    )
    if width < 3:
        raise source.error(expected="a table of numbers", found="other lines")
    split = [(number, _split(text, separator)) for number, text in filled]
    rows = [(number, fields) for number, fields in split if len(fields) == width]
    decimal = _decimal(rows, separator)
    starts = [k for k, (_, fields) in enumerate(rows) if _numeric(fields, decimal)]
    # A row of data is followed by another one, unlike a line of numbers above the header.
    first_row = next((k for k, after in pairwise(starts) if after == k + 1), None)
    if first_row is None:
        raise source.error(expected="a table of numbers", found="no two rows of numbers")
    header = 0
    names: tuple[str, ...] = ()
    if (
        first_row > 0
        and not _numeric(rows[first_row - 1][1], decimal)
        and len(set(rows[first_row - 1][1])) == width
    ):
        header, names = rows[first_row - 1][0], tuple(rows[first_row - 1][1])
    cells = [fields for _, fields in rows[first_row : first_row + _MAX_ROWS]]
    values, words, marks = _parse_cells(cells, decimal)
    later = comment and any(text.startswith(comment) for n, text in lines if n > rows[first_row][0])
    first = rows[first_row][0]
    # The last line may be cut off.
    even = all(len(fields) == width for number, fields in split[:-1] if number > first)
    return Sheet(
        separator, decimal, header, first, names, values, words, marks, comment if later else "", even
    )


def _detect_separator(lines: Sequence[str]) -> tuple[str, int]:
    """The separator that splits most lines to one width, trying rarer ones first, and that width."""
    best = ("space", 0, 0.0)
    for name in _SEPARATORS:
        counts = Counter(len(_split(line, name)) for line in lines)
        width, often = max(
            counts.items(), key=lambda item: (item[1] * (item[0] > 2), item[0]), default=(0, 0)
        )
        share = often / max(len(lines), 1)
        if width > 2 and share > best[2] + 0.05:
            best = (name, width, share)
    return best[0], best[1]


def _split(line: str, separator: str) -> list[str]:
    try:
        return fields_of(line, _SEPARATORS[separator])
    except csv.Error:
        return []


def _decimal(rows: Sequence[tuple[int, list[str]]], separator: str) -> str:
    if separator == "comma":
        return "."
    fields = [field for _, row in rows[:_SAMPLED_LINES] for field in row]
    commas = sum(to_number(field.replace(",", ".")) is not None for field in fields if field.count(",") == 1)
    points = sum(to_number(field) is not None for field in fields if "." in field)
    return "," if commas > points else "."


def _numeric(fields: Sequence[str], decimal: str) -> bool:
    """Whether a row is data: at least half numbers or empty fields, and at least three numbers."""
    found = [to_number(field.replace(decimal, ".")) is not None for field in fields]
    empty = sum(field.lower() in _EMPTY for field in fields)
    return sum(found) + empty >= 0.5 * len(fields) and sum(found) >= 3


def _parse_cells(
    cells: Sequence[Sequence[str]], decimal: str
) -> tuple[Array, dict[int, tuple[str, ...]], tuple[str, ...]]:
    values = np.full((len(cells), len(cells[0])), np.nan)
    words: dict[int, tuple[str, ...]] = {}
    marks: dict[str, None] = {}
    for column, fields in enumerate(zip(*cells, strict=True)):
        numbers = [to_number(field.replace(decimal, ".")) for field in fields]
        other = {f for f, v in zip(fields, numbers, strict=True) if v is None and f.lower() not in _EMPTY}
        if len(other) > 3 or sum(v is not None for v in numbers) < 0.2 * len(numbers):
            words[column] = tuple(fields)
            continue
        marks.update(
            dict.fromkeys(f'"{mark}"' for mark in sorted(other) if '"' not in mark and "\\" not in mark)
        )
        values[:, column] = [v if v is not None and abs(v) < _MAX_VALUE else np.nan for v in numbers]
    usual = np.abs(values[np.isfinite(values) & ~np.isin(values, _SENTINELS)])
    for sentinel in _SENTINELS:
        # It is a measurement like the others if neighbouring values occur.
        among = np.isin(values, sentinel)
        if among.sum() > 1 and np.unique(np.nonzero(among)[1]).size > 1 and _is_mark(usual, sentinel):
            marks[f"{sentinel:g}"] = None
            values[among] = np.nan
    return values, words, tuple(marks)


def _is_mark(others: Array, sentinel: float) -> bool:
    """Whether a value is a mark, not a measurement: none of its neighbours occurs."""
    near = np.abs(others - abs(sentinel)) < 0.01 * abs(sentinel)
    return bool(near.sum() <= 1e-4 * max(len(others), 1))

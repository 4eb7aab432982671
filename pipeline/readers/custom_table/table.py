"""The cells of a custom table, read by pandas' C parser, which knows quotes, decimal commas and missing
marks.
"""

from __future__ import annotations

import csv
import difflib
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.validation.records import short
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.description import MAX_COLUMNS, SEPARATORS, Column, Text

WHITE_SPACE = r"\s+"
# A file with blanks after its separators has them from its beginning.
_HEAD = 65536


def separator_of(line: str, decimal: str = ".") -> str:
    """The separator in a line of data: a tab, a semicolon or a comma, else white space."""
    return next((s for s in ("\t", ";", ",") if s in line and s != decimal), WHITE_SPACE)


def fields_of(line: str, separator: str) -> list[str]:
    """The fields of a line, without quotes and surrounding blanks; a trailing separator adds no field."""
    if separator == WHITE_SPACE:
        return line.split()
    fields = [field.strip() for field in next(csv.reader([line], delimiter=separator), [])]
    return fields[:-1] if fields and not fields[-1] else fields


@dataclass(frozen=True)
class Words:
    """A column of words: codes (R,) index `known`, the words that occur; the first, "", is a missing one."""

    codes: NDArray[np.intp]
    known: tuple[str, ...]


class Cells:
    """A table split into `width` columns as described, with `names` if it has a header.

    description_name: the description's file name, for advice. Raises CaptureError if the table does not have
    that form.
    """

    def __init__(self, source: Source, text: Text, description_name: str) -> None:
        self.source, self.text, self.description_name = source, text, description_name
        self._content = self._as_utf8()
        first = next(self._data_lines(), None)
        if first is None:
            self.fail("table.first_row", expected="rows of data", found="none", line=text.first)
        number, self._first = first
        self.separator = SEPARATORS[text.separator] or separator_of(self._first, text.decimal)
        self.width = self._count(self._first, number)
        if self.width > MAX_COLUMNS:
            self.fail(None, expected=f"at most {MAX_COLUMNS} columns", found=f"{self.width}", line=number)
        self.names = self._header()

    def index(self, column: Column, key: str) -> int:
        """The index of a column, from 0; `key` is its key in the description."""
        if isinstance(column, int):
            if column > self.width:
                self.fail(key, expected=f"column {column}", found=f"{self.width} columns")
            return column - 1
        if self.names.count(column) != 1:
            close_match = difflib.get_close_matches(column, self.names, n=1)
            found = f"none of that name{f', but {close_match[0]!r}' if close_match else ''}"
            if column in self.names:
                found = f"{self.names.count(column)} of that name"
            self.fail(key, expected=f"a column {column!r}", found=found, line=self.text.header)
        return self.names.index(column)

    def read(self, numbers: Sequence[int], words: Sequence[int]) -> tuple[Array, list[Words]]:
        """Columns of numbers (R, n), NaN where a value is missing, and columns of words."""
        for column in words:
            if column in numbers:
                self.fail("columns", expected="numbers or words in a column", found=f"both in {column + 1}")
        wanted = sorted({*numbers, *words})
        types: dict[int, Any] = dict.fromkeys(words, "category")
        # pandas reads numbers a third faster without a dtype.
        frame = self._parse(wanted, types)
        if not all(frame.dtypes[column].kind in "fiu" for column in numbers):
            try:
                frame = self._parse(wanted, {**types, **dict.fromkeys(numbers, np.float64)})
            except (ValueError, OverflowError):
                self._no_number(numbers)
        self._check_widths(len(frame))
        values: Array = frame[list(numbers)].to_numpy(dtype=np.float64)
        for mark in self._marks(float):
            values[values == mark] = np.nan
        columns = [frame[column].cat for column in words]
        return values, [
            Words(
                cells.codes.to_numpy(dtype=np.intp) + 1,
                ("", *(str(word).strip() for word in cells.categories)),
            )
            for cells in columns
        ]

    def line(self, row: int) -> int:
        """Line number in the file, from 1, of a row."""
        return next((number for k, (number, _) in enumerate(self._data_lines()) if k == row), self.text.first)

    def lines_of_rows(self) -> list[int]:
        """Line number in the file, from 1, of every row."""
        return [number for number, _ in self._data_lines()]

    def fail(self, key: str | None, *, expected: str, found: str, line: int | None = None) -> NoReturn:
        """Raise a CaptureError about a value in the table that contradicts this key of the description."""
        raise self.source.error(
            expected=short(expected, 160),
            found=short(found, 160),
            line=line,
            advice=None if key is None else f"see {short(key)} in {self.description_name}",
        )

    def _as_utf8(self) -> bytes:
        content = self.source.content
        # Text in UTF-16 is decoded already (base/source.py).
        utf_16 = self.text.encoding.lower().replace("_", "-").startswith("utf-16")
        encoding = "" if utf_16 else self.text.encoding
        try:
            if encoding:
                content = content.decode(encoding).encode()
            elif not content.isascii():
                content.decode()
        except (UnicodeError, LookupError):  # decoded text may hold half a surrogate pair
            if encoding:
                self.fail("table.encoding", expected=f"text in {encoding}", found="other bytes")
            # Only names can be non-ASCII, and Latin-1 maps every byte.
            content = content.decode("latin-1").encode()
        return content

    def _lines(self, begin: int) -> Iterator[tuple[int, str]]:
        """Lines and their numbers from `begin` on, as a generator: usually only the first is needed."""
        start = self._start(begin)
        while start < len(self._content):
            end = self._content.find(b"\n", start)
            end = len(self._content) if end < 0 else end
            yield begin, self._content[start:end].decode()
            begin, start = begin + 1, end + 1

    def _start(self, number: int) -> int:
        """Position in the content at which the line of that number starts."""
        start = 0
        for _ in range(number - 1):
            start = self._content.find(b"\n", start) + 1
            if not start:
                return len(self._content)
        return start

    def _data_lines(self) -> Iterator[tuple[int, str]]:
        """Number and text of every line that makes a row."""
        for number, line in self._lines(self.text.first):
            content = line.split(self.text.comment, 1)[0] if self.text.comment else line
            if content.strip():
                yield number, content

    def _count(self, line: str, number: int) -> int:
        try:
            return len(fields_of(line, self.separator))
        except csv.Error as error:
            self.fail("table.separator", expected="fields", found=str(error), line=number)

    def _header(self) -> list[str]:
        number = self.text.header
        if not number:
            return []
        _, line = next(self._lines(number))
        if self._count(line, number) != self.width:
            self.fail(
                "table.header",
                expected=f"{self.width} names, as many as the rows have columns",
                found=f"{self._count(line, number)}",
                line=number,
            )
        return fields_of(line, self.separator)

    def _parse(self, columns: Sequence[int], types: dict[int, Any]) -> Any:
        import pandas as pd  # noqa: PLC0415 (importing takes half a second)

        try:
            return pd.read_csv(
                io.BytesIO(self._content),
                sep=self.separator,
                header=None,
                usecols=list(columns),
                dtype=types,
                skiprows=self.text.first - 1,
                decimal=self.text.decimal,
                comment=self.text.comment or None,
                na_values=[str(mark) for mark in self._marks(str)],
                skipinitialspace=self.separator.encode() + b" " in self._content[:_HEAD],
                low_memory=False,
            )
        except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
            self.fail(None, expected="rows of one table", found=str(error).strip().splitlines()[-1])
        except ValueError as error:
            if not str(error).startswith("Usecols"):
                raise  # no number in a column of numbers
            self._check_lines()
            self.fail(None, expected=f"{self.width} columns in every row", found="fewer")

    def _marks(self, kind: type) -> list[Any]:
        """The missing-value marks that are numbers (float) or words (str)."""
        numbers, words = [], []
        for mark in self.text.missing:
            try:
                numbers.append(float(mark))
            except ValueError:
                words.append(mark)
        return numbers if kind is float else words

    def _check_widths(self, rows: int) -> None:
        """Check that all rows are as wide as the first: pandas silently pads short and truncates long ones.

        Counts the separators of the whole table at once, and goes line by line only if the total is wrong.
        """
        data = self._content[self._start(self.text.first) :]
        simple = not self.text.comment and b'"' not in data
        if self.separator == WHITE_SPACE:
            characters = np.frombuffer(data, dtype=np.uint8)
            blanks = np.isin(characters, np.frombuffer(b" \t\n\v\f", dtype=np.uint8))
            field_starts = ~blanks & np.concatenate([[True], blanks[:-1]])
            if simple and int(field_starts.sum()) == rows * self.width:
                return
        elif simple and data.count(self.separator.encode()) == rows * self._first.count(self.separator):
            return
        self._check_lines()

    def _check_lines(self) -> None:
        lines = list(self._data_lines())
        for number, line in lines:
            if (count := self._count(line, number)) != self.width:
                cut = number == lines[-1][0] and count < self.width
                found = f"{count}{', the file is cut off there' if cut else ''}"
                self.fail(None, expected=f"{self.width} columns", found=found, line=number)

    def _no_number(self, numbers: Sequence[int]) -> NoReturn:
        """Raise for the first line of another width, else the first non-numeric cell of a number column."""
        import pandas as pd  # noqa: PLC0415

        self._check_lines()
        cells = self._parse(sorted(set(numbers)), dict.fromkeys(numbers, str))
        first = (len(cells), 0)
        for column in numbers:
            words = cells[column].str.strip()
            if self.text.decimal != ".":
                words = words.str.replace(self.text.decimal, ".", regex=False)
            invalid = (pd.to_numeric(words, errors="coerce").isna() & words.notna()).to_numpy()
            if invalid.any():
                first = min(first, (int(invalid.argmax()), column))
        row, column = first
        shown = str(cells[column].iloc[row])[:40] if row < len(cells) else "something else"
        name = repr(self.names[column]) if self.names else str(column + 1)
        self.fail(
            "table.missing", expected=f"a number in column {name}", found=repr(shown), line=self.line(row)
        )

"""The cells of a described table: pandas' C parser, which knows quotes, decimal commas and missing marks."""

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
from kinemimic.pipeline.files.toml_keys import MAX_COLUMNS, Column, short
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.description import Text

SPACE = r"\s+"
# A file that sets blanks behind its separators does so from its beginning.
_HEAD = 65536


def separator_of(line: str, decimal: str = ".") -> str:
    """The separator that a line of data shows: a tab, a semicolon or a comma, else white space."""
    return next((s for s in ("\t", ";", ",") if s in line and s != decimal), SPACE)


def fields_of(line: str, separator: str) -> list[str]:
    """The fields of a line, without quotes and the blanks around them; a final separator ends nothing."""
    if separator == SPACE:
        return line.split()
    fields = [field.strip() for field in next(csv.reader([line], delimiter=separator), [])]
    return fields[:-1] if fields and not fields[-1] else fields


@dataclass(frozen=True)
class Words:
    """A column of words: codes (R,) into `known`, the words that occur; the first, "", is a missing one."""

    codes: NDArray[np.intp]
    known: tuple[str, ...]


class Cells:
    """A table cut as its description says: `width` columns, `names` if it has a header.

    described_by: the description's file name, for advice. CaptureError for a table that has no such form.
    """

    def __init__(self, source: Source, text: Text, described_by: str) -> None:
        self.source, self.text, self.described_by = source, text, described_by
        self._content = self._as_utf8()
        first = next(self._data_lines(), None)
        if first is None:
            self.fail("table.first_row", expected="rows of data", found="none", line=text.first)
        number, self._first = first
        self.separator = text.separator or separator_of(self._first, text.decimal)
        self.width = self._count(self._first, number)
        if self.width > MAX_COLUMNS:
            self.fail(None, expected=f"at most {MAX_COLUMNS} columns", found=f"{self.width}", line=number)
        self.names = self._header()

    def index(self, column: Column, key: str) -> int:
        """Where a column stands, from 0; `key` is where the description names it."""
        if isinstance(column, int):
            if column > self.width:
                self.fail(key, expected=f"a column {column}", found=f"{self.width} columns")
            return column - 1
        if self.names.count(column) != 1:
            near = difflib.get_close_matches(column, self.names, n=1)
            found = f"none of that name{f', but {near[0]!r}' if near else ''}"
            if column in self.names:
                found = f"{self.names.count(column)} of that name"
            self.fail(key, expected=f"a column {column!r}", found=found, line=self.text.header)
        return self.names.index(column)

    def read(self, numbers: Sequence[int], words: Sequence[int]) -> tuple[Array, list[Words]]:
        """Columns as numbers (R, n), NaN where a value is missing, and others as words."""
        for column in words:
            if column in numbers:
                self.fail("columns", expected="numbers or words in a column", found=f"both in {column + 1}")
        wanted = sorted({*numbers, *words})
        types: dict[int, Any] = dict.fromkeys(words, "category")
        # pandas reads numbers a third faster where nobody tells it that they are numbers.
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
        """The number in the file, from 1, of the line that row stands on."""
        return next((number for k, (number, _) in enumerate(self._data_lines()) if k == row), self.text.first)

    def fail(self, key: str | None, *, expected: str, found: str, line: int | None = None) -> NoReturn:
        """A CaptureError about what stands in the table, and the key, if any, that says otherwise."""
        raise self.source.error(
            expected=short(expected, 160),
            found=short(found, 160),
            where=None if line is None else f"line {line}",
            advice=None if key is None else f"{self.described_by} describes it: see {short(key)} there",
        )

    def _as_utf8(self) -> bytes:
        content = self.source.content
        encoding = self.text.encoding
        try:
            if encoding:
                content = content.decode(encoding).encode()
            elif not content.isascii():
                content.decode()
        except (UnicodeError, LookupError):  # of what is decoded, some is no text: half a surrogate pair
            if encoding:
                self.fail("table.encoding", expected=f"text in {encoding}", found="other bytes")
            # Only names can hold more than ASCII, and every byte is some character of Latin-1.
            content = content.decode("latin-1").encode()
        return content

    def _lines(self, begin: int) -> Iterator[tuple[int, str]]:
        """Lines with their numbers from `begin` on, one at a time: mostly only the first is wanted."""
        start = self._start(begin)
        while start < len(self._content):
            end = self._content.find(b"\n", start)
            end = len(self._content) if end < 0 else end
            yield begin, self._content[start:end].decode()
            begin, start = begin + 1, end + 1

    def _start(self, number: int) -> int:
        """Where in the content the line of that number begins."""
        start = 0
        for _ in range(number - 1):
            start = self._content.find(b"\n", start) + 1
            if not start:
                return len(self._content)
        return start

    def _data_lines(self) -> Iterator[tuple[int, str]]:
        """Number in the file and text of every line that makes a row."""
        for number, line in self._lines(self.text.first):
            kept = line.split(self.text.comment, 1)[0] if self.text.comment else line
            if kept.strip():
                yield number, kept

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
        import pandas as pd  # noqa: PLC0415 (half a second, which only described files take)

        try:
            return pd.read_csv(
                io.BytesIO(self._content),
                sep=self.separator,
                header=None,
                usecols=list(columns),
                dtype=types,
                skiprows=self.text.first - 1,
                decimal=self.text.decimal,
                comment=self.text.comment,
                na_values=[str(mark) for mark in self._marks(str)],
                skipinitialspace=self.separator.encode() + b" " in self._content[:_HEAD],
                low_memory=False,
            )
        except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
            self.fail(None, expected="rows of one table", found=str(error).strip().splitlines()[-1])

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
        """Every row as wide as the first: pandas fills short ones and cuts long ones without a word.

        The separators of the whole table are counted at once; only if they do not add up, line by line.
        """
        data = self._content[self._start(self.text.first) :]
        plain = self.text.comment is None and b'"' not in data
        if self.separator == SPACE:
            characters = np.frombuffer(data, dtype=np.uint8)
            blank = np.isin(characters, np.frombuffer(b" \t\n\v\f", dtype=np.uint8))
            begins = ~blank & np.concatenate([[True], blank[:-1]])
            if plain and int(begins.sum()) == rows * self.width:
                return
        elif plain and data.count(self.separator.encode()) == rows * self._first.count(self.separator):
            return
        self._check_lines()

    def _check_lines(self) -> None:
        lines = list(self._data_lines())
        for number, line in lines:
            if (count := self._count(line, number)) != self.width:
                cut = number == lines[-1][0] and count < self.width
                found = f"{count}{', as the file is cut off there' if cut else ''}"
                self.fail(None, expected=f"{self.width} columns", found=found, line=number)

    def _no_number(self, numbers: Sequence[int]) -> NoReturn:
        """Name the first line of another width, else the first cell of a number column that holds none."""
        import pandas as pd  # noqa: PLC0415

        self._check_lines()
        cells = self._parse(sorted(set(numbers)), dict.fromkeys(numbers, str))
        first = (len(cells), 0)
        for column in numbers:
            words = cells[column].str.strip()
            if self.text.decimal != ".":
                words = words.str.replace(self.text.decimal, ".", regex=False)
            bad = (pd.to_numeric(words, errors="coerce").isna() & words.notna()).to_numpy()
            if bad.any():
                first = min(first, (int(bad.argmax()), column))
        row, column = first
        shown = str(cells[column].iloc[row])[:40] if row < len(cells) else "something else"
        name = repr(self.names[column]) if self.names else str(column + 1)
        self.fail(
            "table.missing", expected=f"a number in column {name}", found=repr(shown), line=self.line(row)
        )

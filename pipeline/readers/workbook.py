"""Workbooks of Excel (.xlsx): each sheet as the text that it would be as CSV, for the readers of tables.

Needs the library openpyxl (the extra `excel`).
"""

from __future__ import annotations

import csv
import importlib.util
import io
import itertools
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date, time, timedelta
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import MAX_BYTES, Source
from kinemimic.pipeline.readers.clocks.clock import is_rate
from kinemimic.pipeline.readers.clocks.frame_rate import HIGHEST, LOWEST

Row = Sequence[Any]
# The name of a part of every workbook, which is a ZIP archive.
_PART = b"xl/workbook.xml"
MAX_CELLS = 20_000_000  # of a sheet, empty ones included
_MAX_SHEETS = 100
_HEAD = 200  # rows that are enough to recognise a table
# Rows and columns at the top of a sheet in which a frame rate is looked for.
_RATE_ROWS, _RATE_COLUMNS = 64, 8
# Words in the names of sheets with places, and of those with other numbers under the same header.
_PLACES = frozenset(("position", "positions", "trajectories", "markers", "joints"))
_OTHERS = frozenset((
    "acceleration", "angle", "angles", "angular", "euler", "field", "moment", "moments", "orientation",
    "orientations", "quat", "rotation", "rotations", "velocity",
))  # fmt: skip


def is_workbook(source: Source) -> bool:
    """Whether the content is such a workbook."""
    return source.content.startswith(b"PK\x03\x04") and _PART in source.content


class Workbook:
    """The sheets of a workbook.

    names: of the sheets that are not empty, first of those that have places by their names, last of those
    that have something else. Raises KinemimicError if openpyxl is not installed, CaptureError for a damaged
    workbook and for one that unpacks to more than MAX_BYTES.
    """

    def __init__(self, source: Source) -> None:
        if importlib.util.find_spec("openpyxl") is None:
            raise KinemimicError(
                f"{source.path}: workbooks of Excel are read by openpyxl, which is not installed; "
                "pip install 'kinemimic[excel]', or save the sheet as CSV"
            )
        self._source = source
        with _damage(source):
            _check_parts(source)
            import openpyxl  # noqa: PLC0415 (an extra)

            self._book = openpyxl.load_workbook(
                io.BytesIO(source.content), read_only=True, data_only=True, keep_links=False
            )
            titles = [sheet.title for sheet in self._book.worksheets[:_MAX_SHEETS]]
            heads = {title: list(itertools.islice(self._rows(title), _HEAD)) for title in titles}
        self.names = tuple(sorted((title for title in titles if _has_cells(heads[title])), key=_order))
        self._rate = _stated_rate(heads.values())

    def head(self, name: str, separator: str) -> Source:
        """The first rows of a sheet as text; separator: what stands between its cells."""
        return self._text(name, itertools.islice(self._rows(name), _HEAD), separator)

    def sheet(self, name: str, separator: str) -> Source:
        """A sheet as text, a line for each row; its `rate` is the one that the workbook states.

        Raises CaptureError for a damaged sheet, and for one of more than MAX_CELLS cells.
        """
        return self._text(name, self._rows(name), separator)

    def _text(self, name: str, rows: Iterable[Row], separator: str) -> Source:
        text = io.StringIO()
        writer = csv.writer(text, delimiter=separator, lineterminator="\n")
        with _damage(self._source):
            writer.writerows(map(_written, rows))
        source, content = self._source, text.getvalue().encode()
        return Source(
            source.path, content, source.sha256, source.unit, part=f"sheet {name[:40]!r}", rate=self._rate
        )

    def _rows(self, name: str) -> Iterator[Row]:
        """The rows, each as wide as the widest before it."""
        sheet = self._book[name]
        sheet.reset_dimensions()  # as stated, they may be of any size, and every row is filled up to them
        cells = width = 0
        for row in sheet.iter_rows(values_only=True):
            width = max(width, len(row))
            cells += width + 1
            if cells > MAX_CELLS:
                raise self._source.error(
                    expected=f"at most {MAX_CELLS:,} cells in a sheet", found="more",
                    where=f"sheet {name[:40]!r}",
                )  # fmt: skip
            yield (*row, *[None] * (width - len(row)))


@contextmanager
def _damage(source: Source) -> Iterator[None]:
    """What openpyxl raises, as a CaptureError."""
    try:
        yield
    except KinemimicError:
        raise
    except Exception as error:  # it trusts the parts of a workbook, so that damage raises anything
        what = " ".join(str(error).split())[:80] or type(error).__name__
        raise source.error(expected="a whole workbook of Excel", found=f"damage ({what})") from None


def _check_parts(source: Source) -> None:
    """CaptureError if the parts of the workbook are larger than MAX_BYTES together, or than they claim."""
    with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
        size = sum(part.file_size for part in archive.infolist())
        if size > MAX_BYTES:
            raise source.error(
                expected=f"a workbook of at most {MAX_BYTES >> 20} MB, unpacked", found=f"{size >> 20:,} MB"
            )
        # Reads no more than a part claims to have, and then compares its checksum.
        if part := archive.testzip():
            raise ValueError(f"the checksum of {part}")


def _has_cells(rows: Iterable[Row]) -> bool:
    return any(cell is not None for row in rows for cell in row)


def _order(name: str) -> int:
    words = set(words_of(name))
    return 2 if words & _OTHERS else 0 if words & _PLACES else 1


def _written(row: Row) -> list[str]:
    return [_text_of(cell) for cell in row]


def _text_of(cell: Any) -> str:
    """A cell as in a file of CSV; a line break within it as a blank."""
    if cell is None:
        return ""
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, date | time):
        return cell.isoformat()
    return " ".join(str(cell).splitlines())


def _stated_rate(heads: Iterable[Sequence[Row]]) -> float | None:
    """The frame rate in Hz beside or below a cell that names it, if all such cells agree."""
    found = set()
    for rows in heads:
        top = [row[:_RATE_COLUMNS] for row in rows[:_RATE_ROWS]]
        for row, below in itertools.pairwise([*top, ()]):
            for column, cell in enumerate(row):
                if isinstance(cell, str) and is_rate(cell):
                    near = (*row[column + 1 : column + 2], *below[column : column + 1])
                    found |= {rate for rate in map(to_number, map(str, near)) if _is_possible(rate)}
    return found.pop() if len(found) == 1 else None


def _is_possible(rate: float | None) -> bool:
    return rate is not None and LOWEST <= rate <= HIGHEST

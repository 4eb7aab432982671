"""Excel workbooks (.xlsx): each sheet as the text that it would be as CSV, for the readers of tables.

Needs the library openpyxl (the extra `excel`).
"""

from __future__ import annotations

import csv
import importlib.util
import io
import itertools
import re
import warnings
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date, time, timedelta
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import MAX_BYTES, Source
from kinemimic.pipeline.readers.clocks.clock import is_rate
from kinemimic.pipeline.readers.clocks.frame_rate import HIGHEST, LOWEST

FORMAT = Format(
    name="Excel workbook",
    sensor="that of the table",
    holds="a table of another format in one of its sheets (the extra `excel`)",
    recognised_by="a ZIP archive with xl/workbook.xml, and a sheet that is recognised",
    binary=True,
)
Row = Sequence[Any]
_PART = b"xl/workbook.xml"  # the name of a part of every workbook, which is a ZIP archive
_TYPES = "[Content_Types].xml"  # the part that says what the others are
_SHEET = "application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"
# Unpacked bytes of a sheet, which openpyxl reads as a stream, and of another part, which is in memory.
_MAX_SHEET, _MAX_PART = 2 * 2**30, 128 * 2**20
MAX_CELLS = 20_000_000  # of a sheet
_MAX_SHEETS = 100
_HEAD = 200  # rows that are enough to recognise a table
# Rows of a sheet in which the frame rate is looked for, and cells of a row there: of a table's, none is.
_RATE_ROWS, _RATE_CELLS = 64, 6
_VALUE = re.compile(r"\s*([\d.,]+)\s*(?:hz|fps)?\s*", re.IGNORECASE)
# Errors of cells, without the mark at their end.
_ERRORS = frozenset(("#N/A", "#DIV/0", "#NAME", "#NULL", "#NUM", "#REF", "#VALUE"))
# Words in the names of sheets with places, of those with other numbers under the same header, and of those of
# other devices.
_PLACES = frozenset((
    "coordinates", "joints", "keypoints", "landmarks", "marker", "markers", "position", "positions",
    "trajectories", "trajectory", "xyz",
))  # fmt: skip
_OTHERS = frozenset((
    "acceleration", "accelerations", "angle", "angles", "angular", "euler", "field", "force", "forces",
    "moment", "moments", "orientation", "orientations", "quat", "quaternion", "quaternions", "rotation",
    "rotations", "speed", "speeds", "torque", "torques", "velocities", "velocity",
))  # fmt: skip
_DEVICES = frozenset(
    ("analog", "device", "devices", "emg", "force", "forces", "imu", "plate", "sensor", "sensors")
)


def is_workbook(source: Source) -> bool:
    """Whether the content is such a workbook."""
    return source.content.startswith(b"PK\x03\x04") and _PART in source.content


class Workbook:
    """The sheets of a workbook.

    names: of the sheets with cells, in three groups: those that have places by their names, those whose names
    do not say, and those that have something else by their names. Raises KinemimicError if openpyxl is not
    installed, CaptureError for a damaged or empty workbook, and one whose parts are too large.
    """

    def __init__(self, source: Source) -> None:
        if importlib.util.find_spec("openpyxl") is None:
            raise KinemimicError(
                f"{source.path}: Excel workbooks are read by openpyxl, which is not installed; "
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
            filled = [title for title in titles if next(self._rows(title), None) is not None]
        if not filled:
            raise source.error(
                expected="a workbook with a sheet that has cells", found="none",
                advice="save it as Excel Workbook (.xlsx), not as Strict Open XML, or the sheet as CSV",
            )  # fmt: skip
        self.names = tuple(tuple(title for title in filled if _group(title) == group) for group in range(3))

    def head(self, name: str, separator: str) -> Source:
        """The first rows of a sheet as text; separator: what stands between its cells."""
        return self._text(name, itertools.islice(self._rows(name), _HEAD), separator, None)

    def sheet(self, name: str, separator: str) -> Source:
        """A sheet as text, a line for each row, all of as many cells; its `rate` is the one that another
        sheet states.

        Raises CaptureError for a damaged sheet, and for one that is too large.
        """
        return self._text(name, self._rows(name), separator, self._rate(name))

    def _text(self, name: str, rows: Iterable[Row], separator: str, rate: float | None) -> Source:
        lines, widths, size = [], [], 0
        cells = io.StringIO()
        writer = csv.writer(cells, delimiter=separator, lineterminator="")
        with _damage(self._source):
            for row in rows:
                cells.seek(0)
                cells.truncate()
                writer.writerow(map(_text_of, row))
                lines.append(cells.getvalue() if row else "")
                widths.append(len(row))
                size += len(lines[-1])
                if size > MAX_BYTES:
                    raise self._too_large(name, f"at most {MAX_BYTES >> 20} MB of text in a sheet")
        # As Excel writes CSV; the text of a line without cells stays blank.
        width = max(widths, default=0)
        if width * len(lines) > MAX_CELLS:
            raise self._too_large(name, f"at most {MAX_CELLS:,} cells in a sheet")
        padded = (
            line + separator * (width - count) if count else line
            for line, count in zip(lines, widths, strict=True)
        )
        source, content = self._source, "\n".join(padded).encode()
        part = f"sheet {name[:40]!r}"
        return Source(source.path, content, source.sha256, source.unit, part=part, rate=rate)

    def _rows(self, name: str) -> Iterator[Row]:
        """The rows up to the last one with a cell that is not empty, each up to its own last such cell."""
        sheet = self._book[name]
        sheet.reset_dimensions()  # as stated, they may be of any size, and every row is filled up to them
        cells = empty = 0
        for row in sheet.iter_rows(values_only=True):
            width = next((k for k in range(len(row), 0, -1) if row[k - 1] not in (None, "")), 0)
            if not width:
                empty += 1
                continue
            cells += width + empty
            if cells > MAX_CELLS:
                raise self._too_large(name, f"at most {MAX_CELLS:,} cells in a sheet")
            yield from itertools.repeat((), empty)
            yield row[:width]
            empty = 0

    def _too_large(self, name: str, most: str) -> KinemimicError:
        return self._source.error(expected=most, found="more", where=f"sheet {name[:40]!r}")

    def _rate(self, name: str) -> float | None:
        """The frame rate in Hz that the tops of the other sheets state, if they agree."""
        found: set[float] = set()
        with _damage(self._source):
            for title in itertools.chain(*self.names):
                if title != name and not set(words_of(title)) & _DEVICES:
                    found |= _rates([*itertools.islice(self._rows(title), _RATE_ROWS)])
        return found.pop() if len(found) == 1 else None


@contextmanager
def _damage(source: Source) -> Iterator[None]:
    """What openpyxl raises, as a CaptureError; what it warns of, not at all."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except KinemimicError:
        raise
    except Exception as error:  # it trusts the parts of a workbook, so that damage raises anything
        what = " ".join(str(error).split())[:80] or type(error).__name__
        raise source.error(expected="a whole Excel workbook", found=f"damage ({what})") from None


def _check_parts(source: Source) -> None:
    """CaptureError if a part claims to unpack to too much; zipfile reads no more than a part claims."""
    from openpyxl.xml.functions import fromstring  # noqa: PLC0415 (an extra)

    with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
        sizes = {part.filename: part.file_size for part in archive.infolist()}
        _check_size(source, _TYPES, sizes[_TYPES], _MAX_PART)
        declared = [dict(element.attrib) for element in fromstring(archive.read(_TYPES))]
    types: dict[str, set[str]] = {}
    for one in declared:
        types.setdefault(one.get("PartName", "")[1:], set()).add(one.get("ContentType", ""))
    for name, size in sizes.items():
        _check_size(source, name, size, _MAX_SHEET if types.get(name) == {_SHEET} else _MAX_PART)


def _check_size(source: Source, part: str, size: int, most: int) -> None:
    if size > most:
        raise source.error(
            expected=f"a workbook with at most {most >> 20:,} MB in {part[:60]}, unpacked",
            found=f"{size >> 20:,}",
        )


def _group(name: str) -> int:
    words = set(words_of(name))
    places, others = not words.isdisjoint(_PLACES), not words.isdisjoint(_OTHERS)
    return 1 if places == others else 0 if places else 2


def _text_of(cell: Any) -> str:
    """A cell as in a file of CSV; a line break within it as a blank, an error (#N/A) as nothing."""
    if cell is None:
        return ""
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, date | time):
        return cell.isoformat()
    text = " ".join(str(cell).splitlines())
    return "" if text.startswith("#") and text.rstrip("!?") in _ERRORS else text


def _rates(rows: Sequence[Row]) -> set[float]:
    """The possible frame rates beside or below cells that name one; none in a table, or over a column."""
    found = set()
    for at, row in enumerate(rows):
        for column, cell in enumerate(row if len(row) <= _RATE_CELLS else ()):
            if isinstance(cell, str) and _names_frame_rate(cell):
                below = [
                    other[column : column + 1] for other in rows[at + 1 : at + 3] if len(other) <= _RATE_CELLS
                ]
                values = [_rate_of(one[0]) for one in below if one]
                alone = values[:1] if len([value for value in values if value is not None]) < 2 else []
                found |= {*map(_rate_of, row[column + 1 : column + 2]), *alone}
    return {rate for rate in found if rate is not None}


def _names_frame_rate(cell: str) -> bool:
    words = [word for word in words_of(cell) if word != "hz"]
    return is_rate(" ".join(words)) and "sampl" not in "".join(words)


def _rate_of(cell: Any) -> float | None:
    """The number of frames per second in a cell."""
    match = _VALUE.fullmatch(str(cell))
    rate = to_number(match[1].replace(",", ".")) if match else None
    return rate if rate is not None and LOWEST <= rate <= HIGHEST else None

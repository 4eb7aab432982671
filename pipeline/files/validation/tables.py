"""Read Parquet that may be damaged: one error for pyarrow's many, and checked columns of numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.validation.bounded import require_regular
from kinemimic.pipeline.files.validation.strict_json import strict_json

_CELLS = 1 << 28  # 2 GB of doubles: twelve hours of a clip at 30 Hz
_LARGEST = 1e12  # seconds, metres or radians; larger values come from damaged bits
_DAMAGE = (pa.ArrowException, OSError, ValueError, TypeError, IndexError, OverflowError, MemoryError)


@contextmanager
def open_table(path: Path, *, kind: str, advice: str) -> Iterator[tuple[pq.ParquetFile, Any]]:
    """A Parquet file and the JSON value of its metadata key `kinemimic`, or None without that key.

    kind, advice: description of the file and remedy, for errors. FileNotFoundError if it is missing,
    CaptureError if it is damaged, too large or not a table, and for errors of the block that damage causes.
    """
    require_regular(path, kind)
    # An open file: pyarrow refuses paths that are not UTF-8. Without threads, here and in all reads of it: a
    # thread of pyarrow that still holds a Python file when the interpreter exits can abort the process.
    with path.open("rb") as stream:
        try:
            file = pq.ParquetFile(stream, pre_buffer=False)
            rows, columns = file.metadata.num_rows, file.metadata.num_columns
            if rows * columns > _CELLS:
                raise ValueError(f"{rows:,} rows of {columns:,} columns, more than fit into memory")
            header = (file.schema_arrow.metadata or {}).get(b"kinemimic")
            # In our own header NaN means an unknown offset.
            yield file, None if header is None else strict_json(header.decode("utf-8"), finite=False)
        except KinemimicError:
            raise
        except KeyError as error:
            found = f"no key {error} in its header"
            raise CaptureError(path, expected=kind, found=found, advice=advice) from None
        # pyarrow reports damage by any of these, and trusts the lengths in a damaged file.
        except _DAMAGE as error:
            # Our own errors are plain ones.
            found = str(error) if type(error) is ValueError else "a damaged file, or no Parquet"
            raise CaptureError(path, expected=kind, found=found, advice=advice) from None


def read_table(path: Path, *, kind: str, advice: str) -> tuple[pa.Table, Any]:
    """The whole table of `open_table`, and its header."""
    with open_table(path, kind=kind, advice=advice) as (file, header):
        return file.read(use_threads=False), header


def numbers(table: pa.Table, name: str, kinds: str = "f") -> NDArray[Any]:
    """A column (T,) without nulls, in its stored type.

    ValueError if there is no column of that name and kind.

    kinds: numpy dtype kinds, of f, i, u, b. NaN is allowed, infinity is not.
    """
    if table.column_names.count(name) != 1:
        raise ValueError(f"{table.column_names.count(name)} columns {name!r}")
    column = table[name]
    if column.null_count:
        raise ValueError(f"column {name!r} with nulls")
    return _plausible(np.asarray(column.to_numpy()), column, name, kinds)


def lists(file: pq.ParquetFile, name: str, width: int, kinds: str = "f") -> NDArray[Any] | None:
    """A column of lists of `width` numbers each, as an array (T, width); None if it has nulls only.

    Read one row group at a time, which bounds the memory. ValueError as `numbers`, and for other lengths.
    """
    rows = file.metadata.num_rows
    if rows * width > _CELLS:
        raise ValueError(f"{rows:,} rows of {width:,} numbers, more than fit into memory")
    field = file.schema_arrow.field(name) if name in file.schema_arrow.names else None
    if field is None or not pa.types.is_list(field.type):
        raise ValueError(f"no column {name!r} of lists")
    whole, start = None, 0
    place = [column.path.partition(".")[0] for column in file.schema].index(name)
    for group in range(file.num_row_groups):
        found = file.metadata.row_group(group)
        if found.column(place).num_values > found.num_rows * max(width, 1):
            raise ValueError(f"column {name!r} without {width} numbers in every row")
        column = file.read_row_group(group, [name], use_threads=False).column(0).combine_chunks()
        if column.null_count == len(column) and whole is None:
            start += len(column)
            continue
        values = column.flatten()
        lengths = np.diff(np.asarray(column.offsets))
        partly = whole is None and start > 0
        if partly or column.null_count or values.null_count or (lengths != width).any():
            raise ValueError(f"column {name!r} without {width} numbers in every row")
        part = _plausible(np.asarray(values), column, name, kinds).reshape(-1, width)
        if whole is None:
            whole = np.empty((rows, width), dtype=part.dtype)
        whole[start : start + len(part)] = part
        start += len(part)
    return whole


def _plausible(array: NDArray[Any], column: Any, name: str, kinds: str) -> NDArray[Any]:
    if array.dtype.kind not in kinds:
        raise ValueError(f"column {name!r} of {column.type}")
    if (np.abs(array) > _LARGEST).any():
        raise ValueError(f"column {name!r} with implausibly large numbers")
    return array

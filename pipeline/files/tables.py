"""Parquet that may be damaged: pyarrow's many errors as one line, and its columns as checked numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.bounded import require_regular
from kinemimic.pipeline.files.plain_json import plain_json

_CELLS = 1 << 28  # 2 GB of doubles: twelve hours of a clip at 30 Hz
_LARGEST = 1e12  # of seconds, metres or radians; a flipped bit makes more of them
_SHOWN = 160  # characters of what pyarrow says


def read_table(path: Path, *, kind: str, advice: str) -> tuple[pa.Table, Any]:
    """A table and the JSON value of its metadata's key `kinemimic`, None where there is no such key.

    kind, advice: what the file should hold and what helps, for people. FileNotFoundError if there is none,
    CaptureError for what is damaged, too large or no table.
    """
    require_regular(path, kind)
    # An open file: pyarrow takes no path that is not UTF-8.
    with path.open("rb") as stream:
        try:
            file = pq.ParquetFile(stream)
            rows, columns = file.metadata.num_rows, file.metadata.num_columns
            if rows * columns > _CELLS:
                raise ValueError(f"{rows:,} rows of {columns:,} columns, more than fit into memory")
            table = file.read()
            told = (table.schema.metadata or {}).get(b"kinemimic")
            # In our own header NaN stands for an offset that is not known.
            return table, None if told is None else plain_json(told.decode("utf-8"), finite=False)
        # Of damage pyarrow tells in any of these; and what it is told of lengths, it believes.
        except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
            found = " ".join(str(error).split())[:_SHOWN]
            raise CaptureError(path, expected=kind, found=found, advice=advice) from None


def numbers(table: pa.Table, name: str, kinds: str = "f") -> NDArray[Any]:
    """A column (T,) without nulls, as it is stored; ValueError if there is none of that name and kind.

    kinds: of numpy's dtypes: f, i, u. NaN may be among them, infinity not.
    """
    if table.column_names.count(name) != 1:
        raise ValueError(f"{table.column_names.count(name)} columns {name!r}")
    column = table[name]
    if column.null_count:
        raise ValueError(f"column {name!r} with nulls")
    array = np.asarray(column.to_numpy())
    if array.dtype.kind not in kinds:
        raise ValueError(f"column {name!r} of {column.type}")
    if (np.abs(array) > _LARGEST).any():
        raise ValueError(f"column {name!r} with numbers that nobody measures")
    return array

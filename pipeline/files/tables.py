"""Read Parquet that may be damaged: one error for pyarrow's many, and checked columns of numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.bounded import require_regular
from kinemimic.pipeline.files.strict_json import strict_json

_CELLS = 1 << 28  # 2 GB of doubles: twelve hours of a clip at 30 Hz
_LARGEST = 1e12  # seconds, metres or radians; larger values come from damaged bits
_SHOWN = 160  # characters of pyarrow's message


def read_table(path: Path, *, kind: str, advice: str) -> tuple[pa.Table, Any]:
    """A table and the JSON value of its metadata key `kinemimic`, or None without that key.

    kind, advice: description of the file and remedy, for errors. FileNotFoundError if it is missing,
    CaptureError if it is damaged, too large or not a table.
    """
    require_regular(path, kind)
    # An open file: pyarrow refuses paths that are not UTF-8.
    with path.open("rb") as stream:
        try:
            file = pq.ParquetFile(stream)
            rows, columns = file.metadata.num_rows, file.metadata.num_columns
            if rows * columns > _CELLS:
                raise ValueError(f"{rows:,} rows of {columns:,} columns, more than fit into memory")
            table = file.read()
            header = (table.schema.metadata or {}).get(b"kinemimic")
            # In our own header NaN means an unknown offset.
            return table, None if header is None else strict_json(header.decode("utf-8"), finite=False)
        # pyarrow reports damage by any of these, and trusts the lengths in a damaged file.
        except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
            found = " ".join(str(error).split())[:_SHOWN]
            raise CaptureError(path, expected=kind, found=found, advice=advice) from None


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
    array = np.asarray(column.to_numpy())
    if array.dtype.kind not in kinds:
        raise ValueError(f"column {name!r} of {column.type}")
    if (np.abs(array) > _LARGEST).any():
        raise ValueError(f"column {name!r} with implausibly large numbers")
    return array

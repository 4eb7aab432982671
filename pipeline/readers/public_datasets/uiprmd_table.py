"""The headerless tables of UI-PRMD's files; for both readers."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.base.numbers import Table, numbers_of
from kinemimic.pipeline.readers.base.source import Source


def head_of_numbers(source: Source, width: int) -> Array | None:
    """The first lines as (n, width / 3, 3), or None if one of them is not `width` comma-separated numbers.

    The last line of a head may be cut off, so it counts only if it is the only one.
    """
    lines = source.head[:-1] if len(source.head) > 1 else source.head
    rows = [row for line in lines[:16] if (row := numbers_of(line, ",")) is not None and len(row) == width]
    if len(rows) < len(lines[:16]):
        return None
    head = np.array(rows).reshape(len(rows), -1, 3)
    return np.where(np.isfinite(head), head, 0.0)


def triplets(table: Table) -> Array:
    """The numbers as (T, width / 3, 3)."""
    return table.values.reshape(len(table.values), -1, 3)

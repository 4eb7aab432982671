"""Lines of numbers to an array, fast, with the line of the first mistake in the error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError

Array = NDArray[np.float64]

# Lines are converted so many at a time: a token takes ten times the memory of its number.
_CHUNK = 4096


class Row(NamedTuple):
    """A line of the file: its number, counted from 1, and its text."""

    number: int
    text: str


def parse_rows(rows: Sequence[Row], width: int, path: Path) -> Array:
    """Numbers (rows, width); CaptureError names the first line with another count or with no number.

    NaN and infinities pass; the caller knows what they mean.
    """
    values = np.empty((len(rows), width))
    for start in range(0, len(rows), _CHUNK):
        chunk = rows[start : start + _CHUNK]
        tokens = [row.text.split() for row in chunk]
        for row, fields in zip(chunk, tokens, strict=True):
            if len(fields) != width:
                last = start + _CHUNK >= len(rows) and row is chunk[-1] and len(fields) < width
                raise CaptureError(
                    path,
                    expected=f"{width} numbers",
                    found=f"{len(fields)}",
                    where=f"line {row.number}",
                    advice="the file is cut off there" if last else None,
                )
        try:
            values[start : start + len(chunk)] = np.array(tokens, dtype=np.float64)
        except ValueError:
            _complain(chunk, tokens, path)
    return values


def _complain(rows: Sequence[Row], tokens: Sequence[Sequence[str]], path: Path) -> None:
    for row, fields in zip(rows, tokens, strict=True):
        for field in fields:
            try:
                float(field)
            except ValueError:
                raise CaptureError(
                    path, expected="a number", found=f"{field[:40]!r}", where=f"line {row.number}"
                ) from None

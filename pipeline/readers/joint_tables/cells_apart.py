"""Tables whose cells are whole places, as tuples, lists, arrays and dictionaries of Python: "(x, y, z)"."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

from kinemimic.pipeline.readers.base.source import Source

_SEPARATORS = (",", ";", "\t")
_NUMBERS = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|\bnan\b", re.IGNORECASE)
# What is left of a place without its numbers.
_AROUND = re.compile(r"\s*(?:array)?[\[({][\[\](){}xyz'\":=,;\s]*[\])}]\s*", re.IGNORECASE)
_LONGEST = 200  # characters
_AXES = "xyz"
# Places in a row of a body.
_FEWEST = 8


def with_cells_apart(source: Source) -> Source:
    """The source with a column for each axis of such cells, named after theirs; itself without them."""
    head = source.head
    if len(head) < 2 or not any(mark in head[1] for mark in "[({"):
        return source
    separator = max(_SEPARATORS, key=head[0].count)
    try:
        rows = list(csv.reader(source.lines, delimiter=separator))
    except csv.Error:
        return source
    if len(rows) != len(source.lines):  # a cell goes on in the next line
        return source
    first = source.blank_lines
    names, following = rows[first], [row for row in rows[first + 1 :] if row]
    places = {k for row in following[:64] for k, cell in enumerate(row) if _place(cell)}
    if len(places) < _FEWEST or max(places) >= len(names):
        return source
    header = [
        f"{name}_{axis}" if axis else name for k, name in enumerate(names) for axis in _axes(k in places)
    ]
    lines = [_joined(_apart(row, places), separator) for row in rows[first + 1 :]]
    return source.with_text("\n".join([*source.lines[:first], _joined(header, separator), *lines]))


def _axes(is_place: bool) -> str | tuple[str]:
    return _AXES if is_place else ("",)


def _place(cell: str) -> list[str]:
    """The three numbers of a cell, without a confidence behind them; none of another cell."""
    if len(cell) > _LONGEST or _AROUND.fullmatch(_NUMBERS.sub("", cell)) is None:
        return []
    numbers = _NUMBERS.findall(cell)
    return numbers[: len(_AXES)] if len(_AXES) <= len(numbers) <= len(_AXES) + 1 else []


def _apart(row: Sequence[str], places: set[int]) -> list[str]:
    cells: list[str] = []
    for k, cell in enumerate(row):
        cells += (_place(cell) or [""] * len(_AXES)) if k in places else [cell]
    return cells


def _joined(cells: Sequence[str], separator: str) -> str:
    return separator.join(f'"{cell}"' if separator in cell else cell for cell in cells)

"""Sections of a table that Vicon Nexus exported (ASCII, CSV).

A section is a title ("Trajectories", "Model Outputs"), the rate, a line of names, each above the first of its
columns, a line of components under "Frame,Sub Frame" (X Y Z, or RX RY RZ TX TY TZ SX SY SZ), a line of units,
and a line per frame, up to a blank line or the end of the file. Cells without a measurement are empty.

Vicon's older programs (Workstation, Nexus 1) write the title in capitals, "Field #" in place of "Frame,Sub
Frame", and no line of units: lengths are in mm.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.base.numbers import Table, parse_sparse_table, to_number
from kinemimic.pipeline.readers.base.source import Source

TRAJECTORIES, MODEL_OUTPUTS = "Trajectories", "Model Outputs"
TITLES: tuple[str, ...] = (TRAJECTORIES, MODEL_OUTPUTS, "Joints", "Segments", "Devices", "Events", "Analysis")
# What stands beside the components, above the frames' numbers; and in files of older programs.
FRAME, FIELD = ("Frame", "Sub Frame"), ("Field #",)
_EVENTS = ("Subject", "Context", "Name")
# Of lengths in files of older programs.
_UNIT = "mm"
_MAX_RATE = 10_000.0
# A day at that rate; beyond, times could not be told apart.
_MAX_FRAME = 1e9


@dataclass(frozen=True)
class Item:
    """A name of the third line: its subject ("" without one), its name, its columns, their components and
    units."""

    subject: str
    name: str
    columns: slice
    components: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True)
class Section:
    """rate: Hz; items: in the order of the columns; frames: (T,) numbers; values: (T, columns), NaN where
    empty."""

    title: str
    rate: float
    items: tuple[Item, ...]
    frames: Array
    values: Array
    table: Table


def separator_of(source: Source) -> str:
    """The separator: the most frequent one in the line of components, or in that above the events."""
    line = next((line for line in source.head if is_components(line) or is_events(line)), source.head[0])
    return max(",\t;", key=line.count)


def is_components(line: str) -> bool:
    """Whether a line may be that of the components."""
    return line.replace('"', "").lstrip().startswith((FRAME[0], FIELD[0]))


def is_events(line: str) -> bool:
    """Whether a line may be that above the events, which come before everything else."""
    words = re.split(r"[,;\t]", line.replace('"', ""))
    return [word.strip() for word in words[: len(_EVENTS)]] == [*_EVENTS]


def title_of(line: str, separator: str) -> str | None:
    """The title of the section that begins with this line, or None."""
    first = line[:20].partition(separator)[0].strip().strip('"').title()
    return first if first in TITLES else None


def titles(lines: Sequence[str], separator: str) -> list[tuple[int, str]]:
    """The lines (from 0) that begin a section, and their titles."""
    found = ((number, title_of(line, separator)) for number, line in enumerate(lines))
    return [(number, title) for number, title in found if title is not None]


def read_section(source: Source, start: int, title: str) -> Section:
    """The section that begins on line `start` (from 0).

    Raises CaptureError for a damaged header, and a table that is not one of numbers.
    """
    separator = separator_of(source)
    if len(source.lines) < start + 6:
        raise source.error(expected=f"{title}: four lines of header and frames", found="the end of the file")
    rate = to_number(source.lines[start + 1].split(separator)[0].strip())
    if rate is None or not 0.0 < rate <= _MAX_RATE:
        raise source.error(
            expected=f"{title}: a rate in Hz", found=repr(source.lines[start + 1][:20]), line=start + 2
        )
    names, components, units = (
        [cell.strip().strip('"') for cell in source.lines[start + k].split(separator)] for k in (2, 3, 4)
    )
    lead = next((lead for lead in (FRAME, FIELD) if tuple(components[: len(lead)]) == lead), None)
    if lead is None:
        raise source.error(
            expected=f"{title}: Frame and Sub Frame", found=repr(components[:2]), line=start + 4
        )
    while components and not components[-1]:
        components.pop()
    width = len(components)
    first = start + 5
    if lead == FIELD:
        units, first = [_UNIT] * width, start + 4
    end = next((k for k in range(first, len(source.lines)) if _ends(source.lines[k], separator)), None)
    # Trailing separators come and go with a spreadsheet; a row keeps as many cells as there are components.
    rows = [_cells(line, separator, width) for line in source.lines[first:end]]
    content = "\n" * first + "\n".join(rows)
    table = parse_sparse_table(
        source.with_text(content),
        start=first,
        width=width,
        separator=separator,
    )
    frames = table.values[:, 0]
    wrong = ~(np.abs(frames) <= _MAX_FRAME)  # NaN too
    if wrong.any():
        bad = int(np.argmax(wrong))
        found = "none" if np.isnan(frames[bad]) else f"{frames[bad]:g}"
        raise source.error(expected="a frame's number", found=found, line=table.line(bad))
    items = _items(names, components, units + [""] * width, len(lead), source, start)
    return Section(title, rate, items, frames, table.values, table)


def _ends(line: str, separator: str) -> bool:
    """Whether a line is blank, or the title of the next section."""
    return not line.strip(separator + " ") or title_of(line, separator) is not None


def _cells(line: str, separator: str, width: int) -> str:
    """The line without empty cells beyond the width."""
    cells = line.split(separator)
    while len(cells) > width and not cells[-1].strip():
        cells.pop()
    return separator.join(cells)


def _items(
    names: list[str], components: list[str], units: list[str], lead: int, source: Source, start: int
) -> tuple[Item, ...]:
    """lead: how many columns are before the first item's."""
    begins = [k for k, name in enumerate(names[: len(components)]) if name and k >= lead]
    if not begins:
        raise source.error(expected="names of markers or outputs", found="none", line=start + 3)
    items = []
    for begin, end in zip(begins, [*begins[1:], len(components)], strict=True):
        subject, colon, name = names[begin].rpartition(":")
        columns = slice(begin, end)
        items.append(
            Item(
                subject if colon else "",
                name,
                columns,
                tuple(components[columns]),
                tuple(unit.lower() for unit in units[columns]),
            )
        )
    return tuple(items)

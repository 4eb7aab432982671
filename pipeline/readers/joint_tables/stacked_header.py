"""Headers in several lines, as spreadsheets, pandas and Visual3D have them: the joint above the axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source

_SEPARATORS = (",", ";", "\t")
# Lines in which the first numbers stand, and lines of one header.
_SEARCHED, _MOST_LINES = 64, 5
# Fewer columns are no body.
_FEWEST_COLUMNS = 3 * 5


def with_one_header(source: Source) -> Source:
    """The source with the lines of a header joined in the last of them; itself if there is one line at most.

    An upper line names groups: where most of its cells are empty, each name holds for the columns up to the
    next one. Names of the same column are joined by a blank. A line that says the same of all columns (the
    file, the unit) tells nothing, and is left out.
    """
    lines = list(islice(source.lines, _SEARCHED))
    separator = max(_SEPARATORS, key=lambda mark: sum(line.count(mark) for line in lines))
    rows = [[cell.strip().strip('"').strip() for cell in line.split(separator)] for line in lines]
    first = next((k for k, row in enumerate(rows) if len(row) >= _FEWEST_COLUMNS and is_data(row)), 0)
    width = len(rows[first])
    begin = first
    while begin > 0 and first - begin < _MOST_LINES and len(rows[begin - 1]) == width:
        begin -= 1
    header = [row for row in rows[begin:first] if len(set(filter(None, row[1:]))) > 1]
    if not header or (len(header) == 1 and header[0] is rows[first - 1]):
        return source
    names = [" ".join(filter(None, parts)) for parts in zip(*_filled(header), strict=True)]
    end = max(k for k, cell in enumerate(header[-1]) if cell) + 1
    names[end:] = [""] * (width - end)  # of separators at the end of each line
    labels = next((row for row in rows[begin:first] if sum(map(bool, row)) == 1), None)
    if labels is not None:  # pandas names the index in a line of its own
        names = [label or name for label, name in zip(labels, names, strict=True)]
    joined = separator.join(f'"{name}"' if separator in name else name for name in names)
    blank = [""] * (first - 1 - begin)
    return source.with_text("\n".join([*source.lines[:begin], *blank, joined, *source.lines[first:]]))


def is_data(row: Sequence[str]) -> bool:
    """Whether most cells of a row are numbers."""
    numbers = sum(to_number(cell.replace(",", ".")) is not None for cell in row)
    return numbers > 0.5 * len(row)


def _filled(header: Sequence[Sequence[str]]) -> Iterator[list[str]]:
    """The lines, with the names of groups in all of their columns."""
    for row in header[:-1]:
        name, names = "", []
        for cell in row:
            name = cell or name
            names.append(name)
        yield names
    yield list(header[-1])

"""Numbers for the words in a table of numbers: dates, and names such as the video's or a landmark's."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.dates import seconds_of_dates

# That show which columns hold words.
_ROWS = 64


def with_numbers_for_words(
    source: Source,
    line: int,
    separator: str,
    *,
    numeric: Collection[int],
    times: Collection[int],
    known: Mapping[int, Mapping[str, int]],
) -> Source:
    """The table after the header in this line, with a number for each word.

    It is the one in `known` of its column, spelt in lower case with underscores, else that of its first
    appearance there. numeric: columns in which a word is a mistake, and stays; times: columns in which it is
    a date, for which seconds stand then, or a mistake. Itself if no other column holds words alone.
    """
    first = [row.split(separator) for row in source.lines[line : line + _ROWS]]
    columns = [
        column
        for column in range(max(map(len, first), default=0))
        if column not in numeric and _holds_words(row[column].strip() for row in first if column < len(row))
    ]
    if not columns:
        return source
    rows = [text.split(separator, columns[-1] + 1) for text in source.lines[line:]]
    for column in columns:
        filled = [row for row in rows if column < len(row) and row[column].strip()]
        words = [row[column].strip().strip('"') for row in filled]
        numbers = _seconds(words) if column in times else _codes(words, known.get(column))
        for row, number in zip(filled, numbers, strict=True):
            if number is not None:
                row[column] = repr(number)
    return source.with_text("\n".join([*source.lines[:line], *(separator.join(row) for row in rows)]))


def _holds_words(cells: Iterable[str]) -> bool:
    # Numbers may have decimal commas.
    filled = [cell.replace(",", ".") for cell in cells if cell]
    return bool(filled) and all(to_number(cell) is None for cell in filled)


def _seconds(words: Sequence[str]) -> list[float | None]:
    """The seconds of each date; None for another word."""
    return [seconds if math.isfinite(seconds) else None for seconds in seconds_of_dates(words)]


def _codes(words: Sequence[str], known: Mapping[str, int] | None) -> list[float | None]:
    """The known number of each word, None without one; if none are known, that of its first appearance."""
    if known is not None:
        return [known.get(word.lower().replace(" ", "_"), to_number(word)) for word in words]
    codes: dict[str, int] = {}
    return [codes.setdefault(word, len(codes)) for word in words]

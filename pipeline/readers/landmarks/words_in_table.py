"""Numbers for the words in a table of numbers, such as the video's name or a landmark's."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from kinemimic.pipeline.readers.base.numbers import decimal_points, to_number
from kinemimic.pipeline.readers.base.source import Source

# That show which columns hold words.
_ROWS = 64


def with_numbers_for_words(
    source: Source,
    line: int,
    separator: str,
    *,
    numeric: Collection[int],
    known: Mapping[int, Mapping[str, int]],
) -> Source:
    """The table after the header in this line, with a number for each word: the one in `known` of its column,
    spelt in lower case with underscores, else that of its first appearance there.

    numeric: columns in which a word is a mistake, and stays. Itself if no other column holds words alone.
    """
    rows = [
        row.split(separator) for row in decimal_points(source, separator, line).lines[line : line + _ROWS]
    ]
    columns = [
        column
        for column in range(max(map(len, rows), default=0))
        if column not in numeric and _holds_words(row[column].strip() for row in rows if column < len(row))
    ]
    if not columns:
        return source
    codes: dict[int, dict[str, int]] = {column: dict(known.get(column, {})) for column in columns}
    lines = []
    for text in source.lines[line:]:
        cells = text.split(separator)
        for column in columns:
            word = cells[column].strip().strip('"').lower() if column < len(cells) else ""
            if not word or to_number(word) is not None:
                continue
            number = codes[column].get(word.replace(" ", "_"))
            if number is None and column not in known:
                number = codes[column].setdefault(word, len(codes[column]))
            if number is not None:
                cells[column] = str(number)
        lines.append(separator.join(cells))
    return source.with_text("\n".join([*source.lines[:line], *lines]))


def _holds_words(cells: Iterable[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return bool(filled) and all(to_number(cell) is None for cell in filled)

"""The rows of a joint table that are about one person: from when somebody is seen, and of one of several."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.numbers import is_empty, to_number
from kinemimic.pipeline.readers.base.people import found_again, new_numbers, other_people
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import says_time
from kinemimic.pipeline.readers.clocks.video_clock import is_frame_number
from kinemimic.pipeline.readers.custom_table.description import Description
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet
from kinemimic.pipeline.readers.custom_table.table import Cells, Words
from kinemimic.pipeline.readers.landmarks.one_person import is_person

_SEPARATORS = (",", ";", "\t")
# Cells of a row of a whole body; the share of them that is empty or zero where nobody is seen: quaternions of
# joints leave a seventh.
_FEWEST_CELLS, _NOTHING = 15, 0.8
# Rows that show whether somebody is seen from the beginning.
_SEARCHED = 64


def from_first_body(source: Source) -> Source:
    """The source with blank lines for the rows before somebody is seen: many recorders begin with such."""
    mark = max(_SEPARATORS, key=source.head[0].count)
    separator = mark if mark in source.head[-1] else None  # else white space
    begin = None
    for number, line in enumerate(source.lines):
        shows = _shows_body(line.split(separator))
        if shows is None and begin is None and number < _SEARCHED:
            continue  # above the rows
        if shows is None:
            break
        begin = number if begin is None else begin
        if shows:
            lines = [*source.lines[:begin], *[""] * (number - begin), *source.lines[number:]]
            return source if number == begin else source.with_text("\n".join(lines))
    return source


def _shows_body(cells: list[str]) -> bool | None:
    """Whether a row shows somebody; None if it is no row of a whole body's numbers."""
    empty = sum(map(is_empty, cells))
    numbers = [to_number(cell.replace(",", ".")) for cell in cells if not is_empty(cell)]
    known = [value for value in numbers if value is not None]
    if len(cells) < _FEWEST_CELLS or not known or empty + len(known) < 0.5 * len(cells):
        return None
    return sum(value != 0.0 and math.isfinite(value) for value in known) > (1.0 - _NOTHING) * len(cells)


def of_one_person(
    source: Source, sheet: Sheet, description: Description, called: str
) -> tuple[Source, list[Defect]]:
    """The source with the rows of one person, blank lines in place of the others; and a defect for these.

    It is the one who is seen in most rows: some recorders write zeros for people who are not there. called:
    the description, in messages.
    """
    column = next((k for k, name in enumerate(sheet.names) if is_person(name)), None)
    if column is None:
        return source, []
    cells = Cells(source, description.text, called)
    clock = next(
        (k for k, name in enumerate(sheet.names) if says_time(name) or is_frame_number(name)), column
    )
    places = [[cells.index(one, "columns") for one in joint.position] for joint in description.joints]
    numbers = sorted({one for place in places for one in place})
    values, texts = cells.read(numbers, sorted({column, clock}))
    by_column = dict(zip(sorted({column, clock}), texts, strict=True))
    moments = _moments(by_column[clock]) if clock != column else np.arange(len(values), dtype=np.float64)
    points = values[:, [[numbers.index(one) for one in place] for place in places]]
    same = found_again(moments, by_column[column].codes, points)
    people = np.array([same.get(code, code) for code in by_column[column].codes.tolist()], dtype=np.intp)
    seen = np.asarray((np.isfinite(values) & (values != 0.0)).any(axis=1))
    count = Counter(people[seen].tolist())
    if not count or (people == people[0]).all():
        return source, new_numbers(same)
    main = count.most_common(1)[0][0]
    dropped = set(np.array(cells.lines_of_rows())[people != main].tolist())
    lines = ["" if number in dropped else line for number, line in enumerate(source.lines, 1)]
    frames: dict[float, set[int]] = {}
    for moment, person in zip(moments[seen].tolist(), people[seen].tolist(), strict=True):
        frames.setdefault(moment, set()).add(person)
    others = other_people(list(frames.values()), main)
    return source.with_text("\n".join(lines)), [*new_numbers(same), *others]


def _moments(words: Words) -> Array:
    """The times or frame numbers (R,) in a column of words; of other words, their order in the file."""
    known = [to_number(word.replace(",", ".")) for word in words.known[1:]]
    if all(one is not None and math.isfinite(one) for one in known):
        return np.array([np.nan, *known], dtype=np.float64)[words.codes]
    _, rows, ranks = np.unique(words.codes, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(rows))[ranks].astype(np.float64)

"""The rows of a joint table that are about one person: from when somebody is seen, and of one of several."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.numbers import is_empty, to_number
from kinemimic.pipeline.readers.base.people import found_again, other_people
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import says_time
from kinemimic.pipeline.readers.clocks.dates import seconds_of_dates
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
    moments = _moments(by_column[clock]) if clock != column else np.full(len(values), np.nan)
    points = values[:, [[numbers.index(one) for one in place] for place in places]]
    found = found_again(moments, by_column[column].codes, points)
    people = np.where(found.kept, found.people, -1)  # the code of nobody
    seen = np.asarray((np.isfinite(values) & (values != 0.0)).any(axis=1))
    count = Counter(people[seen].tolist())
    if not count or (people == people[0]).all():
        return source, found.defects()
    main = count.most_common(1)[0][0]
    dropped = set(np.array(cells.lines_of_rows())[people != main].tolist())
    lines = ["" if number in dropped else line for number, line in enumerate(source.lines, 1)]
    frames: dict[int, set[int]] = {}
    rows = by_column[clock].codes if clock != column else np.arange(len(people))
    for moment, person in zip(rows[seen].tolist(), people[seen].tolist(), strict=True):
        frames.setdefault(moment, set()).add(person)
    others = other_people(list(frames.values()), main, by_column[column].known[main])
    return source.with_text("\n".join(lines)), [*found.defects(), *others]


def _moments(words: Words) -> Array:
    """The times, dates or frame numbers (R,) in a column of words, NaN for other words."""
    known = [to_number(word.replace(",", ".")) for word in words.known[1:]]
    seconds = [*seconds_of_dates(words.known[1:])] if None in known else known
    return np.array([np.nan, *seconds], dtype=np.float64)[words.codes]

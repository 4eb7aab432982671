"""The rows of one person in a table, or a list, in which every person of a frame has a row."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.people import found_again, other_people
from kinemimic.pipeline.readers.clocks.clock import clock_of
from kinemimic.pipeline.readers.clocks.video_clock import is_frame_number

_PERSON = re.compile(
    r"(?:person|people|body|user|player|subject|skeleton|human|track(?:ing)?)(?:id|idx|index|no|nr|num|number)?"
    r"|pose(?:id|idx|index|num|number)"
)
# Share of rows at the time of the row before, from which they are people and not a stutter of the clock.
_SECOND_ROWS = 0.1
# Rows of a moment in the mean, of which more are no people: the number changes too rarely to be of a frame.
_MOST_PEOPLE = 10


def rows_of_one_person(beside: Mapping[str, Array], points: Array) -> tuple[NDArray[np.intp], list[Defect]]:
    """The rows of the person who is seen in most, in the order of the file, and a defect for the others.

    beside: name -> a number of each row (R,); points: (R, J, 3), NaN where nobody is seen. People are told by
    the column that numbers them, else by the place of a row among those of the same frame. Rows without a
    number are kept: nobody is seen there.
    """
    everyone = np.arange(len(points))
    moments = _moments(beside, len(points))
    people = _numbered(beside)
    if people is None:
        people = _in_order(moments, points)
    if people is None:
        return everyone, []
    known = np.isfinite(people)
    found = found_again(moments[known], people[known].astype(np.int64), points[known])
    main = Counter(found.people[found.kept].tolist()).most_common(1)[0][0]
    own = ~known
    own[known] = found.kept & (found.people == main)
    seen: dict[float, set[int]] = {}
    for moment, person in zip(moments[known].tolist(), found.people.tolist(), strict=True):
        seen.setdefault(moment, set()).add(person)
    return np.flatnonzero(own), [*found.defects(), *other_people(list(seen.values()), main)]


def is_person(name: str) -> bool:
    """Whether a column or key calls itself the number of a person: "person_id", "trackId"."""
    return _PERSON.fullmatch("".join(words_of(name))) is not None


def _moments(beside: Mapping[str, Array], rows: int) -> Array:
    """What rows of the same frame have in common (R,): its number, else its time, else nothing."""
    for name in (*filter(is_frame_number, beside), clock_of(beside)):
        if name is not None and len(np.unique(beside[name])) * _MOST_PEOPLE >= rows:
            return beside[name]
    return np.arange(rows, dtype=np.float64)


def _numbered(beside: Mapping[str, Array]) -> Array | None:
    """The people's numbers in the column for them; None without one, or if it never repeats itself, as
    numbers of detections."""
    for name, values in beside.items():
        if is_person(name):
            known = values[np.abs(values) < 2.0**53]
            if 1 < len(np.unique(known)) < len(known):
                return np.where(np.abs(values) < 2.0**53, values, np.nan)
    return None


def _in_order(moments: Array, points: Array) -> Array | None:
    """The place of each row among those of the same moment; None if next to none is a second one. A row that
    only repeats the one before is not of another person."""
    again: Mask = np.concatenate([[False], moments[1:] == moments[:-1]])
    other = np.concatenate([[False], _differ(points[1:], points[:-1])])
    if (again & other).mean() <= _SECOND_ROWS:
        return None
    begins = np.flatnonzero(~again)
    first = np.repeat(begins, np.diff([*begins, len(moments)]))
    return (np.arange(len(moments)) - first).astype(np.float64)


def _differ(one: Array, other: Array) -> Mask:
    return np.asarray(((one != other) & ~(np.isnan(one) & np.isnan(other))).any(axis=(1, 2)))

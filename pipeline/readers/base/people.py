"""The person that a recording of several people is about, and the others."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect

_Body = TypeVar("_Body")
# A person who is lost is found again within so many steps of the clock (a second at 30 Hz), and so near, in
# sizes of the body: the estimate of a body half out of view, and what somebody runs in a step.
_LONGEST_LOSS = 30
_NEAR, _NEAR_PER_STEP = 0.2, 0.04
_MOST_NUMBERS = 1000


def other_people(people: Sequence[Collection[int]], main_person: int) -> Iterator[Defect]:
    """A defect for the bodies beside the main person; people: the numbers of the bodies in each frame.

    A body that is never seen together with the main person may be that person.
    """
    others = {body for bodies in people for body in bodies} - {main_person}
    if not others:
        return
    frames = [bodies for bodies in people if others.intersection(bodies)]
    seen_together = sum(main_person in bodies for bodies in frames)
    text = f"{len(others)} more in {len(frames)} frames, dropped; body {main_person} is seen in most"
    if seen_together:
        yield Defect("several_people", len(others), "people", "repaired", text)
    else:
        text += ", never together with them: they may be the same person, lost and found again"
        yield Defect("several_people", len(others), "people", "flagged", text)


def found_again(moments: Array, people: NDArray[np.intp], points: Array) -> dict[int, int]:
    """Number -> first number of the same person, for those whom a tracker lost and soon found again, and
    then numbered anew, as where somebody is hidden for a moment.

    moments: (R,) time or number of the frame in which a body is seen; people: (R,) its number; points:
    (R, J, 3) in any unit, NaN or zeros where it is not seen. The new number begins within a second at 30 Hz
    of where the old one ends, and its joints are near those of the old one.
    """
    numbers = np.unique(people)
    if not 1 < len(numbers) <= _MOST_NUMBERS:
        return {}
    places = np.where((points == 0.0).all(axis=-1, keepdims=True), np.nan, points)
    rows = np.flatnonzero(np.isfinite(places).all(axis=-1).any(axis=-1) & np.isfinite(moments))
    if not len(rows):
        return {}
    step, size = _step(moments[rows]), _size(places[rows])
    rows = rows[np.argsort(moments[rows], kind="stable")]
    first: dict[int, int] = {}  # number -> its first row, in the order of time
    last: dict[int, int] = {}
    for row, number in zip(rows.tolist(), people[rows].tolist(), strict=True):
        first.setdefault(number, row)
        last[number] = row
    same: dict[int, int] = {}
    ends: dict[int, int] = {}  # first number of a person -> the last row so far
    for number, begin in first.items():
        near = {}
        for person, end in ends.items():
            steps = float(moments[begin] - moments[end]) / step
            if 0.0 < steps <= _LONGEST_LOSS:
                moved = _distance(places[begin], places[end])
                if moved <= size * (_NEAR + _NEAR_PER_STEP * steps):
                    near[person] = moved
        person = min(near, key=lambda one: near[one], default=number)
        if person != number:
            same[number] = person
        ends[person] = last[number]
    return same


def renumbered(
    frames: Sequence[Mapping[int, _Body]], points: Callable[[_Body], Array | None]
) -> tuple[list[dict[int, _Body]], list[Defect]]:
    """The bodies of each frame under the first number of the same person (`found_again`), and a defect.

    frames: number -> body; points: of a body, (J, 3) in any unit, or None if it has none.
    """
    plain = [dict(bodies) for bodies in frames]
    if len({number for bodies in plain for number in bodies}) < 2:
        return plain, []
    seen = [
        (moment, number, place)
        for moment, bodies in enumerate(plain)
        for number, body in bodies.items()
        if (place := points(body)) is not None
    ]
    if len({place.shape for *_, place in seen}) != 1:
        return plain, []
    moments, people, places = (np.array(column) for column in zip(*seen, strict=True))
    same = found_again(moments.astype(np.float64), people, places)
    return [
        {same.get(number, number): body for number, body in bodies.items()} for bodies in plain
    ], new_numbers(same)


def new_numbers(same: Mapping[int, int]) -> list[Defect]:
    """A defect for people who were numbered anew; same: of `found_again`."""
    if not same:
        return []
    count = len(set(same.values()))
    who = "a person" if count == 1 else f"{count} people"
    text = f"{who} lost and found again under another number, soon and in the same place: taken as one"
    return [Defect("renumbered_people", len(same), "numbers", "repaired", text)]


def _step(moments: Array) -> float:
    """The median step of the clock."""
    steps = np.diff(np.unique(moments))
    return float(np.median(steps)) if len(steps) else 1.0


def _size(places: Array) -> float:
    """The usual largest extent of a body; places: (R, J, 3), each with a joint."""
    extents = np.nanmax(places, axis=1) - np.nanmin(places, axis=1)
    return float(np.median(extents.max(axis=-1)))


def _distance(one: Array, other: Array) -> float:
    """The median distance of the joints (J, 3) that are in both; infinite without any."""
    distances = np.linalg.norm(one - other, axis=-1)
    known = distances[np.isfinite(distances)]
    return float(np.median(known)) if len(known) else np.inf

"""The person that a recording of several people is about, and the others."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.vectors import median_distance
from kinemimic.pipeline.quality.rules.defect import Defect

_Body = TypeVar("_Body")
# A person who is lost is found again within so many steps of the clock (a second at 30 Hz), and so near to
# where they were, or would be if they had gone on, in sizes of the body.
_LONGEST_LOSS = 30
_NEAR, _NEAR_PER_STEP, _FARTHEST = 0.2, 0.02, 0.5
_ALIKE = 1.25  # largest ratio of the sizes of one person, who stands or crouches
# Bodies whose middle stays within this many sizes of the origin are given about their own hips.
_AT_ORIGIN = 0.1
_FEW = 10  # bodies at either side of a loss that show its speed and size
_MOST_NUMBERS = 1000
_HUGE = 1e9  # coordinates in any unit


@dataclass(frozen=True)
class FoundAgain:
    """same: number -> first number of that person; people: (R,) numbers with these in place; kept: (R,)
    False for a row without a place of a person whom another row of the same moment shows."""

    same: Mapping[int, int]
    people: NDArray[np.intp]
    kept: Mask

    def defects(self) -> list[Defect]:
        """A defect if anybody was numbered anew."""
        if not self.same:
            return []
        count = len(set(self.same.values()))
        who = "a person was" if count == 1 else f"{count} people were"
        taken = "taken as one person" if count == 1 else "each taken as one person"
        text = f"{who} lost and soon found again nearby under another number: {taken}"
        return [Defect("renumbered_people", len(self.same), "numbers", "repaired", text)]


def other_people(
    people: Sequence[Collection[int]], main_person: int, called: str | None = None
) -> Iterator[Defect]:
    """A defect for the bodies beside the main person; people: the numbers of the bodies in each frame.

    called: what the file calls the main person, where that is not the number. A body that is never seen
    together with the main person may be that person.
    """
    others = {body for bodies in people for body in bodies} - {main_person}
    if not others:
        return
    frames = [bodies for bodies in people if others.intersection(bodies)]
    seen_together = sum(main_person in bodies for bodies in frames)
    text = (
        f"{len(others)} more in {len(frames)} frames, dropped; body {called or main_person} is seen in most"
    )
    if seen_together:
        yield Defect("several_people", len(others), "people", "repaired", text)
    else:
        text += ", never together with them: they may be the same person, lost and found again"
        yield Defect("several_people", len(others), "people", "flagged", text)


def found_again(moments: Array, people: NDArray[np.intp], points: Array) -> FoundAgain:
    """Find people whom a tracker lost, soon found again and then numbered anew, as where somebody is hidden
    for a moment.

    moments: (R,) time or number of the frame in which a body is seen, in any unit; people: (R,) its number;
    points: (R, J, 3) in any unit, NaN or zeros where it is not seen. The new number begins within 30 median
    steps of the clock after the old one ends, within half a body of it, and the bodies are of one size. A
    number that comes back is not looked at twice. Bodies that stay about the origin show no place, and nobody
    among them is taken for another.
    """
    unchanged = FoundAgain({}, people, np.ones(len(people), dtype=np.bool_))
    if not 1 < len(np.unique(people)) <= _MOST_NUMBERS:
        return unchanged
    with np.errstate(invalid="ignore"):
        gone = ~(np.abs(points) < _HUGE).all(axis=-1) | (points == 0.0).all(axis=-1)
    places = np.where(gone[..., None], np.nan, points)
    seen = ~gone.all(axis=-1) & np.isfinite(moments)
    rows = np.flatnonzero(seen)
    rows = rows[np.argsort(moments[rows], kind="stable")]
    if not len(rows) or _about_origin(places[rows]):
        return unchanged
    step = _step(moments[rows])
    tracks: dict[int, list[int]] = {}  # number -> its rows, by the time of the first
    for row, number in zip(rows.tolist(), people[rows].tolist(), strict=True):
        tracks.setdefault(number, []).append(row)
    same: dict[int, int] = {}
    ends: dict[int, list[int]] = {}  # first number of a person -> the rows of the last number so far
    for number, track in tracks.items():
        distances = {
            person: _distance(moments, places, end[-_FEW:], track[:_FEW], step)
            for person, end in ends.items()
        }
        person = min(distances, key=lambda one: distances[one], default=number)
        if person != number and distances[person] <= 1.0:
            same[number] = person
        ends[same.get(number, number)] = track
    if not same:
        return unchanged
    merged = np.array([same.get(number, number) for number in people.tolist()])
    shown = set(zip(moments[seen].tolist(), merged[seen].tolist(), strict=True))
    pairs = zip(moments.tolist(), merged.tolist(), strict=True)
    elsewhere = np.array([pair in shown for pair in pairs])
    return FoundAgain(same, merged, seen | ~elsewhere)


def renumbered(
    moments: Array, frames: Sequence[Mapping[int, _Body]], points: Callable[[_Body], Array | None]
) -> tuple[list[dict[int, _Body]], list[Defect]]:
    """The bodies of each frame under the first number of the same person (`found_again`), and a defect.

    moments: (F,) times of the frames; frames: number -> body; points: of a body, (J, 3) in any unit, or None
    if it has none.
    """
    plain = [dict(bodies) for bodies in frames]
    if len({number for bodies in plain for number in bodies}) < 2:
        return plain, []
    rows = [
        (frame, number, body, place)
        for frame, bodies in enumerate(plain)
        for number, body in bodies.items()
        if (place := points(body)) is not None
    ]
    if len({place.shape for *_, place in rows}) != 1:
        return plain, []
    at, numbers, bodies_of_rows, places = zip(*rows, strict=True)
    found = found_again(moments[list(at)], np.array(numbers), np.array(places))
    if not found.same:
        return plain, []
    joined: list[dict[int, _Body]] = [{} for _ in plain]
    for frame, number, body, kept in zip(at, found.people.tolist(), bodies_of_rows, found.kept, strict=True):
        if kept:
            joined[frame][number] = body
    return joined, found.defects()


def _about_origin(places: Array) -> bool:
    """Whether the middles of bodies (R, J, 3) stay at the origin."""
    middles = np.linalg.norm(np.nanmedian(places, axis=1), axis=-1)
    return bool(np.median(middles) <= _AT_ORIGIN * _size(places))


def _step(moments: Array) -> float:
    """The median step of the clock."""
    steps = np.diff(np.unique(moments))
    return float(np.median(steps)) if len(steps) else 1.0


def _size(places: Array) -> float:
    """The median of the largest extents of bodies (R, J, 3), each with a joint."""
    extents = np.nanmax(places, axis=1) - np.nanmin(places, axis=1)
    return float(np.median(extents.max(axis=-1)))


def _distance(moments: Array, places: Array, end: list[int], begin: list[int], step: float) -> float:
    """How far the rows `begin` of a number are from where the rows `end` of another one led, as a share of
    what is near; infinite if they cannot be of one person."""
    steps = float(moments[begin[0]] - moments[end[-1]]) / step
    sizes = _size(places[end]), _size(places[begin])
    if not 0.0 < steps <= _LONGEST_LOSS or min(sizes) <= 0.0 or max(sizes) > _ALIKE * min(sizes):
        return np.inf
    moved = median_distance(places[end[-1]], places[begin[0]])
    passed = float(moments[end[-1]] - moments[end[0]])
    ways = places[end[-1]] - places[end[0]]
    ways = ways[np.isfinite(ways).all(axis=-1)]
    if passed > 0.0 and len(ways):
        ahead = places[end[-1]] + np.median(ways, axis=0) * (steps * step / passed)
        moved = min(moved, median_distance(ahead, places[begin[0]]))
    return moved / (min(sizes) * min(_NEAR + _NEAR_PER_STEP * steps, _FARTHEST))

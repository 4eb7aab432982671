"""Markers that carry each other's labels for some frames are exchanged; misplaced ones are removed.

Two markers are suspected where each fits in the other's place by the distances to its mates
(marker_mates.py), or where both jump at once, each to the place of the other. For each suspected pair, the
frames in which they are exchanged are those that fit best and jump least (Viterbi algorithm). A position that
no pose explains and no other marker fits is removed.

The labels of most frames are taken to be right: markers that are exchanged in all frames are not found.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.optical.marker_mates import Mates, distances, mates_of

# A marker may be in a wrong place if it is off the distances to the first share of its mates; it fits in a
# place if it is off to at most the second share, of two mates or more.
_WRONG, _FITS, _FEWEST_MATES = 0.5, 0.34, 2
# A position is removed if it is off by this many metres to most mates, three at least. From standing to a
# deep squat, the distances between neighbouring segments change by up to 0.25.
_MIN_REMOVED, _MOST, _FEWEST_REMOVING = 0.35, 0.6, 3
# Metres off the line through the last two frames: a jump. Two markers have exchanged their places if they
# move less by this factor with each other's labels.
_JUMP, _NEARER = 0.05, 4.0
# Costs beside those of misfits, one for each marker that does not fit: of a step in which a pair jumps, of a
# change.
_STEP, _CHANGE = 2.0, 1.0
# Where only jumps tell, each change must save this much: one between two certain places saves 0.8.
_CLEAR = 0.4
# No change between two frames in which the markers move on: their steps are less than this share of the sum
# of these and of the steps to each other's place.
_MOVES_ON = 0.5


def exchange_labels(labels: tuple[str, ...], points: Array) -> tuple[Array, list[Defect]]:
    """The points (T, M, 3) with exchanged markers put back and misplaced ones removed, and the defect.

    labels: (M,), "" for a point without a label, which may be a marker that lost it; points: metres, NaN
    where missing.
    """
    named = np.array([bool(label) for label in labels], dtype=np.bool_)
    repaired = points.copy()
    exchanged: dict[tuple[int, int], Mask] = {}
    with np.errstate(over="ignore", invalid="ignore"):  # damaged numbers, which are refused later
        mates = [mates_of(k, points, named) for k in range(len(labels))]
        for pair, frames in _exchanges(repaired, mates):
            exchanged[pair] = exchanged.get(pair, np.zeros(len(points), dtype=np.bool_)) ^ frames
        removed = _remove(repaired, mates)
    changed = np.logical_or.reduce([removed.any(axis=1), *exchanged.values()])
    if not changed.any():
        return points, []
    called = [label or "a point without a label" for label in labels]
    parts = [
        f"{called[a]} and {called[b]} in {plural(int(frames.sum()), 'frame')}, exchanged"
        for (a, b), frames in exchanged.items()
        if frames.any()
    ]
    parts += [
        f"{called[k]} off its segment in {plural(int(removed[:, k].sum()), 'frame')}, removed there"
        for k in np.flatnonzero(removed.any(axis=0)).tolist()
    ]
    text = "; ".join(parts)
    return repaired, [
        Defect("wrong_labels", int(changed.sum()), "frames", "repaired", text, frame_runs(changed))
    ]


def _exchanges(points: Array, mates: list[Mates]) -> Iterator[tuple[tuple[int, int], Mask]]:
    """Exchange (in place) one suspected pair after the other: each with its frames (T,).

    The clearest first: the others are judged anew with its markers in their places.
    """
    for _ in range(len(mates)):
        suspected = {pair: _exchanged(*pair, points, mates) for pair in _suspected(points, mates)}
        clearest = sorted(suspected, key=lambda pair: (-suspected[pair][1], pair))
        moved = np.zeros(len(points), dtype=np.bool_)
        for a, b in clearest:
            frames, _ = suspected[a, b]
            if frames.any() and not np.any(frames & moved):
                rows = np.flatnonzero(frames)[:, None]
                points[rows, [a, b]] = points[rows, [b, a]]
                moved |= frames
                yield (a, b), frames
        if not moved.any():
            return


def _suspected(points: Array, mates: list[Mates]) -> set[tuple[int, int]]:
    return _misfits(points, mates) | _crossings(points)


def _misfits(points: Array, mates: list[Mates]) -> set[tuple[int, int]]:
    """Pairs of which, in some frame, one is in a wrong place, and fits in the other's or the other in its."""
    pairs: set[tuple[int, int]] = set()
    for a, own in enumerate(mates):
        share, seen = own.off(points[:, a], points, without=a)
        here = points[(share >= _WRONG) & (seen >= _FEWEST_MATES)]
        if not len(here):
            continue
        for b, others in enumerate(mates):
            if b != a:
                there, seen_there = own.off(here[:, b], here, without=b)
                instead, seen_instead = others.off(here[:, a], here, without=a)
                fits = (there <= _FITS) & (seen_there >= _FEWEST_MATES)
                fits |= (instead <= _FITS) & (seen_instead >= _FEWEST_MATES)
                if fits.any():
                    pairs.add((min(a, b), max(a, b)))
    return pairs


def _crossings(points: Array) -> set[tuple[int, int]]:
    """Pairs that jump at once, each to the place of the other."""
    ahead = points[2:] - 2.0 * points[1:-1] + points[:-2]
    jumps = np.nan_to_num(distances(ahead, np.zeros(3))) > _JUMP
    pairs: set[tuple[int, int]] = set()
    for frame in (np.flatnonzero(jumps.sum(axis=1) > 1) + 2).tolist():
        markers = np.flatnonzero(jumps[frame - 2])
        between = distances(points[frame, markers, None], points[frame - 1, markers])
        own = np.diagonal(between)
        crossing = own[:, None] + own > _NEARER * (between + between.T)
        pairs.update((int(markers[a]), int(markers[b])) for a, b in np.argwhere(crossing) if a < b)
    return pairs


def _exchanged(a: int, b: int, points: Array, mates: list[Mates]) -> tuple[Mask, float]:
    """The frames (T,) in which two markers are exchanged, those that fit best and jump least, and the cost
    that this saves."""
    misfits, shares = zip(
        _misfit(a, b, points, mates), _misfit(a, b, points, mates, exchanged=True), strict=True
    )
    tells = misfits[0] != misfits[1]
    misfit = np.where(tells[:, None], np.stack(misfits, axis=1) + np.stack(shares, axis=1), 0.0)
    stay = _steps(a, b, points)
    # Blocks of frames between which no change is possible have one state.
    begin = np.flatnonzero(np.concatenate([[True], stay >= _MOVES_ON]))
    between = stay[begin[1:] - 1]
    blocks, least = _least_cost(
        np.add.reduceat(misfit, begin, axis=0), _STEP * between, _STEP * (1.0 - between) + _CHANGE
    )
    path = np.repeat(blocks, np.diff(np.append(begin, len(stay) + 1)))
    saved = float(misfit[:, 0].sum() + _STEP * between.sum()) - least
    undecided = not tells.any()
    if undecided and saved < _CLEAR * np.count_nonzero(np.diff(blocks)):
        path = np.zeros_like(path)  # two near markers, and noise
    if path.sum() > 0.5 * len(path):
        # The labels of most frames are right.
        path = ~path if undecided else np.zeros_like(path)
    return path, saved


def _misfit(
    a: int, b: int, points: Array, mates: list[Mates], *, exchanged: bool = False
) -> tuple[NDArray[np.intp], Array]:
    """How many of two markers do not fit (T,), and the sum (T,) of the shares of mates to which they are off.

    A marker without mates fits anywhere.
    """
    places = (points[:, b], points[:, a]) if exchanged else (points[:, a], points[:, b])
    one, seen_one = mates[a].off(places[0], points, without=b)
    other, seen_other = mates[b].off(places[1], points, without=a)
    count = ((one > _FITS) & (seen_one >= _FEWEST_MATES)).astype(np.intp)
    count += (other > _FITS) & (seen_other >= _FEWEST_MATES)
    return count, one + other


def _steps(a: int, b: int, points: Array) -> Array:
    """Share (T - 1,) of the steps between frames in the sum of these and of those to each other's place.

    Near 0 where the markers move on, near 1 where they change places; 0.5 where nothing tells.
    """
    both = points[:, [a, b]]
    steps, crossed = distances(both[1:], both[:-1]), distances(both[1:], both[:-1, ::-1])
    straight, across = (
        np.nansum(one, axis=1) / np.maximum(np.isfinite(one).sum(axis=1), 1) for one in (steps, crossed)
    )
    known = np.isfinite(steps).any(axis=1) & np.isfinite(crossed).any(axis=1) & (straight + across > 0.0)
    share = np.full(len(steps), 0.5)
    share[known] = straight[known] / (straight + across)[known]
    return share


def _least_cost(frame: Array, stay: Array, change: Array) -> tuple[Mask, float]:
    """The path (T,) of two states with the least cost, and this cost.

    Costs of the frames (T, 2), and of the steps (T - 1,) that stay or change.
    """
    first, second = frame[0].tolist()
    came: list[tuple[bool, bool]] = []
    for (one, other), same, new in zip(frame[1:].tolist(), stay.tolist(), change.tolist(), strict=True):
        from_other = second + new < first + same, first + new < second + same
        came.append(from_other)
        first, second = (
            min(first + same, second + new) + one,
            min(second + same, first + new) + other,
        )
    path = np.zeros(len(frame), dtype=np.bool_)
    path[-1] = second < first
    for k in range(len(came) - 1, -1, -1):
        path[k] = path[k + 1] ^ came[k][int(path[k + 1])]
    return path, min(first, second)


def _remove(points: Array, mates: list[Mates]) -> Mask:
    """Remove (in place) the positions that no pose explains; mask (T, M) of them."""
    removed = np.zeros(points.shape[:2], dtype=np.bool_)
    for k, own in enumerate(mates):
        differences = own.differences(points[:, k], points)
        seen = np.isfinite(differences).sum(axis=1)
        far = (differences > _MIN_REMOVED).sum(axis=1)
        removed[:, k] = (far >= _MOST * seen) & (seen >= _FEWEST_REMOVING)
    points[removed] = np.nan
    return removed

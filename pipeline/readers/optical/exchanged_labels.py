"""Markers that carry each other's labels for some frames are exchanged; misplaced ones are removed.

Two markers are suspected where each fits in the other's place by the distances to its mates
(marker_mates.py), or where both jump at once, each to the place of the other. For each suspected pair, the
frames in which they are exchanged are those that fit best and jump least (Viterbi algorithm). A position that
no pose explains and no other marker fits is removed.

The labels of most frames are taken to be right. Exchanges for more than a tenth of the recording are found by
their jumps alone, since the usual distances are then unknown.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import all_finite, frame_runs
from kinemimic.pipeline.kinematics.vectors import distances
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.optical.marker_mates import Mates, mates_of
from kinemimic.pipeline.readers.optical.marker_names import body_labels, is_named

# A marker may be in a wrong place if it is off the distances to the first share of its mates; it fits in a
# place if it is off to at most the second share, of two mates or more.
_WRONG, _FITS, _FEWEST_MATES = 0.5, 0.34, 2
# With more than this share of the markers in a wrong place, the body is in a pose that the recording rarely
# has, and the distances tell nothing.
_MOST_WRONG = 0.3
# A position is removed if it is off by this many metres to most mates, three at least: more than from an arm
# that hangs to one that is raised.
_MIN_REMOVED, _MOST, _FEWEST_REMOVING = 1.5, 0.6, 3
_MANY = 120  # named points, which a body does not have: the time grows with the square of their number
_LISTED = 5  # pairs and markers in a text
# Metres off the line through the last two frames: a jump. Two markers have exchanged their places if they
# move less by this factor with each other's labels.
_JUMP, _NEARER = 0.05, 4.0
# Costs beside those of misfits, one for each marker that does not fit: of a step in which a pair jumps, of a
# change.
_STEP, _CHANGE = 2.0, 1.0
# Of the frames of an exchange in which mates are seen, this share must have a marker that surely fits in it.
_SURE = 0.8
# Where only jumps tell, each change must save this much: one between two certain places saves 0.8.
_CLEAR = 0.4
# No change between two frames in which the markers move on: their steps are less than this share of the sum
# of these and of the steps to each other's place.
_MOVES_ON = 0.5


def exchange_labels(labels: tuple[str, ...], points: Array) -> tuple[Array, list[Defect]]:
    """The points (T, M, 3) with exchanged markers put back and misplaced ones removed, and the defect.

    labels: (M,); points: metres, NaN where missing. Only named points count, and of very many only those with
    names that are known of a body.
    """
    known = [k for k, label in enumerate(labels) if is_named(label)]
    if len(known) > _MANY:
        known = [k for k, label in enumerate(labels) if label in set(body_labels(labels))]
    repaired = points[:, known]
    exchanged: dict[tuple[int, int], Mask] = {}
    with np.errstate(over="ignore", invalid="ignore"):  # numbers that are too large to be squared
        mates = [mates_of(k, repaired) for k in range(len(known))]
        for pair, frames in _exchanges(repaired, mates):
            exchanged[pair] = exchanged.get(pair, np.zeros(len(points), dtype=np.bool_)) ^ frames
        removed = _remove(repaired, mates)
    changed = np.logical_or.reduce([removed.any(axis=1), *exchanged.values()])
    if not changed.any():
        return points, []
    called = [labels[k][:40] for k in known]
    parts = [
        f"{called[a]} and {called[b]} in {plural(int(frames.sum()), 'frame')}, exchanged"
        for (a, b), frames in exchanged.items()
        if frames.any()
    ]
    parts += [
        f"{called[k]} off its segment in {plural(int(removed[:, k].sum()), 'frame')}, removed there"
        for k in np.flatnonzero(removed.any(axis=0)).tolist()
    ]
    more = [f"and {len(parts) - _LISTED} more"] if len(parts) > _LISTED else []
    text = "; ".join([*parts[:_LISTED], *more])
    whole = points.copy()
    whole[:, known] = repaired
    return whole, [
        Defect("wrong_labels", int(changed.sum()), "frames", "repaired", text, frame_runs(changed))
    ]


def _exchanges(points: Array, mates: list[Mates]) -> Iterator[tuple[tuple[int, int], Mask]]:
    """Exchange (in place) one suspected pair after the other: each with its frames (T,).

    The clearest first: the others are judged anew with its markers in their places.
    """
    for _ in range(len(mates)):
        wrong = _wrong(points, mates)
        rare = wrong.mean(axis=1) > _MOST_WRONG
        wrong[rare] = False
        suspected = {
            pair: _exchanged(*pair, points, mates, rare)
            for pair in _misfits(points, mates, wrong) | _crossings(points)
        }
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


def _wrong(points: Array, mates: list[Mates]) -> Mask:
    """Mask (T, M) of the markers that may be in a wrong place."""
    wrong = np.zeros(points.shape[:2], dtype=np.bool_)
    for k, own in enumerate(mates):
        share, seen = own.off(points[:, k], points, without=k)
        wrong[:, k] = (share >= _WRONG) & (seen >= _FEWEST_MATES)
    return wrong


def _misfits(points: Array, mates: list[Mates], wrong: Mask) -> set[tuple[int, int]]:
    """Pairs of which, in some frame, one does not fit, and would in the other's place or the other in its."""
    pairs: set[tuple[int, int]] = set()
    for a, own in enumerate(mates):
        here = points[wrong[:, a]]
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


def _exchanged(a: int, b: int, points: Array, mates: list[Mates], rare: Mask) -> tuple[Mask, float]:
    """The frames (T,) in which two markers are exchanged, those that fit best and jump least, and the cost
    that this saves. rare: frames (T,) in which the distances tell nothing."""
    straight, off_straight, sure_straight = _misfit(a, b, points, mates)
    crossed, off_crossed, sure_crossed = _misfit(a, b, points, mates, exchanged=True)
    # A frame tells which way is right only if a marker surely fits that way.
    tells = ~rare & (((crossed < straight) & sure_crossed) | ((straight < crossed) & sure_straight))
    costs = np.stack([straight + off_straight, crossed + off_crossed], axis=1)
    misfit = np.where(tells[:, None], costs, 0.0)
    seen = all_finite(points[:, a]) | all_finite(points[:, b])
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
    path &= seen
    judged = path & ~rare & (sure_straight | sure_crossed | (straight + crossed > 0))
    if judged.any() and sure_crossed[judged].mean() < _SURE:
        path = np.zeros_like(path)  # a pose that the recording rarely has
    if path.sum() > 0.5 * seen.sum():
        # The labels of most frames are right.
        path = seen & ~path if undecided else np.zeros_like(path)
    return path, saved


def _misfit(
    a: int, b: int, points: Array, mates: list[Mates], *, exchanged: bool = False
) -> tuple[NDArray[np.intp], Array, Mask]:
    """How many of two markers do not fit (T,), the sum (T,) of the shares of mates to which they are off, and
    whether one surely fits (T,)."""
    places = (points[:, b], points[:, a]) if exchanged else (points[:, a], points[:, b])
    one, seen_one = mates[a].off(places[0], points, without=b)
    other, seen_other = mates[b].off(places[1], points, without=a)
    known_one, known_other = seen_one >= _FEWEST_MATES, seen_other >= _FEWEST_MATES
    count = ((one > _FITS) & known_one).astype(np.intp) + ((other > _FITS) & known_other)
    sure = ((one <= _FITS) & known_one) | ((other <= _FITS) & known_other)
    return count, one + other, np.asarray(sure)


def _steps(a: int, b: int, points: Array) -> Array:
    """Share (T - 1,) of the steps between frames in the sum of these and of those to each other's place.

    Near 0 where the markers move on, near 1 where they change places; 0.5 where nothing tells. A marker that
    moves by less than a jump, beside one that is hidden, moves on.
    """
    both = points[:, [a, b]]
    steps, crossed = distances(both[1:], both[:-1]), distances(both[1:], both[:-1, ::-1])
    straight, across = (
        np.nansum(one, axis=1) / np.maximum(np.isfinite(one).sum(axis=1), 1) for one in (steps, crossed)
    )
    moves, changes = np.isfinite(steps).any(axis=1), np.isfinite(crossed).any(axis=1)
    share = np.full(len(steps), 0.5)
    share[moves & ~changes & (straight < _JUMP)] = 0.0
    known = moves & changes & (straight + across > 0.0)
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
        far = (np.isfinite(differences) & (differences > _MIN_REMOVED)).sum(axis=1)
        removed[:, k] = (far >= _MOST * seen) & (seen >= _FEWEST_REMOVING)
    points[removed] = np.nan
    return removed

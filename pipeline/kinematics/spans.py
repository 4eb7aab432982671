"""Stretches of frames: of a mask, of a pass, of values that are there."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask


def runs(mask: Mask) -> Iterator[slice]:
    """The stretches of True in a mask (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    yield from (slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2))


def pass_spans(passes: NDArray[np.int32]) -> Iterator[slice]:
    """The frames of each pass, from the first pass to the last; passes: (T,) as in Clip."""
    ends = [*(np.flatnonzero(np.diff(passes)) + 1).tolist(), len(passes)]
    for start, end in pairwise([0, *ends]):
        if start < end and passes[start] >= 0:
            yield slice(start, end)


def usual_step(times: Array, passes: NDArray[np.int32]) -> float:
    """The median step in seconds between frames of one pass; 0 where no pass has two frames."""
    within = (passes[1:] == passes[:-1]) & (passes[1:] >= 0)
    return float(np.median(np.diff(times)[within])) if within.any() else 0.0


def apart(times: Array) -> Mask:
    """Of frames at times (T,), all but those that follow the one before by under a quarter of a usual step.

    Two stamps for nearly one instant: the noise between their frames, as a slope, throws a curve far off.
    """
    steps = np.diff(times)
    if not len(steps):
        return np.ones(len(times), dtype=np.bool_)
    return np.concatenate([[True], steps >= 0.25 * np.median(steps)])


def whole(values: Array, axis: int | tuple[int, ...] = -1) -> Mask:
    """Where no value along `axis` is missing."""
    return np.asarray(np.isfinite(values).all(axis=axis), dtype=np.bool_)


# A list of more runs than this is for a program, not a person; the counts are whole all the same.
_MOST = 100


def frame_runs(mask: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """The first runs (first, last), inclusive, of True frames in a mask (T,), at most a hundred."""
    found = ((span.start, span.stop - 1) for span in runs(mask))
    return tuple(run for run, _ in zip(found, range(_MOST), strict=False))

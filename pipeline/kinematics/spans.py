"""Runs of frames: of a mask, of a pass, of finite values."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask


def runs(mask: Mask) -> Iterator[slice]:
    """The runs of True in a mask (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    yield from (slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2))


def pass_spans(passes: NDArray[np.int32]) -> Iterator[slice]:
    """The frames of each pass, in their order; passes: (T,) as in Clip."""
    ends = [*(np.flatnonzero(np.diff(passes)) + 1).tolist(), len(passes)]
    for start, end in pairwise([0, *ends]):
        if start < end and passes[start] >= 0:
            yield slice(start, end)


def median_step(times: Array, passes: NDArray[np.int32]) -> float:
    """Median step in seconds between frames of one pass; 0 if no pass has two frames."""
    within = (passes[1:] == passes[:-1]) & (passes[1:] >= 0)
    return float(np.median(np.diff(times)[within])) if within.any() else 0.0


def distinct_times(times: Array) -> Mask:
    """Mask (T,) of the frames that follow the previous one by at least a quarter of the median step.

    Of two time stamps for nearly one instant, the noise between their frames is a steep slope, which makes a
    spline overshoot.
    """
    steps = np.diff(times)
    if not len(steps):
        return np.ones(len(times), dtype=np.bool_)
    return np.concatenate([[True], steps >= 0.25 * np.median(steps)])


def all_finite(values: Array, axis: int | tuple[int, ...] = -1) -> Mask:
    """Where every value along `axis` is finite."""
    return np.asarray(np.isfinite(values).all(axis=axis), dtype=np.bool_)


# Most runs that a report lists; its counts are still complete.
_MAX_RUNS = 100


def frame_runs(mask: Mask) -> tuple[tuple[int, int], ...]:
    """Runs (first, last) of True frames in a mask (T,), both inclusive; at most the first hundred."""
    found = ((span.start, span.stop - 1) for span in runs(mask))
    return tuple(run for run, _ in zip(found, range(_MAX_RUNS), strict=False))

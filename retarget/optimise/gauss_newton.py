"""Gauss-Newton on corrections of all frames of a motion, coupled by their second differences alone.

The normal equations are banded, so the cost is linear in the number of frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.optimise.banded import adjoint, second_differences, solve_blocks

# (corrections x (t, n) of a window's frames, window) -> J'WJ (t, n, n) and J'Wr (t, n).
Terms = Callable[[Array, slice], tuple[Array, Array]]

# A loop's closed form is near the solution; a motion kept as recorded may roll, kneel and land.
LOOP_ITERATIONS, ITERATIONS = 5, 8
HUBER_THRESHOLD = 2.0  # expected deviations beyond which the loss is linear
# Hz below which changes are free. A loop is a smooth series, so its corrections must be smooth. A motion kept
# as recorded jitters, so its poses must be smooth, no matter how large a correction that requires.
CORRECTION_CUTOFF, POSE_CUTOFF = 3.5, 8.0
# Deviations by which the first step may change an unknown, and the share of it by which the next one may, and
# so on: beyond that, the linearisation no longer holds, and steps would grow from one to the next. Only what
# was not seen for seconds is that far from its place.
LARGEST_STEP, NEXT_STEP = 8.0, 0.6
# Frames solved together, and the overlap of windows, over which the effect of a correction fades.
WINDOW, OVERLAP = 1500, 60


def gauss_newton(
    terms: Terms,
    deviation: Array,
    weights: Array,
    bending: Array,
    *,
    rate: float,
    cyclic: bool,
    root_smoothing: tuple[Array, Array] | None = None,
    before_step: Callable[[Array], None] | None = None,
) -> Array:
    """Corrections x (T, n) that minimise `terms`, weighted squares of x / deviation, and second differences.

    weights: (T, n) of x; bending: (T, n) second differences to smooth in addition to those of x;
    root_smoothing: share (n,) of extra stiffness per unknown, and second differences (T, n) that need not be
    kept; before_step: called with x before each step. A long clip is solved in overlapping windows: far from
    its ends a window's solution equals that of the whole clip, and the next step corrects the remaining
    difference.
    """
    frames, n = weights.shape
    x = np.zeros((frames, n))
    stiffness = _stiffness(CORRECTION_CUTOFF if cyclic else POSE_CUTOFF, rate) / deviation**2
    share, jitter = (np.zeros(n), np.zeros((frames, n))) if root_smoothing is None else root_smoothing
    root_stiffness = _stiffness(CORRECTION_CUTOFF, rate) * share / deviation**2
    at = np.arange(n)
    for iteration in range(LOOP_ITERATIONS if cyclic else ITERATIONS):
        if before_step is not None:
            before_step(x)
        step = np.empty_like(x)
        for window, core in _windows(frames, cyclic=cyclic):
            now = x[window]
            square, right = terms(now, window)
            prior = weights[window] * huber(now / deviation) / deviation**2
            square[:, at, at] += prior
            own = second_differences(now, cyclic=cyclic)
            bend = (own + bending[window]) * stiffness + (own + jitter[window]) * root_stiffness
            right += prior * now + adjoint(bend, cyclic=cyclic)
            solution = solve_blocks(square, stiffness + root_stiffness, -right, cyclic=cyclic)
            step[core] = solution[core.start - window.start : core.stop - window.start]
        # The direction of a frame's step stays the same.
        size = np.abs(step / deviation).max(axis=1, keepdims=True)
        x += step / np.maximum(1.0, size / (LARGEST_STEP * NEXT_STEP**iteration))
    return x


def _windows(frames: int, *, cyclic: bool) -> Iterator[tuple[slice, slice]]:
    """Windows over a clip, and the part of each whose solution is used; a cycle is one window."""
    length = frames if cyclic else WINDOW
    for start in range(0, frames, length):
        # The last part may be short: its window reaches back into the one before.
        stop = min(start + length, frames)
        yield slice(max(0, start - OVERLAP), min(frames, stop + OVERLAP)), slice(start, stop)


def _stiffness(band: float, rate: float) -> float:
    """Weight of second differences that halves a sine of `band` Hz: 1 / (2 sin(π band / rate))⁴."""
    return float((2.0 * np.sin(np.pi * min(band / rate, 0.5))) ** -4)


def huber(ratio: Array) -> Array:
    """Weights of squares that make Huber's loss of residuals, given as multiples of their deviations."""
    return 1.0 / np.maximum(1.0, np.abs(ratio) / HUBER_THRESHOLD)

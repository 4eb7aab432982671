"""Where a walker stands, and the half strides into and out of standing, which are not strides of walking.

While a person stands, the ankles keep their places. In the first and the last half stride of a walk they move
less far, and the knees bend less, than in all others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.locomotion.even_clock import RATE
from kinemimic.pipeline.locomotion.phase.frames import within

# A person stands while the ankles move relative to each other at less than this share of their greatest speed
# in walking, for longer than this (strides). In walking that lasts up to 0.31 strides, in double support.
STILL_SPEED, MIN_STANDING = 0.25, 0.45
SMOOTHING = 0.05  # s
HALF_STRIDE = 0.5
# Strides between two places of standing, besides the half strides, without which none is left out.
MIN_STEADY = 1.0
INTO, OUT_OF = "half stride into standing", "half stride out of standing"


@dataclass(frozen=True)
class Transition:
    """A half stride next to standing: its first and last phase, and INTO or OUT_OF."""

    start: float
    end: float
    kind: str


def transitions(
    ankles: Array, seen: Mask, phase: Array, *, amplitude: float, period: float
) -> list[Transition]:
    """The half strides into and out of standing in a pass on an even clock, in order.

    ankles: (T, 3) metres from the left to the right ankle; seen: (T,) whether both are; phase: (T,) cycles;
    amplitude: metres, of the ankles' distance in a stride of walking; period: seconds of a stride.
    """
    smooth = gaussian_filter1d(ankles, SMOOTHING * RATE, axis=0)
    speed = RATE * np.linalg.norm(np.gradient(smooth, axis=0), axis=1)
    still = seen & (speed < STILL_SPEED * amplitude * 2.0 * np.pi / period)
    least = MIN_STANDING * period * RATE
    stands = [(one.start, one.stop - 1) for one in runs(still) if one.stop - one.start > least]
    found = []
    for before, after in zip([None, *stands], [*stands, None], strict=True):
        first = float(phase[0]) if before is None else float(phase[before[1]])
        last = float(phase[-1]) if after is None else float(phase[after[0]])
        begin = first if before is None else first + HALF_STRIDE
        end = last if after is None else last - HALF_STRIDE
        if end - begin < MIN_STEADY:
            continue
        if before is not None:
            found.append(Transition(first, begin, OUT_OF))
        if after is not None:
            found.append(Transition(end, last, INTO))
    return found


def steady_frames(phase: Array, found: Sequence[Transition]) -> Mask:
    """Mask (T,) of the frames before each half stride into standing, and after the one out of it."""
    steady = np.ones(len(phase), dtype=np.bool_)
    if not found:
        return steady
    for one in found:
        steady[within(phase, one.start, one.end)] = False
    for before, after in pairwise([None, *found, None]):
        if (before is None or before.kind == INTO) and (after is None or after.kind == OUT_OF):
            first = -np.inf if before is None else before.end
            steady[within(phase, first, np.inf if after is None else after.start)] = False
    return steady


def on_phase(found: Sequence[Transition], before: Array, after: Array) -> list[Transition]:
    """The half strides on another phase (T,) of the same frames."""
    return [
        replace(
            one,
            start=float(np.interp(one.start, before, after)),
            end=float(np.interp(one.end, before, after)),
        )
        for one in found
    ]


def kind_of(start: float, end: float, found: Sequence[Transition]) -> str:
    """INTO or OUT_OF if the phases from start to end lie in such a half stride, else ""."""
    inside = (one.kind for one in found if one.start - 1e-9 <= start and end <= one.end + 1e-9)
    return next(inside, "")


def is_standing(start: float, end: float, found: Sequence[Transition]) -> bool:
    """Whether the phases from start to end lie in standing: after a half stride into it, or before one out
    of it, with no walk between."""
    before = max((one for one in found if one.end <= start + 1e-9), key=lambda one: one.end, default=None)
    after = min((one for one in found if one.start >= end - 1e-9), key=lambda one: one.start, default=None)
    if before is None and after is None:
        return False
    return (before is None or before.kind == INTO) and (after is None or after.kind == OUT_OF)


def steady_span(start: float, end: float, phase: Array, found: Sequence[Transition]) -> tuple[float, float]:
    """First and last phase of the walk around the stride from start to end, without such half strides."""
    low = [one.end for one in found if one.end <= start + 1e-9]
    high = [one.start for one in found if one.start >= end - 1e-9]
    return max([float(phase[0]), *low]), min([float(phase[-1]), *high])

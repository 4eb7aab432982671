"""A gait too fast or too slow for a human: the clock, not the walker, is wrong.

What can be said honestly is little: strides of 0.45 to 2.5 s are all human, so that a rate wrong by a factor
of two mostly passes, and how wrong the rate is does not follow. So this is flagged, never repaired.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clean import runs
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.rules.body import between, nodes_of, unit

Array = NDArray[np.float64]

# A sprinter's stride takes 0.45 s; a patient's slowest walk hardly more than 2.
HUMAN = (0.45, 2.5)
# Knees that swing by this much, strides alike to this degree, and legs that take turns make a gait.
SWING = np.radians(35.0)
ALIKE = 0.6
IN_TURN = 0.3
STRIDES = 2.2


def check(clip: Clip) -> list[Defect]:
    """Flagged if the longest pass is a steady gait with a stride that no human has."""
    spans = [
        span for number in range(int(clip.passes.max(initial=-1)) + 1) for span in runs(clip.passes == number)
    ]
    if not spans:
        return []
    span = max(spans, key=lambda one: float(clip.times[one.stop - 1] - clip.times[one.start]))
    period = stride(nodes_of(clip)[span], clip.times[span])
    if period is None or HUMAN[0] <= period <= HUMAN[1]:
        return []
    rate = clip.rate
    text = (
        f"at the declared {rate:.4g} Hz a stride takes {period:.2f} s, outside of {HUMAN[0]:g} to "
        f"{HUMAN[1]:g} s: a usual stride of 1.1 s would mean {rate * period / 1.1:.3g} Hz"
    )
    return [Defect("wrong_rate", len(clip.times), "frames", "flagged", text)]


def stride(points: Array, times: Array) -> float | None:
    """Seconds of a stride, from the difference of the knees' angles; None without a gait.

    points: (T, 20, 3) of the nodes; times: (T,).
    """
    knees = np.stack([_bend(points, "left"), _bend(points, "right")], axis=1)
    whole = np.isfinite(knees).all(axis=1)
    if whole.sum() < 12 or whole.mean() < 0.8:
        return None
    even = np.linspace(times[0], times[-1], len(times))
    left, right = (np.interp(even, times[whole], knees[whole, side]) for side in (0, 1))
    if min(np.ptp(np.percentile(curve, [5.0, 95.0])) for curve in (left, right)) < SWING:
        return None
    if np.corrcoef(left, right)[0, 1] > IN_TURN:
        return None
    wave = left - right - np.mean(left - right)
    size = 1 << (2 * len(wave) - 1).bit_length()
    power = np.abs(np.fft.rfft(wave, size)) ** 2
    likeness = np.fft.irfft(power, size)[: len(wave)]
    # Of two stretches that overlap less there is less to multiply.
    likeness = likeness / likeness[0] * len(wave) / np.arange(len(wave), 0, -1)
    last = int(len(wave) / STRIDES)
    below = np.flatnonzero(likeness[:last] < 0.0)
    if not len(below):
        return None
    # The highest of the peaks that follow the first trough is a stride or several: the first nearly as high.
    rest = likeness[below[0] : last]
    peaks = np.flatnonzero((rest[1:-1] >= rest[:-2]) & (rest[1:-1] > rest[2:])) + 1
    high = peaks[rest[peaks] > max(ALIKE, 0.9 * float(rest[peaks].max(initial=0.0)))]
    return None if not len(high) else float((below[0] + high[0]) * (even[1] - even[0]))


def _bend(points: Array, side: str) -> Array:
    """Angle (T,) between thigh and shank, radians, 0 for a straight leg."""
    thigh = unit(between(points, f"hip_{side}", f"knee_{side}"))
    shank = unit(between(points, f"knee_{side}", f"ankle_{side}"))
    return np.asarray(np.arccos(np.clip(np.sum(thigh * shank, axis=-1), -1.0, 1.0)))

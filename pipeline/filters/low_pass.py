"""Zero-phase Butterworth filter with a fixed cut-off, as gait laboratories use it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.spans import all_finite, distinct_times, median_step, pass_spans, runs

CUTOFF = 6.0
# Steps that vary by less than this share count as an even clock.
EVEN_CLOCK = 0.02


def low_pass(values: Array, times: Array, passes: NDArray[np.int32]) -> tuple[Array, str]:
    """Values (T, J, K) low-passed at CUTOFF in each pass, and a description in one line.

    NaN stay, and each run between them is filtered by itself. Values on an uneven clock are interpolated to
    an even one by cubic splines, and back after filtering.
    """
    result = values.copy()
    short = 0
    step = median_step(times, passes)
    smooth = zero_phase(1.0 / step) if step > 0.0 else None
    if smooth is None:
        few = f"{1.0 / step:.4g} frames a second are too few for {CUTOFF:g} Hz" if step else "single frames"
        return result, f"not filtered: {few}"
    for span in pass_spans(passes):
        there = all_finite(values[span])
        complete = there.all(axis=0)
        groups = [(slice(0, len(there)), complete)] if complete.any() else []
        for joint in np.flatnonzero(~complete):
            only = np.arange(there.shape[1]) == joint
            groups += [(stretch, only) for stretch in runs(there[:, joint])]
        for stretch, joints in groups:
            if stretch.stop - stretch.start < 4:
                short += int(joints.sum())
                continue
            part = result[span][stretch]
            part[:, joints] = _on_even_clock(part[:, joints], times[span][stretch], step, smooth)
    note = f"zero-phase Butterworth, 4th order, {CUTOFF:g} Hz"
    return result, note + (f"; {short} runs of fewer than four frames left as recorded" if short else "")


def zero_phase(rate: float) -> Callable[[Array], Array] | None:
    """A filter along axis 0 of evenly sampled values, or None if `rate` (Hz) is too low for CUTOFF.

    Two poles forward and two backward give order four and no delay; the design frequency is corrected so
    that both together are 3 dB down at the cut-off (Winter 2009, Biomechanics and Motor Control, eq. 3.18).
    """
    correction = (np.sqrt(2.0) - 1.0) ** 0.25
    if 0.4 * rate < CUTOFF:
        return None
    design = np.arctan(np.tan(np.pi * CUTOFF / rate) / correction) / np.pi * rate
    sections = butter(2, design, fs=rate, output="sos")

    def smooth(values: Array) -> Array:
        # Pad by point reflection for three periods, or as far as the data go, so that the filter's
        # transient ends before the data begin.
        padding = min(len(values) - 1, int(3.0 * rate / CUTOFF))
        return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=padding))

    return smooth


def _on_even_clock(values: Array, times: Array, step: float, smooth: Callable[[Array], Array]) -> Array:
    steps = np.diff(times)
    if np.ptp(steps) <= EVEN_CLOCK * float(np.median(steps)):
        return smooth(values)
    even = np.linspace(times[0], times[-1], max(4, round((times[-1] - times[0]) / step) + 1))
    known = distinct_times(times)
    return np.asarray(CubicSpline(even, smooth(CubicSpline(times[known], values[known])(even)))(times))

"""The phase of a long walk, stride by stride, for walkers whose strides vary in duration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.locomotion.phase.fourier import design
from kinemimic.pipeline.locomotion.phase.harmonic import fit_harmonic

SMOOTHING_TIME = (
    0.08  # s over which the ankles' distance is averaged before its turning points are looked for
)
PROMINENCE = 0.5  # of a turning point, in amplitudes (twice the standard deviation)
# Strides before and after a moment over which its harmonic is fitted. With a Kinect's noise at 30 Hz a
# turning point is off by 0.02 cycles, this fit by 0.005; with half the window, a lopsided wave leaks through.
HALF_WINDOW = 1.0
SPACING = 0.25  # strides between the moments
# One harmonic of a short recording: its R², and the share of the frames that it explains.
MIN_R2, MIN_KEPT, MIN_FRAMES = 0.85, 0.80, 8
MIN_SEEN = 0.5  # share of visible frames in a window


def gait_phase(times: Array, ankles: Array, *, steady: Mask | None = None) -> Array | None:
    """The phase (T,) of `stride_phase`; of less than one and a half strides, that of one harmonic.

    None if the ankles do not show a gait.
    """
    phase = stride_phase(times, ankles, steady=steady)
    if phase is not None:
        return phase
    seen = np.isfinite(ankles)
    if seen.sum() < MIN_FRAMES:
        return None
    harmonic = fit_harmonic(times, np.where(seen, ankles, 0.0), seen.astype(np.float64))
    if harmonic.r2 < MIN_R2 or harmonic.kept < MIN_KEPT:
        return None
    return harmonic.phase(times)


def stride_phase(times: Array, ankles: Array, *, steady: Mask | None = None) -> Array | None:
    """Phase (T,) from x(right ankle) - x(left ankle), (T,) metres at times (T,), NaN where not seen: cycles,
    not wrapped, integer where the left ankle is farthest ahead (first harmonic).

    steady: (T,) frames to which harmonics are fitted; while the person stands, there is none.
    Turning points count the strides; harmonics fitted to the strides around each moment refine the timing.
    None with fewer than three turning points.
    """
    seen = np.isfinite(ankles)
    if seen.sum() < MIN_FRAMES:
        return None
    distance = np.interp(times, times[seen], ankles[seen])
    counted = _count_cycles(times, distance)
    if counted is None:
        return None
    fitted = np.ones(len(seen), dtype=np.bool_) if steady is None else steady
    phase = counted - _phase_error(counted, distance, seen & fitted)
    wave, distance = design(phase, 1)[fitted], distance[fitted]
    amplitudes = np.asarray(np.linalg.lstsq(wave, distance, rcond=None)[0], dtype=np.float64)
    return np.asarray(phase - _minimum_phase(amplitudes))


def _count_cycles(times: Array, distance: Array) -> Array | None:
    """Cycles (T,) up to a constant, linear between the midpoints of neighbouring turning points of d (T,).

    In a lopsided wave one foot's turning points come late; the midpoints stay evenly spaced.
    """
    step = float(np.median(np.diff(times)))
    smoothed = uniform_filter1d(distance, max(1, round(SMOOTHING_TIME / step)))
    prominence = 2.0 * PROMINENCE * float(smoothed.std())
    left, right = (find_peaks(sign * smoothed, prominence=prominence)[0] for sign in (-1.0, 1.0))
    turns = np.concatenate([left, right])
    if len(turns) < 3:
        return None
    order = np.argsort(turns)
    turn_times, is_right = times[turns[order]], (np.arange(len(turns)) >= len(left))[order]
    # Two turning points of the same foot in a row: one of the other foot was missed.
    advance = np.where(is_right[1:] == is_right[:-1], 1.0, 0.5)
    knots = np.concatenate([[0.5 * float(is_right[0])], advance]).cumsum()
    turn_times, knots = 0.5 * (turn_times[1:] + turn_times[:-1]), 0.5 * (knots[1:] + knots[:-1])
    phase = np.asarray(np.interp(times, turn_times, knots), dtype=np.float64)
    for edge, (a, b) in ((times < turn_times[0], (0, 1)), (times > turn_times[-1], (-2, -1))):
        rate = (knots[b] - knots[a]) / (turn_times[b] - turn_times[a])
        near = 0 if a == 0 else -1
        phase[edge] = knots[near] + rate * (times[edge] - turn_times[near])
    return phase


def _phase_error(phase: Array, distance: Array, seen: NDArray[np.bool_]) -> Array:
    """Cycles (T,) by which a counted phase (T,) is ahead of the local harmonic."""
    moments = np.arange(phase[0] + SPACING, phase[-1], SPACING)
    known, off = [], []
    for moment in moments:
        near = slice(*np.searchsorted(phase, [moment - HALF_WINDOW, moment + HALF_WINDOW]))
        if seen[near].mean() < MIN_SEEN:
            continue
        weights = np.cos(0.5 * np.pi * (phase[near] - moment) / HALF_WINDOW) * seen[near]
        wave = design(phase[near], 1) * weights[:, None]
        known.append(moment)
        off.append(
            _minimum_phase(
                np.asarray(np.linalg.lstsq(wave, distance[near] * weights, rcond=None)[0], np.float64)
            )
        )
    if not known:
        return np.zeros(len(phase))
    return np.asarray(np.interp(phase, known, np.unwrap(off, period=1.0)))


def _minimum_phase(amplitudes: Array) -> float:
    """The phase, in cycles, at which a harmonic (mean, cosine, sine) has its minimum."""
    return float(np.arctan2(-amplitudes[2], -amplitudes[1])) / (2.0 * np.pi)

"""The phase of a long walk, stride by stride: no harmonic of one period follows who speeds up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

Array = NDArray[np.float64]

STILL = 0.08  # s over which the ankles' distance is averaged before its turning points are looked for
PROMINENT = 0.5  # of its spread, times two, by which a turning point stands out


@dataclass(frozen=True)
class StridePhase:
    """phase: (T,) cycles, not wrapped, whole where the first harmonic has the left ankle farthest before the
    right; r2: share of the variance of the ankles' distance that this harmonic explains.
    """

    phase: Array
    r2: float


def stride_phase(times: Array, ankles: Array) -> StridePhase | None:
    """Phase from x(right ankle) - x(left ankle), (T,) metres at times (T,): even between the turning points.

    None where there are fewer than three.
    """
    seen = np.isfinite(ankles)
    if seen.sum() < 8:
        return None
    d = np.interp(times, times[seen], ankles[seen])
    step = float(np.median(np.diff(times)))
    still = uniform_filter1d(d, max(1, round(STILL / step)))
    prominence = 2.0 * PROMINENT * float(still.std())
    left, right = (find_peaks(sign * still, prominence=prominence)[0] for sign in (-1.0, 1.0))
    turns = np.concatenate([left, right])
    if len(turns) < 3:
        return None
    order = np.argsort(turns)
    at, is_right = times[turns[order]], (np.arange(len(turns)) >= len(left))[order]
    # Between two of the same foot one of the other was missed.
    advance = np.where(is_right[1:] == is_right[:-1], 1.0, 0.5)
    knots = np.concatenate([[0.5 * float(is_right[0])], advance]).cumsum()
    phase = np.interp(times, at, knots)
    for edge, (a, b) in ((times < at[0], (0, 1)), (times > at[-1], (-2, -1))):
        rate = (knots[b] - knots[a]) / (at[b] - at[a])
        near = 0 if a == 0 else -1
        phase[edge] = knots[near] + rate * (times[edge] - at[near])
    wave = np.column_stack([np.ones(len(d)), np.cos(2.0 * np.pi * phase), np.sin(2.0 * np.pi * phase)])
    found = np.linalg.lstsq(wave, d, rcond=None)[0]
    rest = d - wave @ found
    spread = float(np.sum((d - d.mean()) ** 2))
    # The turning points of a lopsided wave lie beside those of its first harmonic, which counts.
    phase -= float(np.arctan2(-found[2], -found[1])) / (2.0 * np.pi)
    return StridePhase(phase, 1.0 - float(rest @ rest) / spread if spread > 0 else 0.0)

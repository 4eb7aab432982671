"""Fill the short gaps of a pass by interpolation; long gaps stay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.spans import all_finite, median_step, pass_spans

# Seconds, about a fifth of a stride; a curve through the ends of a longer gap would be invented.
LONGEST_GAP = 0.2


def fill_gaps(values: Array, times: Array, passes: NDArray[np.int32]) -> tuple[Array, Mask]:
    """Values (T, J, K) with the short gaps of each pass interpolated, and a mask (T, J) of them.

    A gap is filled if the frames on its two sides are at most LONGEST_GAP plus one median step apart; the
    ends of a pass are not extrapolated. Monotone cubics (PCHIP) do not overshoot the measured values.
    """
    result, filled = values.copy(), np.zeros(values.shape[:2], dtype=np.bool_)
    longest = LONGEST_GAP + median_step(times, passes) + 1e-6
    for span in pass_spans(passes):
        clock = times[span]
        for joint in np.flatnonzero(~all_finite(values[span]).all(axis=0)):
            there = all_finite(values[span, joint])
            if there.sum() < 2:
                continue
            known = np.flatnonzero(there)
            gaps = np.flatnonzero((np.diff(known) > 1) & (np.diff(clock[known]) <= longest))
            short = np.zeros(len(clock), dtype=np.bool_)
            for before, after in zip(known[gaps], known[gaps + 1], strict=True):
                short[before + 1 : after] = True
            if short.any():
                curve = PchipInterpolator(clock[there], values[span, joint][there])
                result[span, joint][short] = curve(clock[short])
                filled[span, joint] = short
    return result, filled

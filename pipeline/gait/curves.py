"""Joint angles over the gait cycle: strides normalised to 0 to 100 %, averaged, compared with norms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.normative import normative_band
from kinemimic.pipeline.gait.parameters import Stride, summary

CYCLE: Array = np.arange(101) / 100.0
_GAP = 0.15  # s, the longest gap to interpolate
# Degrees rms from the median of all strides beyond which a stride is an outlier (exchanged legs, a lost
# joint); or three times the median distance if that is more.
_OUTLIER = 15.0


def over_cycle(times: Array, curve: Array, strides: Sequence[Stride]) -> Array:
    """The curve (T,) of one pass over the cycle of each stride, (strides, 101); NaN rows for gaps.

    Interpolated by a cubic spline: at 30 Hz, linear interpolation would lower the knee's peak by a degree.
    """
    rows = np.full((len(strides), len(CYCLE)), np.nan)
    known = np.isfinite(curve)
    if known.sum() < 4:
        return rows
    at, spline = times[known], CubicSpline(times[known], curve[known])
    for row, stride in zip(rows, strides, strict=True):
        around = slice(
            max(int(np.searchsorted(at, stride.start, "right")) - 1, 0),
            int(np.searchsorted(at, stride.end)) + 1,
        )
        inside = at[around]
        if len(inside) < 4 or inside[0] > stride.start or inside[-1] < stride.end:
            continue
        if np.diff(inside).max() <= _GAP:
            row[:] = spline(stride.start + CYCLE * stride.time)
    return rows


def curve_statistics(rows: Array, joint: str | None = None) -> dict[str, Any] | None:
    """Statistics in degrees of curves (strides, 101) in radians; None if no stride is complete.

    mean, sd: (101,) over the strides (sd None for a single one); strides: their number without outliers;
    range_deg: `summary` of the ranges of the strides. joint: of the normative curve to compare with, if any,
    which adds norm_rms_deg: rms difference of the mean from the normative mean (the gait variable score of
    Baker et al. 2009, Gait & Posture 30(3), 265-269), and norm_within_percent: share of the cycle in
    which the mean lies within one normative standard deviation.
    """
    whole = np.degrees(rows[np.isfinite(rows).all(axis=1)])
    if not len(whole):
        return None
    away = np.sqrt(np.mean((whole - np.median(whole, axis=0)) ** 2, axis=1))
    whole = whole[away <= max(_OUTLIER, 3.0 * float(np.median(away)))]
    mean = whole.mean(axis=0)
    result: dict[str, Any] = {
        "strides": len(whole),
        "mean": mean,
        "sd": whole.std(axis=0, ddof=1) if len(whole) > 1 else None,
        "range_deg": summary([float(np.ptp(row)) for row in whole]),
    }
    if joint is not None:
        middle, spread = (np.degrees(values) for values in normative_band(joint, CYCLE))
        result["norm_rms_deg"] = float(np.sqrt(np.mean((mean - middle) ** 2)))
        result["norm_within_percent"] = float(100.0 * np.mean(np.abs(mean - middle) <= spread))
    return result

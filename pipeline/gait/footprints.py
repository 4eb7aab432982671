"""Footprints: where each foot stands after its strikes.

A footprint is where the ankle is while the foot lies flat. At the strike the ankle still moves, so that an
error of 15 ms in the strike's time would move it by 2 cm.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.events import FootEvents

# Shares of the stance between which a foot lies flat: earlier it may not have landed, later the heel rises.
FLAT = (0.25, 0.5)


def footprints(feet: FootEvents) -> tuple[Array, Array]:
    """Horizontal places (K, 2) in metres of the left and of the right ankle, one for each strike.

    Where the pass ends before the foot lies flat, the ankle moves on from the strike as after the foot's
    other strikes; NaN if the pass shows it flat after none.
    """
    stance = _stance(feet)
    left, right = (_prints(feet.times, feet.ankles[:, k, :2], feet.strikes[k], stance) for k in (0, 1))
    return left, right


def _prints(times: Array, ankle: Array, strikes: Array, stance: float) -> Array:
    """Places (K, 2) of one foot: times (T,), ankle (T, 2), strikes (K,) seconds, stance in seconds."""
    at_strike = np.stack([np.interp(strikes, times, column) for column in ankle.T], axis=1)
    first, last = (np.searchsorted(times, strikes + share * stance) for share in FLAT)
    flat = np.full((len(strikes), 2), np.nan)
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        if a < b < len(ankle):
            flat[k] = np.median(ankle[a:b], axis=0)
    shown = np.isfinite(flat)
    onward = (flat - at_strike)[shown.all(axis=1)]
    if not len(onward):
        return flat
    return np.where(shown, flat, at_strike + np.median(onward, axis=0))


def _stance(feet: FootEvents) -> float:
    """Median seconds from a foot's strike to its next foot off, 0 without any."""
    times = []
    for strikes, offs in zip(feet.strikes, feet.offs, strict=True):
        following = np.searchsorted(offs, strikes, "right")
        known = following < len(offs)
        times.append(offs[following[known]] - strikes[known])
    every = np.concatenate(times)
    return float(np.median(every)) if len(every) else 0.0

"""Which points of the feet stand still in the image, and so on the floor."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import POINT_INDEX
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.kinematics.skeleton import SIDES

FEET: tuple[int, ...] = tuple(POINT_INDEX[f"{name}_{side}"] for side in SIDES for name in ("heel", "foot"))
# Metres a second, of a person of average height: a foot on the floor is slower, one in a stride ten times
# as fast.
_SLOW = 0.3
# Seconds over which the pixels are averaged before their speed is taken.
_SPAN = 0.05


def standing(observed: Observed, distance: Array, focal: float) -> Array:
    """(T, 4) how surely each point of FEET stands still, 0 to 1, by its speed in the image.

    distance: (T,) metres from the camera; focal: pixels.
    """
    times = observed.times
    if len(times) < 3:
        return np.zeros((len(times), len(FEET)))
    pixels = observed.pixels[:, FEET]
    step = float(np.median(np.diff(times)))
    weight = np.asarray(np.isfinite(pixels).all(axis=-1), dtype=np.float64)
    smooth = _averaged(np.nan_to_num(pixels), weight, _SPAN / step)
    speed = np.linalg.norm(np.gradient(smooth, times, axis=0), axis=-1) * distance[:, None] / focal
    still = 1.0 / (1.0 + (speed / _SLOW) ** 4)
    return np.asarray(still * weight * np.clip(observed.certainty[:, FEET], 0.0, 1.0))


def _averaged(values: Array, weight: Array, sigma: float) -> Array:
    total = gaussian_filter1d(weight, sigma, axis=0, mode="nearest")[..., None]
    summed = gaussian_filter1d(values * weight[..., None], sigma, axis=0, mode="nearest")
    return np.asarray(summed / np.maximum(total, 1e-6))

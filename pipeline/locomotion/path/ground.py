"""The ground under a walker: the height of the ankles of feet in stance, slowly varying."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES

FLAT = (0.08, 0.36)  # phases since the foot was farthest ahead, in which it lies flat
ANKLE_HEIGHT = 0.08  # m above the sole
SMOOTHING_STANCES = 2.0  # standard deviation


def ground_height(positions: Array, phase: Array, *, follow: bool) -> Array:
    """Height (T,) in metres of the ground below positions (T, 20, 3) with Z up.

    phase: (T,) cycles, integer where the left ankle is farthest ahead, and negated in a walk backward.
    follow: let the ground rise and fall slowly, as it seems to where a sensor's floor was not found;
    otherwise one height. Stairs and slopes become level where it follows.
    """
    places, heights = [], []
    for foot, side in enumerate(SIDES):
        own = phase + 0.5 * foot
        flat = (np.mod(own, 1.0) > FLAT[0]) & (np.mod(own, 1.0) < FLAT[1])
        for number in np.unique(np.floor(own[flat])):
            mine = np.flatnonzero(flat & (np.floor(own) == number))
            places.append(float(mine.mean()))
            heights.append(float(np.median(positions[mine, N[f"ankle_{side}"], 2])))
    if not places:
        ankles = positions[:, [N["ankle_left"], N["ankle_right"]], 2]
        return np.full(len(positions), float(np.percentile(ankles.min(axis=1), 20.0)) - ANKLE_HEIGHT)
    level = np.array(heights)
    if not follow:
        return np.full(len(positions), float(np.median(level)) - ANKLE_HEIGHT)
    order = np.argsort(places)
    smooth = gaussian_filter1d(_without_outliers(level[order]), SMOOTHING_STANCES, mode="nearest")
    return np.asarray(np.interp(np.arange(len(positions)), np.array(places)[order], smooth) - ANKLE_HEIGHT)


def _without_outliers(heights: Array) -> Array:
    """Heights (K,) with those far from the median of their neighbours replaced by it."""
    padded = np.pad(heights, 2, mode="edge")
    median = np.median(np.stack([padded[k : k + len(heights)] for k in range(5)]), axis=0)
    return np.where(np.abs(heights - median) > 0.05, median, heights)

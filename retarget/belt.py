"""A treadmill's belt: how fast it carried the standing feet backward, and the walk as it is over the ground.

Someone on a treadmill stays where they are. Between its farthest ahead and its farthest behind, a foot stands
on the belt and moves with it; it does so lower than when it swings forward, and in every stride alike. Where
that is seen of both feet, the way of the belt is added to the person's.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import find_peaks

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.harmonic import walking_direction
from kinemimic.pipeline.skeleton import NODE_INDEX as N

Array = NDArray[np.float64]

FEWEST = 8  # frames
STROKES = 4  # of each foot, below which nothing is steady
LENGTH = 0.3  # m, least way of an ankle from ahead to behind
SLOWEST = 0.3  # m/s of the belt
SPREAD = 0.3  # median deviation of the strokes' speeds from those around them, over their median
STAYS = 0.15  # of the belt's way, that the person may go
STILL = 0.1  # s over which an ankle's path is averaged before its turning points are looked for
AROUND = 9  # strokes, of both feet, over which the belt's speed is the median


def off_the_belt(clip: Clip) -> tuple[Clip, dict[int, float]]:
    """The clip on the 20 nodes with the belt's way added to every pass on a treadmill, and the belts' mean
    speeds in m/s by number of the pass.
    """
    positions = clip.positions.copy()
    speeds: dict[int, float] = {}
    for number in np.unique(clip.passes[clip.passes >= 0]):
        rows = np.flatnonzero(clip.passes == number)
        found = _way(clip.times[rows], clip.positions[rows])
        if found is not None:
            heading, way = found
            positions[rows] += way[:, None, None] * np.array([np.cos(heading), np.sin(heading), 0.0])
            speeds[int(number)] = float(way[-1] / np.ptp(clip.times[rows]))
    return (replace(clip, positions=positions) if speeds else clip), speeds


def _way(times: Array, positions: Array) -> tuple[float, Array] | None:
    """Heading in radians and the belt's way (T,) in metres; None where nobody walks on a belt."""
    hips = positions[:, [N["hip_left"], N["hip_right"]], :2]
    if np.isfinite(hips).all(axis=(1, 2)).sum() < FEWEST:
        return None
    heading, on_path = walking_direction(positions)
    along = np.array([np.cos(heading), np.sin(heading)])
    feet = []
    for side in ("left", "right"):
        ankle = positions[:, N[f"ankle_{side}"]]
        seen = np.isfinite(ankle).all(axis=-1)
        found = (
            _strokes(times[seen], ankle[seen, :2] @ along, ankle[seen, 2]) if seen.sum() > FEWEST else None
        )
        if on_path or found is None:
            return None
        feet.append(found)
    moments, strokes = np.concatenate(feet, axis=1)
    order = np.argsort(moments)
    moments, strokes = moments[order], strokes[order]
    belt = median_filter(strokes, size=min(AROUND, len(strokes)), mode="nearest")
    usual = float(np.median(belt))
    if usual < SLOWEST or np.median(np.abs(strokes - belt)) > SPREAD * usual:
        return None
    pace = np.interp(times, moments, belt)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(times))])
    middle = hips.mean(axis=1) @ along
    if np.ptp(middle[np.isfinite(middle)]) > STAYS * way[-1]:
        return None
    return heading, way


def _strokes(times: Array, along: Array, height: Array) -> Array | None:
    """Moments and speeds (2, S), seconds and m/s, backward positive, of the middle halves of an ankle's
    ways from ahead to behind; None where they are few, or no lower than its ways forward.
    """
    step = float(np.median(np.diff(times)))
    still = uniform_filter1d(along, max(1, round(STILL / step)))
    ahead, _ = find_peaks(still, prominence=0.5 * LENGTH)
    behind, _ = find_peaks(-still, prominence=0.5 * LENGTH)
    turns = np.sort(np.concatenate([ahead, behind]))
    moments, speeds, low, high = [], [], [], []
    for begin, end in pairwise(turns):
        way = still[begin] - still[end]
        if abs(way) < LENGTH:
            continue
        share = (still[begin : end + 1] - still[begin]) / (still[end] - still[begin])
        middle = begin + np.flatnonzero((share > 0.25) & (share < 0.75))
        if len(middle) < 2:
            continue
        if way > 0:
            low.append(height[middle].mean())
            moments.append(times[middle].mean())
            speeds.append(-np.polyfit(times[middle] - times[middle[0]], along[middle], 1)[0])
        else:
            high.append(height[middle].mean())
    if len(moments) < STROKES or len(high) < STROKES or np.median(low) >= np.median(high):
        return None
    return np.array([moments, speeds])

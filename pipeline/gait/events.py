"""Foot strikes and foot-offs in walking and running, from hips and ankles alone.

Walking: a foot strikes where its ankle is farthest ahead of the pelvis along the direction of progression,
and leaves the ground where it is farthest behind (Zeni, Richards and Higginson 2008, Gait & Posture 27(4),
710-714, with the ankle in place of their heel and toe markers, because it is the one point of the foot that
every sensor sees). Both use positions only: no derivative amplifies a Kinect's noise, and a treadmill's belt
does not matter. Running: the leg swings back before it lands and after it leaves, so a foot is on the ground
only while its ankle is still there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.bouts import Bout

_POINTS = tuple(N[f"{joint}_{side}"] for joint in ("hip", "ankle") for side in SIDES)

RATE = 100.0  # Hz of the even clock: 30 Hz would put a foot strike 17 ms off
CUTOFF = 6.0  # Hz
MIN_DURATION = 0.6  # s that the filter and a step need
# A turning point counts if the ankle then returns by this share of its range; the range must exceed MIN_RANGE
# metres, since swaying on the spot is not walking.
RETURN_SHARE, MIN_RANGE = 0.35, 0.15
EDGE = 0.05  # s: a turning point as near to the beginning is the noise of a walk already under way
_STILL = 0.4  # of the speed over the ground, below which a runner's ankle is on the ground


@dataclass(frozen=True)
class FootEvents:
    """A bout of gait on an even clock, and when each foot (left, right) is on the ground.

    times: (T,) seconds at RATE; pelvis: (T, 3) midpoint of the hips, ankles: (T, 2, 3), metres, in the
    walker's axes over the ground: X ahead, the path straightened (on a treadmill, relative to the belt);
    seen: (T, 2) True where the capture shows both hips and this ankle, False where they are interpolated;
    strikes, offs: seconds of each foot's strikes and foot offs.
    """

    times: Array
    pelvis: Array
    ankles: Array
    seen: Mask
    strikes: tuple[Array, Array]
    offs: tuple[Array, Array]


def detect_foot_events(times: Array, bout: Bout) -> FootEvents | None:
    """Foot events of a bout of walking or running; times: (n,) seconds of its frames.

    None if hips or ankles are missing throughout, if the bout is shorter than MIN_DURATION, or if it has no
    turning point of each kind.
    """
    given = bout.positions[:, _POINTS]
    whole: Mask = np.asarray(np.isfinite(given).all(axis=-1))
    if len(times) < 4 or times[-1] - times[0] < MIN_DURATION or (whole.sum(axis=0) < 4).any():
        return None
    clock = np.arange(times[0], times[-1], 1.0 / RATE)
    points = _smooth(clock, times, given, whole)
    hips = whole[:, 0] & whole[:, 1]
    seen = np.stack([_nearest(clock, times, hips & whole[:, 2 + k]) for k in range(2)], axis=1)
    pelvis, ankles = points[:, :2].mean(axis=1), points[:, 2:]
    reach = ankles[..., 0] - pelvis[:, None, 0]
    # A runner's foot is farthest ahead some time before it lands.
    edge = 0.0 if bout.running else EDGE * RATE
    turns = [_turning_points(reach[:, k], edge) for k in range(2)]
    if not all(len(ahead) and len(behind) for ahead, behind in turns):
        return None
    if bout.running:
        advance = np.gradient(ankles[..., 0], 1.0 / RATE, axis=0)
        speed = float(np.median(np.gradient(pelvis[:, 0], 1.0 / RATE)))
        turns = [_standing(advance[:, k], *turns[k], _STILL * speed) for k in range(2)]
    strikes, offs = (
        tuple(
            clock[0] + _refined(sign * reach[:, k], turns[k][which], running=bout.running) / RATE
            for k in range(2)
        )
        for which, sign in ((0, 1.0), (1, -1.0))
    )
    return FootEvents(clock, pelvis, ankles, seen, (strikes[0], strikes[1]), (offs[0], offs[1]))


def _smooth(clock: Array, times: Array, points: Array, whole: Mask) -> Array:
    """Points (T, P, 3) on the clock: gaps filled linearly, then a zero-phase low-pass of order 4."""
    filled = np.empty_like(points)
    for k in range(points.shape[1]):
        known = whole[:, k]
        for axis in range(3):
            filled[:, k, axis] = np.interp(times, times[known], points[known, k, axis])
    even = CubicSpline(times, filled, axis=0)(clock)
    return np.asarray(sosfiltfilt(butter(2, CUTOFF, fs=RATE, output="sos"), even, axis=0))


def _nearest(clock: Array, times: Array, flags: Mask) -> Mask:
    """Whether the frames before and after each time are flagged."""
    after = np.searchsorted(times, clock).clip(1, len(times) - 1)
    return np.asarray(flags[after] & flags[after - 1])


def _turning_points(reach: Array, edge: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples of the highs and of the lows from which (T,) returns by RETURN_SHARE of its range.

    At the clip's ends it need not return so far on the outer side, only at all: the last sample, and those
    within `edge` of the beginning, are never turning points, since what lies beyond is unknown.
    """
    low, high = np.percentile(reach, [2, 98])
    if high - low < MIN_RANGE:
        return np.array([], dtype=np.intp), np.array([], dtype=np.intp)
    threshold = RETURN_SHARE * (high - low)
    highs: list[int] = []
    lows: list[int] = []
    top = bottom = 0
    rising: bool | None = None
    for k, value in enumerate(reach):
        top = k if value > reach[top] else top
        bottom = k if value < reach[bottom] else bottom
        if rising is not False and value < reach[top] - threshold:
            highs.append(top)
            rising, bottom = False, k
        elif rising is not True and value > reach[bottom] + threshold:
            lows.append(bottom)
            rising, top = True, k
    if rising is not None:
        last = top if rising else bottom
        if last < len(reach) - 1:
            (highs if rising else lows).append(last)
    return np.array([k for k in highs if k > edge], np.intp), np.array([k for k in lows if k > edge], np.intp)


def _stances(ahead: NDArray[np.intp], behind: NDArray[np.intp]) -> list[tuple[int, int]]:
    """(strike, off) samples: each high with the low that follows it before the next high."""
    last = np.iinfo(np.intp).max
    following, next_ahead = np.append(behind, last), np.append(ahead[1:], last)
    low = following[np.searchsorted(behind, ahead, "right")]
    return [
        (int(start), int(end))
        for start, end, limit in zip(ahead, low, next_ahead, strict=True)
        if end < limit
    ]


def _standing(
    advance: Array, ahead: NDArray[np.intp], behind: NDArray[np.intp], limit: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last samples of each stance, around its middle, in which the ankle is slower than `limit`.

    A stance that the clip's end cuts off has a first sample only.
    """
    first, last = [], []
    for start, end in _stances(ahead, behind):
        slow = np.abs(advance[start : end + 1]) < limit
        if not slow.any():
            continue
        middle = int(np.argmin(np.abs(np.flatnonzero(slow) - (end - start) / 2)))
        middle = int(np.flatnonzero(slow)[middle])
        fast = np.flatnonzero(~slow)
        before, after = fast[fast < middle], fast[fast > middle]
        first.append(start + (int(before[-1]) + 1 if len(before) else 0))
        last.append(start + (int(after[0]) - 1 if len(after) else end - start))
    if len(ahead) and not (behind > ahead[-1]).any():
        landed = np.flatnonzero(np.abs(advance[ahead[-1] :]) < limit)
        first += [int(ahead[-1] + landed[0])] if len(landed) else []
    return np.array(first, np.intp), np.array(last, np.intp)


def _refined(values: Array, peaks: NDArray[np.intp], *, running: bool) -> Array:
    """Peaks refined between samples by parabolas; in running, unrefined."""
    if running:
        return peaks.astype(np.float64)
    k = peaks.clip(1, len(values) - 2)
    before, here, after = values[k - 1], values[k], values[k + 1]
    bend = before - 2.0 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1.0), 0.0)
    return np.asarray(k + np.clip(shift, -0.5, 0.5))

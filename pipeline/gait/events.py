"""When the feet of a walker or runner come down and leave the ground, from hips and ankles alone.

Walking: a foot comes down where its ankle is farthest before the pelvis along the direction of progression,
and leaves the ground where it is farthest behind (Zeni, Richards and Higginson 2008, Gait & Posture 27(4),
710-714, with the ankle in place of their heel and toe markers, because that is the one point of the foot that
every sensor sees). Both are positions: no derivative blows up a Kinect's noise, and a treadmill's belt does
not matter. Running: the leg already swings back before it lands and on after it has left, so that a foot is
down only while its ankle stands still on the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

SIDES: tuple[str, str] = ("left", "right")
_POINTS = tuple(N[f"{joint}_{side}"] for joint in ("hip", "ankle") for side in SIDES)

RATE = 100.0  # Hz of the even clock: 30 Hz would put a foot strike 17 ms off
CUTOFF = 6.0  # Hz
SHORTEST = 0.6  # s that the filter and a step need
WINDOW = 1.0  # s, about a stride, over which the pelvis' sway cancels out of the direction of the path
TRAVELS = 0.3  # m/s below which nobody goes anywhere: on a treadmill, or not walking at all
# A turning point counts when the ankle then comes back by this share of its whole range, and the range by
# this much in metres: whoever sways on the spot does not walk.
TURNS, LEAST_RANGE = 0.35, 0.15
BOUNCES = 0.4  # correlation of the pelvis' height with the distance of the ankles, above which one runs
_STILL = 0.4  # of the speed over the ground, below which a runner's ankle stands on it


@dataclass(frozen=True)
class FootEvents:
    """A pass of gait on an even clock, and when each foot (left, right) is on the ground.

    times: (T,) seconds at RATE; pelvis: (T, 3) middle of the hips and ankles: (T, 2, 3), metres, in axes that
    lie still on the ground (a treadmill's belt is the ground); forward: (T, 2) unit vectors of progression;
    seen: (T, 2) whether the capture shows both hips and this ankle, or they are interpolated;
    strikes, offs: seconds at which each foot comes down and leaves the ground;
    belt: m/s of a treadmill's belt, 0 on firm ground; treads: of each foot (2, S) seconds and m/s backward of
    its stances while it lies flat on a belt, none on firm ground; running: whether the body bounces, and does
    not vault.
    """

    times: Array
    pelvis: Array
    ankles: Array
    forward: Array
    seen: Mask
    strikes: tuple[Array, Array]
    offs: tuple[Array, Array]
    belt: float
    treads: tuple[Array, Array]
    running: bool


def detect_foot_events(times: Array, positions: Array) -> FootEvents | None:
    """The gait in one pass: times (T,) in seconds, positions (T, 20, 3) of the 20 nodes in metres.

    None where hips or ankles are missing throughout, where the pass is shorter than SHORTEST, or where nobody
    walks: no foot is put before the other, or none carries the body on at TRAVELS.
    """
    given = positions[:, _POINTS]
    whole: Mask = np.asarray(np.isfinite(given).all(axis=-1))
    if len(times) < 4 or times[-1] - times[0] < SHORTEST or (whole.sum(axis=0) < 4).any():
        return None
    clock = np.arange(times[0], times[-1], 1.0 / RATE)
    points = _smooth(clock, times, given, whole)
    hips = whole[:, 0] & whole[:, 1]
    seen = np.stack([_nearest(clock, times, hips & whole[:, 2 + k]) for k in range(2)], axis=1)
    pelvis, ankles = points[:, :2].mean(axis=1), points[:, 2:]
    forward, travels = _progression(clock, pelvis, points)
    reach = np.einsum("tkc,tc->tk", ankles[..., :2] - pelvis[:, None, :2], forward)
    turns = [_turning_points(reach[:, k]) for k in range(2)]
    if not all(len(ahead) and len(behind) for ahead, behind in turns):
        return None
    advance = np.einsum("tkc,tc->tk", np.gradient(ankles[..., :2], 1.0 / RATE, axis=0), forward)
    belt, treads = 0.0, (np.empty((2, 0)), np.empty((2, 0)))
    if not travels:
        flat = [_flat(*turns[k]) for k in range(2)]
        belt = -_ground_speed(advance, flat)
        treads = (_treads(clock, advance[:, 0], flat[0]), _treads(clock, advance[:, 1], flat[1]))
        if belt < TRAVELS:
            return None
        ankles, pelvis = (_on_belt(points, belt, forward) for points in (ankles, pelvis))
        advance = advance + belt
    running = _bounces(pelvis[:, 2], np.abs(reach[:, 0] - reach[:, 1]))
    if running:
        speed = float(np.median(np.sum(np.gradient(pelvis[:, :2], 1.0 / RATE, axis=0) * forward, axis=1)))
        turns = [_standing(advance[:, k], *turns[k], _STILL * speed) for k in range(2)]
    strikes, offs = (
        tuple(
            clock[0] + _refined(sign * reach[:, k], turns[k][which], running=running) / RATE for k in range(2)
        )
        for which, sign in ((0, 1.0), (1, -1.0))
    )
    return FootEvents(
        times=clock,
        pelvis=pelvis,
        ankles=ankles,
        forward=forward,
        seen=seen,
        strikes=(strikes[0], strikes[1]),
        offs=(offs[0], offs[1]),
        belt=belt,
        treads=treads,
        running=running,
    )


def _smooth(clock: Array, times: Array, points: Array, whole: Mask) -> Array:
    """Points (T, P, 3) on the clock: gaps closed by straight lines, zero-phase low-pass of order 4."""
    filled = np.empty_like(points)
    for k in range(points.shape[1]):
        known = whole[:, k]
        for axis in range(3):
            filled[:, k, axis] = np.interp(times, times[known], points[known, k, axis])
    even = CubicSpline(times, filled, axis=0)(clock)
    return np.asarray(sosfiltfilt(butter(2, CUTOFF, fs=RATE, output="sos"), even, axis=0))


def _nearest(clock: Array, times: Array, flags: Mask) -> Mask:
    """Whether the frames on both sides of each moment carry the flag."""
    after = np.searchsorted(times, clock).clip(1, len(times) - 1)
    return np.asarray(flags[after] & flags[after - 1])


def _progression(clock: Array, pelvis: Array, points: Array) -> tuple[Array, bool]:
    """Unit vectors forward (T, 2), and whether the pelvis travels along them.

    Of who travels: the way of the pelvis over a stride, which may bend. Of who does not: the line along which
    the ankles part, for a depth sensor sees the line of the hips up to 40 degrees off.
    """
    early, late = (np.clip(clock + s * WINDOW / 2, clock[0], clock[-1]) for s in (-1, 1))
    way = np.stack(
        [np.interp(late, clock, pelvis[:, k]) - np.interp(early, clock, pelvis[:, k]) for k in (0, 1)]
    )
    length = np.hypot(*way)
    if np.median(length / (late - early)) > TRAVELS:
        return np.asarray((way / np.maximum(length, 1e-9)).T), True
    x, y = (points[:, 2, :2] - points[:, 3, :2]).T
    # A line has no front: twice its angle is what can be averaged and followed. Two strides settle it.
    twice = np.arctan2(_mean_about(2.0 * x * y, 2.0 * WINDOW), _mean_about(x * x - y * y, 2.0 * WINDOW))
    angle = 0.5 * np.unwrap(twice)
    forward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    left = points[:, 0, :2] - points[:, 1, :2]
    facing = _mean_about(forward[:, 0] * left[:, 1] - forward[:, 1] * left[:, 0], 2.0 * WINDOW)
    return np.where(facing[:, None] >= 0, forward, -forward), False


def _mean_about(values: Array, span: float) -> Array:
    """Mean of (T,) over `span` seconds around each moment; at the ends over what there is of them."""
    half = int(0.5 * span * RATE)
    sums = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    first, last = np.maximum(at - half, 0), np.minimum(at + half + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first))


def _turning_points(reach: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples at which (T,) turns back from its highs and from its lows, by TURNS of its range.

    The first and the last sample are no turning points: what lies beyond them is not known.
    """
    low, high = np.percentile(reach, [2, 98])
    if high - low < LEAST_RANGE:
        return np.array([], dtype=np.intp), np.array([], dtype=np.intp)
    threshold = TURNS * (high - low)
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
    return np.array([k for k in highs if k > 0], np.intp), np.array([k for k in lows if k > 0], np.intp)


def _stances(ahead: NDArray[np.intp], behind: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Each high with the low that follows it before the next high."""
    last = np.iinfo(np.intp).max
    following, next_ahead = np.append(behind, last), np.append(ahead[1:], last)
    low = following[np.searchsorted(behind, ahead, "right")]
    return [
        (int(start), int(end))
        for start, end, limit in zip(ahead, low, next_ahead, strict=True)
        if end < limit
    ]


def _flat(ahead: NDArray[np.intp], behind: NDArray[np.intp]) -> list[slice]:
    """Samples of each stance in which the foot lies flat.

    That is the second quarter of a stance: later the heel rises and takes the ankle forward with it.
    """
    quarters = [(start, (end - start) // 4, (end - start) // 2) for start, end in _stances(ahead, behind)]
    return [slice(start + one, start + two) for start, one, two in quarters if two > one]


def _ground_speed(advance: Array, flat: list[list[slice]]) -> float:
    """Median speed forward (m/s) of the ankles (T, 2) while their foot lies flat."""
    speeds = [advance[part, k] for k in range(2) for part in flat[k]]
    return float(np.median(np.concatenate(speeds))) if speeds else 0.0


def _treads(clock: Array, advance: Array, flat: list[slice]) -> Array:
    """Moments and median speeds backward (2, S) of an ankle in its flat stances."""
    return np.array([[clock[part].mean(), -np.median(advance[part])] for part in flat]).reshape(-1, 2).T


def _on_belt(points: Array, belt: float, forward: Array) -> Array:
    """Points (T, ..., 3) as seen from the belt, on which the walker advances."""
    moved = points.copy()
    way = np.cumsum(belt / RATE * forward, axis=0)
    moved[..., :2] += way.reshape(len(way), *(1,) * (points.ndim - 2), 2)
    return moved


def _bounces(height: Array, apart: Array) -> bool:
    """Whether the pelvis is high when the ankles are far apart: in flight, as in running.

    Walking vaults over a stiff leg, so that the pelvis is lowest then (Cavagna, Heglund and Taylor 1977,
    American Journal of Physiology 233, R243-R261). Correlations measured: walks -1.0 to 0.3 (a depth sensor
    with legs exchanged), runs 0.5 to 0.9.
    """
    up, out = (values - _mean_about(values, WINDOW) for values in (height, apart))
    return bool(up @ out > BOUNCES * np.linalg.norm(up) * np.linalg.norm(out))


def _standing(
    advance: Array, ahead: NDArray[np.intp], behind: NDArray[np.intp], limit: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Of each stance, first and last sample around its middle in which the ankle is slower than the limit."""
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
    return np.array(first, np.intp), np.array(last, np.intp)


def _refined(values: Array, peaks: NDArray[np.intp], *, running: bool) -> Array:
    """Peaks in samples, between samples where they are the top of a parabola."""
    if running:
        return peaks.astype(np.float64)
    k = peaks.clip(1, len(values) - 2)
    before, here, after = values[k - 1], values[k], values[k + 1]
    bend = before - 2.0 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1.0), 0.0)
    return np.asarray(k + np.clip(shift, -0.5, 0.5))

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

SIDES: tuple[str, str] = ("left", "right")
_POINTS = tuple(N[f"{joint}_{side}"] for joint in ("hip", "ankle") for side in SIDES)

RATE = 100.0  # Hz of the even clock: 30 Hz would put a foot strike 17 ms off
CUTOFF = 6.0  # Hz
MIN_DURATION = 0.6  # s that the filter and a step need
WINDOW = 1.0  # s, about a stride, over which the pelvis' sway cancels out of the direction of the path
TRAVEL_SPEED = 0.3  # m/s; at lower speeds, the subject is on a treadmill or does not walk
# A turning point counts if the ankle then returns by this share of its range; the range must exceed MIN_RANGE
# metres, since swaying on the spot is not walking.
RETURN_SHARE, MIN_RANGE = 0.35, 0.15
RUNNING_CORRELATION = 0.4  # of the pelvis' height with the distance of the ankles
_STILL = 0.4  # of the speed over the ground, below which a runner's ankle is on the ground


@dataclass(frozen=True)
class FootEvents:
    """A pass of gait on an even clock, and when each foot (left, right) is on the ground.

    times: (T,) seconds at RATE; pelvis: (T, 3) midpoint of the hips, ankles: (T, 2, 3), metres, in axes fixed
    to the ground (on a treadmill, to the belt); forward: (T, 2) unit vectors of progression; seen: (T, 2)
    True where the capture shows both hips and this ankle, False where they are interpolated; strikes, offs:
    seconds of each foot's strikes and foot offs; belt: m/s of a treadmill's belt, 0 on firm ground;
    belt_contacts: for each foot (2, S) time (s) and backward speed (m/s) of its stances while it lies flat on
    the belt, none on firm ground; running: whether the gait is running.
    """

    times: Array
    pelvis: Array
    ankles: Array
    forward: Array
    seen: Mask
    strikes: tuple[Array, Array]
    offs: tuple[Array, Array]
    belt: float
    belt_contacts: tuple[Array, Array]
    running: bool


def detect_foot_events(times: Array, positions: Array) -> FootEvents | None:
    """Foot events of one pass: times (T,) in seconds, positions (T, 20, 3) of the 20 nodes in metres.

    None if hips or ankles are missing throughout, if the pass is shorter than MIN_DURATION, or if nobody
    walks: the ankles do not alternate, or the subject moves slower than TRAVEL_SPEED over ground and belt.
    """
    given = positions[:, _POINTS]
    whole: Mask = np.asarray(np.isfinite(given).all(axis=-1))
    if len(times) < 4 or times[-1] - times[0] < MIN_DURATION or (whole.sum(axis=0) < 4).any():
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
    belt, belt_contacts = 0.0, (np.empty((2, 0)), np.empty((2, 0)))
    if not travels:
        flat = [_flat(*turns[k]) for k in range(2)]
        belt = -_ground_speed(advance, flat)
        belt_contacts = (
            _belt_contacts(clock, advance[:, 0], flat[0]),
            _belt_contacts(clock, advance[:, 1], flat[1]),
        )
        if belt < TRAVEL_SPEED:
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
        belt_contacts=belt_contacts,
        running=running,
    )


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


def _progression(clock: Array, pelvis: Array, points: Array) -> tuple[Array, bool]:
    """Unit vectors forward (T, 2), and whether the pelvis travels along them.

    If it travels: its displacement over a stride, which may follow a curve. If not: the line along which the
    ankles separate, because a depth sensor sees the hip line up to 40 degrees off.
    """
    early, late = (np.clip(clock + s * WINDOW / 2, clock[0], clock[-1]) for s in (-1, 1))
    way = np.stack(
        [np.interp(late, clock, pelvis[:, k]) - np.interp(early, clock, pelvis[:, k]) for k in (0, 1)]
    )
    length = np.hypot(*way)
    if np.median(length / (late - early)) > TRAVEL_SPEED:
        return np.asarray((way / np.maximum(length, 1e-9)).T), True
    x, y = (points[:, 2, :2] - points[:, 3, :2]).T
    # A line has no sign, so twice its angle is averaged and unwrapped, over two strides.
    twice = np.arctan2(_mean_about(2.0 * x * y, 2.0 * WINDOW), _mean_about(x * x - y * y, 2.0 * WINDOW))
    angle = 0.5 * np.unwrap(twice)
    forward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    left = points[:, 0, :2] - points[:, 1, :2]
    facing = _mean_about(forward[:, 0] * left[:, 1] - forward[:, 1] * left[:, 0], 2.0 * WINDOW)
    return np.where(facing[:, None] >= 0, forward, -forward), False


def _mean_about(values: Array, span: float) -> Array:
    """Moving mean of (T,) over `span` seconds, shorter at the ends."""
    half = int(0.5 * span * RATE)
    sums = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    first, last = np.maximum(at - half, 0), np.minimum(at + half + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first))


def _turning_points(reach: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples of the highs and of the lows from which (T,) returns by RETURN_SHARE of its range.

    The first and the last sample are never turning points, since what lies beyond them is unknown.
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
    return np.array([k for k in highs if k > 0], np.intp), np.array([k for k in lows if k > 0], np.intp)


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


def _flat(ahead: NDArray[np.intp], behind: NDArray[np.intp]) -> list[slice]:
    """Samples of each stance in which the foot lies flat: its second quarter.

    Later the heel rises and moves the ankle forward.
    """
    quarters = [(start, (end - start) // 4, (end - start) // 2) for start, end in _stances(ahead, behind)]
    return [slice(start + one, start + two) for start, one, two in quarters if two > one]


def _ground_speed(advance: Array, flat: list[list[slice]]) -> float:
    """Median forward speed (m/s) of the ankles (T, 2) while the foot lies flat."""
    speeds = [advance[part, k] for k in range(2) for part in flat[k]]
    return float(np.median(np.concatenate(speeds))) if speeds else 0.0


def _belt_contacts(clock: Array, advance: Array, flat: list[slice]) -> Array:
    """Times (s) and median backward speeds (m/s) of an ankle (T,) in its flat stances, (2, S)."""
    return np.array([[clock[part].mean(), -np.median(advance[part])] for part in flat]).reshape(-1, 2).T


def _on_belt(points: Array, belt: float, forward: Array) -> Array:
    """Points (T, ..., 3) in axes fixed to the belt."""
    moved = points.copy()
    way = np.cumsum(belt / RATE * forward, axis=0)
    moved[..., :2] += way.reshape(len(way), *(1,) * (points.ndim - 2), 2)
    return moved


def _bounces(height: Array, apart: Array) -> bool:
    """Whether the pelvis is high when the ankles are far apart, as in the flight phase of running.

    In walking the body vaults over a stiff leg, so the pelvis is lowest then (Cavagna, Heglund and Taylor
    1977, American Journal of Physiology 233, R243-R261). Measured correlations: walking -1.0 to 0.3 (a depth
    sensor with legs exchanged), running 0.5 to 0.9.
    """
    up, out = (values - _mean_about(values, WINDOW) for values in (height, apart))
    return bool(up @ out > RUNNING_CORRELATION * np.linalg.norm(up) * np.linalg.norm(out))


def _standing(
    advance: Array, ahead: NDArray[np.intp], behind: NDArray[np.intp], limit: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last samples of each stance, around its middle, in which the ankle is slower than `limit`."""
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
    """Peaks refined between samples by parabolas; in running, unrefined."""
    if running:
        return peaks.astype(np.float64)
    k = peaks.clip(1, len(values) - 2)
    before, here, after = values[k - 1], values[k], values[k + 1]
    bend = before - 2.0 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1.0), 0.0)
    return np.asarray(k + np.clip(shift, -0.5, 0.5))

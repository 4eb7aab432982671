"""Period and phase of a gait, from one harmonic fitted to the ankles.

The distance of one ankle ahead of the other, along the direction of walking, is a sine to within a few per
cent of its variance, even for a Kinect; the knee's angle is not. One harmonic therefore gives the period
and the phase, and the quality of the fit shows whether the sensor distinguished the legs at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.phase.fourier import design

PERIODS = (0.5, 2.0)  # seconds of a stride
# Seconds over which the grid of periods is searched: over more strides its steps would miss the best one.
_GRID_SECONDS = 60.0
_RIDGE = 1e-12  # keeps a fit without any frames from being singular


@dataclass(frozen=True)
class Harmonic:
    """d(t) ≈ mean + amplitude · -cos 2π phase(t), phase(t) = (t - start) / period.

    r2: weighted coefficient of determination; weights: (T,) 0 to 1, Tukey's biweight; kept: share of the
    frames with a weight above one third.
    """

    period: float
    start: float
    amplitude: float
    r2: float
    weights: Array
    kept: float

    def phase(self, times: Array) -> Array:
        """Phases in cycles, unwrapped; an integer where the left ankle is farthest before the right."""
        return (np.asarray(times) - self.start) / self.period


def fit_harmonic(times: Array, ankles: Array, weights: Array | None = None) -> Harmonic:
    """One harmonic through x(right ankle) - x(left ankle), (T,) metres, by robust least squares.

    Tukey's biweight rejects outliers (legs swapped for some frames, spikes); its scale is at least 2 cm, a
    Kinect's noise, so that a clean recording keeps every frame.
    """
    given = np.ones(len(times)) if weights is None else weights
    origin = times[0]
    t = times - origin

    w = given.copy()
    period = _first_period(t, ankles, w)
    for _ in range(8):
        period = _nearest_period(t, ankles, w, period)
        residual = ankles - design(t / period, 1) @ _amplitudes(t, ankles, w, period)
        u = residual / (4.685 * max(1.4826 * float(np.median(np.abs(residual))), 0.02))
        w = given * np.where(np.abs(u) < 1.0, (1.0 - u**2) ** 2, 0.0)
    c = _amplitudes(t, ankles, w, period)
    error = float(w @ (ankles - design(t / period, 1) @ c) ** 2)
    spread = float(w @ (ankles - (w @ ankles) / w.sum()) ** 2)
    # c1 cos + c2 sin = -amplitude cos(2π (t - start) / period)
    start = origin + period * float(np.arctan2(-c[2], -c[1])) / (2.0 * np.pi)
    return Harmonic(
        period=period,
        start=start,
        amplitude=float(np.hypot(c[1], c[2])),
        r2=1.0 - error / spread if spread > 0 else 0.0,
        weights=w,
        kept=float(np.mean(w > given / 3.0)),
    )


def _first_period(t: Array, y: Array, w: Array) -> float:
    """The period in the best seen minute of y (T,), refined over twice as much around it, up to the whole."""
    minutes, minute = np.unique(np.floor(t / _GRID_SECONDS), return_inverse=True)
    best = float(minutes[np.argmax(np.bincount(minute, w))])
    middle, reach = (best + 0.5) * _GRID_SECONDS, 0.5 * _GRID_SECONDS
    near = np.abs(t - middle) <= reach
    period = _coarse_period(t[near], y[near], w[near])
    while not near.all():
        period = _nearest_period(t[near], y[near], w[near], period)
        reach *= 2.0
        near = np.abs(t - middle) <= reach
    return period


def _coarse_period(t: Array, y: Array, w: Array) -> float:
    """The period of a grid whose harmonic fits y (T,) best, with weights w (T,)."""
    # Fine enough that half a cycle's error over ten strides does not hide the best period. A loop, since an
    # hour's frames for all periods at once would take a gigabyte.
    grid = np.linspace(*PERIODS, 151)
    weighted = w * y
    explained = [
        float((design(t / period, 1).T @ weighted) @ _amplitudes(t, y, w, float(period))) for period in grid
    ]
    return float(grid[int(np.argmax(explained))])


def _amplitudes(t: Array, y: Array, w: Array, period: float) -> Array:
    """Coefficients (3,) of 1, cos and sin at a period."""
    x = design(t / period, 1)
    return np.asarray(np.linalg.solve(x.T @ (w[:, None] * x) + _RIDGE * np.eye(3), x.T @ (w * y)))


def _nearest_period(t: Array, y: Array, w: Array, period: float) -> float:
    """The best period near the given one, by Gauss-Newton over the period and the coefficients."""
    low, high = 0.93 * period, 1.07 * period
    c = _amplitudes(t, y, w, period)
    for _ in range(12):
        x = design(t / period, 1)
        by_period = 2.0 * np.pi * t / period**2 * (c[1] * x[:, 2] - c[2] * x[:, 1])
        both = np.column_stack([x, by_period])
        found = np.linalg.solve(both.T @ (w[:, None] * both) + _RIDGE * np.eye(4), both.T @ (w * y))
        c = np.asarray(found[:3], dtype=np.float64)
        after = float(np.clip(period + found[3], low, high))
        if abs(after - period) < 1e-10:
            break
        period = after
    return period


def end_to_end(values: Array) -> Array:
    """Mean of the last tenth of values (T, ...) minus mean of the first tenth."""
    count = max(1, len(values) // 10)
    return np.asarray(values[-count:].mean(axis=0) - values[:count].mean(axis=0))


def walking_direction(positions: Array) -> float:
    """Heading in radians of (T, 20, 3) positions: along the path of the hips.

    If they stay within 0.5 m, the heading is where the hip line faces; 0 without a frame that shows both.
    """
    middle = positions[:, [N["hip_left"], N["hip_right"]], :2].mean(axis=1)
    seen = np.isfinite(middle).all(axis=-1)
    if not seen.any():
        return 0.0
    path = end_to_end(middle[seen])
    if np.hypot(*path) > 0.5:
        return float(np.arctan2(path[1], path[0]))
    left = (positions[seen, N["hip_left"], :2] - positions[seen, N["hip_right"], :2]).mean(axis=0)
    return float(np.arctan2(-left[0], left[1]))

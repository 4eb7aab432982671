"""The phase of a gait, found in the ankles.

The distance of one ankle before the other, along the direction of walking, is a sine to within a few per
cent of its variance, even for a Kinect; the knee's angle is not. One harmonic therefore gives the period,
the phase, and, by how well it fits, whether the legs were told apart at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from kinemimic.pipeline.fourier import design
from kinemimic.pipeline.skeleton import NODE_INDEX as N

Array = NDArray[np.float64]

PERIODS = (0.5, 2.0)  # seconds of a stride


@dataclass(frozen=True)
class Harmonic:
    """d(t) ≈ mean + amplitude · -cos 2π phase(t), phase(t) = (t - start) / period.

    r2: explained share of the variance over the frames that count; weights: (T,) 0 to 1, Tukey's; kept: their
    share above one third.
    """

    period: float
    start: float
    amplitude: float
    r2: float
    weights: Array
    kept: float

    def phase(self, times: Array) -> Array:
        """Phases in cycles, not wrapped; whole where the left ankle is farthest before the right."""
        return (np.asarray(times) - self.start) / self.period


def fit_harmonic(times: Array, ankles: Array, weights: Array | None = None) -> Harmonic:
    """One harmonic through x(right ankle) - x(left ankle), (T,) metres, by robust least squares.

    Tukey's biweight throws out what does not belong (legs swapped for some frames, spikes); the scale starts
    at 2 cm, a Kinect's noise, so that a clean recording keeps every frame.
    """
    given = np.ones(len(times)) if weights is None else weights
    origin = times[0]
    t = times - origin

    def solve(period: float, w: Array) -> tuple[float, Array, Array]:
        x = design(t / period, 1)
        root = np.sqrt(w)
        c, *_ = np.linalg.lstsq(x * root[:, None], ankles * root, rcond=None)
        residual = ankles - x @ c
        return float(w @ residual**2), np.asarray(c), residual

    w = given.copy()
    # The grid is fine enough for half a cycle's error over ten strides not to hide the best period.
    grid = np.linspace(*PERIODS, 151)
    period = float(grid[np.argmin([solve(p, w)[0] for p in grid])])
    for _ in range(8):
        near = (0.93 * period, 1.07 * period)
        found = minimize_scalar(
            lambda p, w=w: solve(p, w)[0], bounds=near, method="bounded", options={"xatol": 1e-8}
        )
        period = float(found.x)
        residual = solve(period, w)[2]
        u = residual / (4.685 * max(1.4826 * float(np.median(np.abs(residual))), 0.02))
        w = given * np.where(np.abs(u) < 1.0, (1.0 - u**2) ** 2, 0.0)
    error, c, _ = solve(period, w)
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


def walking_direction(positions: Array) -> tuple[float, bool]:
    """Heading in radians of (T, 20, 3) positions, and whether it comes from the path.

    From where the hips went if they went anywhere, else from the way that the hip line faces.
    """
    middle = positions[:, [N["hip_left"], N["hip_right"]], :2].mean(axis=1)
    middle = middle[np.isfinite(middle).all(axis=-1)]
    ends = max(1, len(middle) // 10)
    path = middle[-ends:].mean(axis=0) - middle[:ends].mean(axis=0)
    if np.hypot(*path) > 0.5:
        return float(np.arctan2(path[1], path[0])), True
    left = np.nanmean(positions[:, N["hip_left"], :2] - positions[:, N["hip_right"], :2], axis=0)
    return float(np.arctan2(-left[0], left[1])), False

"""Kalman smoother that weights measurements by their states, bone lengths and residuals.

Each coordinate follows a constant-velocity model with white acceleration noise; the variance of a
measurement's error depends on the joint's state and on the lengths of its bones (bone_lengths.py). The Kalman
filter followed by the backward pass of Rauch, Tung and Striebel (1965, "Maximum likelihood estimates of
linear dynamic systems", AIAA Journal 3) gives the most probable path. That path also minimises

    sum_k w_k |y_k - x_k|^2  +  stiffness * sum_k |x_k - 2 x_(k-1) + x_(k-2)|^2

(divided differences on an uneven clock), whose normal equations have five bands. Solving them gives the
same estimate (tests/pipeline/filters/test_kalman.py compares it with the recursions) without a loop over
frames, and for all passes at once, because no second difference crosses from one pass to another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import median_filter

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.kinematics.spans import all_finite, median_step

# Inverse variance of an inferred joint's error over that of a tracked one's.
INFERRED_WEIGHT = 0.5
# The smoother halves the amplitude at the cut-off. The likelihood chooses the cut-off per joint from a grid
# of GRID_SIZE, from MIN_CUTOFF Hz to MAX_CUTOFF times the frame rate. A lower limit would lose the single
# step of a subject who stands for minutes.
MIN_CUTOFF = 3.0
MAX_CUTOFF = 0.45
GRID_SIZE = 7
# The likelihood assumes that the motion is equally rough throughout. A stride is rough where the knee changes
# direction, and would lose its peaks; the cut-off is therefore the likeliest one times this factor.
HEADROOM = 1.5
# Residuals beyond this many times the scatter lose weight (Student's t with few degrees of freedom).
TOLERANCE = 1.5
# Of the median step: stamps that nearly coincide say nothing about the speed between them.
_LEAST_STEP = 0.05
# Seconds over which the scatter is a running median: a fast movement is not a spike.
SCATTER_WINDOW = 1.0
# Rounds of reweighting.
ROUNDS = 3
# Smallest error of a recording (metres, or of a quaternion's component).
MIN_ERROR = 1e-4
# A measurement that keeps less than this share of its weight counts as rejected.
OVERRULED = 0.1


@dataclass(frozen=True)
class Smoothed:
    """values: (T, J, K); cutoff: (J,) Hz, NaN for a joint at rest; overruled: (T, J) measurements that the
    others contradict."""

    values: Array
    cutoff: Array
    overruled: Mask


def smooth(
    values: Array,
    times: Array,
    passes: NDArray[np.int32],
    states: NDArray[np.uint8],
    unknown: Mask,
    credibility: Array,
) -> Smoothed:
    """Smooth values (T, J, K) within passes; NaN and frames outside passes stay.

    states: (T, J) as in Clip; unknown: (T, J) finite values that were not measured (filled gaps); the
    estimate replaces them; credibility: (T, J) weights from 0 to 1 besides those of the states. Each run
    between NaN is smoothed by itself; its ends must be measured.
    """
    frames, joints = values.shape[:2]
    step = median_step(times, passes)
    result = Smoothed(values.copy(), np.full(joints, np.nan), np.zeros((frames, joints), dtype=np.bool_))
    if step == 0.0:
        return result
    weights = np.where(states == TRACKED, 1.0, INFERRED_WEIGHT) * credibility * ~unknown
    present = all_finite(values) & (passes >= 0)[:, None]
    for joint in range(joints):
        y, there = values[:, joint], present[:, joint]
        chain = Chain.of(times, passes, there, step)
        if chain.links == 0 or not np.ptp(y[there], axis=0).any():
            continue
        y = np.where(there[:, None], y, 0.0)
        x, share, cutoff = _robust(chain, y, np.where(there, weights[:, joint], 1.0), there)
        result.values[there, joint] = x[there]
        result.overruled[:, joint] = there & (share < OVERRULED)  # an unknown value keeps its share of 1
        result.cutoff[joint] = cutoff
    return result


def _robust(chain: Chain, y: Array, weights: Array, there: Mask) -> tuple[Array, Array, float]:
    """Estimate (T, K), share of its weight that each frame keeps (T,), cut-off in Hz.

    Iteratively reweighted least squares: by Student's t, a residual r of scatter s keeps the share
    1 / (1 + (r / TOLERANCE s)^2) of its weight; an inferred joint's scatter is larger by its weight.
    """
    share = np.ones(len(y))
    cutoff, error = chain.likely_cutoff(y, weights)
    window = 2 * int(0.5 * SCATTER_WINDOW / chain.step) + 1
    for _ in range(ROUNDS):
        x = chain.estimate(y, weights * share, chain.stiffness(cutoff))
        residual = np.sqrt(weights * np.mean((y - x) ** 2, axis=-1))
        measured = there & (weights > 0)
        scatter = np.full(len(y), error)
        scatter[measured] = np.maximum(error, median_filter(residual[measured], window, mode="nearest"))
        share = 1.0 / (1.0 + (residual / (TOLERANCE * scatter)) ** 2)
    cutoff = min(HEADROOM * chain.likely_cutoff(y, weights * share)[0], MAX_CUTOFF / chain.step)
    return chain.estimate(y, weights * share, chain.stiffness(cutoff)), share, cutoff


@dataclass(frozen=True)
class Chain:
    """Second differences of a joint over T frames, within runs of one pass.

    differences: (T-2, 3) rows of their coefficients, zero across the ends of a run; bands: (3, T) of their
    normal matrix, lower form; links: number of non-zero rows; step: median step in seconds.
    """

    differences: Array
    bands: Array
    links: int
    step: float

    @classmethod
    def of(cls, times: Array, passes: NDArray[np.int32], there: Mask, step: float) -> Chain:
        """The chain of the frames in the mask `there` (T,)."""
        linked = (passes[2:] == passes[:-2]) & there[2:] & there[1:-1] & there[:-2]
        steps = np.maximum(np.diff(times) / step, _LEAST_STEP)
        before, after = steps[:-1], steps[1:]
        # Slope after minus slope before, x - 2 x' + x'' on an even clock; the variance of the acceleration
        # noise grows with the mean of both steps.
        rows = np.stack([1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after], axis=-1)
        rows *= np.where(linked, np.sqrt(2.0 / (before + after)), 0.0)[:, None]
        bands = np.zeros((3, len(times)))
        for i in range(3):
            for j in range(i + 1):
                bands[i - j, j : j + len(rows)] += rows[:, i] * rows[:, j]
        return cls(rows, bands, int(linked.sum()), step)

    def stiffness(self, cutoff: float) -> float:
        """Weight of the second differences that halves the amplitude at `cutoff` Hz."""
        return float((2.0 * np.sin(np.pi * cutoff * self.step)) ** -4.0)

    def estimate(self, y: Array, weights: Array, stiffness: float) -> Array:
        """The most probable path (T, K) of measurements y (T, K) with weights (T,)."""
        return self._solve(y, weights, stiffness)[0]

    def likely_cutoff(self, y: Array, weights: Array) -> tuple[float, float]:
        """The most likely cut-off (Hz) of the measurements, and their error at it.

        Maximises the marginal likelihood with the error integrated out, "GML" of Wahba (1985, Annals of
        Statistics 13), over a grid of cut-offs, refined by a parabola through the best and its neighbours.
        """
        fastest = MAX_CUTOFF / self.step
        grid = np.geomspace(min(MIN_CUTOFF, 0.5 * fastest), fastest, GRID_SIZE)
        scores, errors = np.empty(GRID_SIZE), np.empty(GRID_SIZE)
        freedom = y.shape[1] * self.links
        for k, cutoff in enumerate(grid):
            stiffness = self.stiffness(cutoff)
            x, log_determinant = self._solve(y, weights, stiffness)
            bends = np.einsum("ti,tik->tk", self.differences, _windows(x))
            squares = np.sum(weights[:, None] * (y - x) ** 2) + stiffness * np.sum(bends**2)
            errors[k] = np.sqrt(squares / freedom + MIN_ERROR**2)
            scores[k] = 2.0 * freedom * np.log(errors[k])
            scores[k] += y.shape[1] * (log_determinant - self.links * np.log(stiffness))
        best = _vertex(scores)
        at = np.arange(GRID_SIZE)
        return float(np.exp(np.interp(best, at, np.log(grid)))), float(np.interp(best, at, errors))

    def _solve(self, y: Array, weights: Array, stiffness: float) -> tuple[Array, float]:
        bands = stiffness * self.bands
        bands[0] += weights
        factor = cholesky_banded(bands, overwrite_ab=True, lower=True, check_finite=False)
        x = cho_solve_banded((factor, True), weights[:, None] * y, overwrite_b=True, check_finite=False)
        return x, float(2.0 * np.sum(np.log(factor[0])))


def _windows(x: Array) -> Array:
    """Windows of three consecutive frames: (T-2, 3, K)."""
    return np.stack([x[:-2], x[1:-1], x[2:]], axis=1)


def _vertex(scores: Array) -> float:
    """Fractional index of the vertex of the parabola through the lowest score and its neighbours."""
    k = int(np.argmin(scores))
    if k in (0, len(scores) - 1):
        return float(k)
    low, middle, high = scores[k - 1 : k + 2]
    return float(k + 0.5 * (low - high) / (low - 2.0 * middle + high))

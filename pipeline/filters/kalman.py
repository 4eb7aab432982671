"""A Kalman smoother that knows which values were seen, which guessed and which are missing.

Each coordinate is a mass that random impulses push (constant velocity, white acceleration), each measurement
has an error whose variance depends on the joint's state. The Kalman filter followed by the backward pass of
Rauch, Tung and Striebel (1965, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3)
gives the most probable path. That path also is the minimum of

    sum_k w_k |y_k - x_k|^2  +  stiffness * sum_k |x_k - 2 x_(k-1) + x_(k-2)|^2

(second differences divided on an uneven clock), whose normal equations have five bands. Solving them is the
same estimate (tests/pipeline/test_kalman.py writes the recursions out and compares) without a loop over
frames: all passes at once, because no second difference reaches from one to another.
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
# Half the amplitude is left at the cut-off. The likelihood chooses it per joint, from SLOWEST Hz to FASTEST
# of the frame rate, among CHOICES: with less, who stands for minutes and takes one step would lose the step.
SLOWEST = 3.0
FASTEST = 0.45
CHOICES = 7
# The likelihood takes motion for equally rough throughout; a stride has its roughness where the knee turns,
# and would lose the peaks. So the cut-off is this much higher than the likelihood's.
HEADROOM = 1.5
# Residuals beyond this many times the usual scatter lose weight (Student's t with few degrees of freedom).
TOLERANCE = 1.5
# The usual scatter is at least that of the second around: motion quicker than usual is not a spike.
AROUND = 1.0
ROUNDS = 3
# An error (metres, or of a quaternion's component) below which no recording is.
LEAST_ERROR = 1e-4
# Shares of a measurement's weight: one left with less was overruled.
OVERRULED = 0.1


@dataclass(frozen=True)
class Smoothed:
    """values: (T, J, K); cutoff: (J,) Hz, NaN where nothing moves; overruled: (T, J) measurements that the
    rest contradicts."""

    values: Array
    cutoff: Array
    overruled: Mask


def smooth(
    values: Array, times: Array, passes: NDArray[np.int32], states: NDArray[np.uint8], unknown: Mask
) -> Smoothed:
    """Smooth values (T, J, K) within passes; frames outside of them, and NaN, stay.

    states: (T, J) as in Clip; unknown: (T, J) finite values that are nobody's measurement (filled gaps): they
    are replaced by the estimate. Each stretch between NaN is smoothed by itself; its ends must be measured.
    """
    frames, joints = values.shape[:2]
    step = median_step(times, passes)
    result = Smoothed(values.copy(), np.full(joints, np.nan), np.zeros((frames, joints), dtype=np.bool_))
    if step == 0.0:
        return result
    weights = np.where(states == TRACKED, 1.0, INFERRED_WEIGHT) * ~unknown
    present = all_finite(values) & (passes >= 0)[:, None]
    for joint in range(joints):
        y, there = values[:, joint], present[:, joint]
        chain = Chain.of(times, passes, there, step)
        if chain.links == 0 or not np.ptp(y[there], axis=0).any():
            continue
        y = np.where(there[:, None], y, 0.0)
        x, share, cutoff = _robust(chain, y, np.where(there, weights[:, joint], 1.0), there)
        result.values[there, joint] = x[there]
        result.overruled[:, joint] = there & (share < OVERRULED)  # the share of an unknown value is 1
        result.cutoff[joint] = cutoff
    return result


def _robust(chain: Chain, y: Array, weights: Array, there: Mask) -> tuple[Array, Array, float]:
    """Estimate (T, K), share of its weight that each frame kept (T,), cut-off in Hz.

    Iteratively reweighted: by Student's t a residual r of scatter s keeps 1 / (1 + (r / TOLERANCE s)^2) of
    its weight, where an inferred joint's scatter is larger by its state.
    """
    share = np.ones(len(y))
    cutoff, error = chain.likely(y, weights)
    window = 2 * int(0.5 * AROUND / chain.step) + 1
    for _ in range(ROUNDS):
        x = chain.estimate(y, weights * share, chain.stiffness(cutoff))
        residual = np.sqrt(weights * np.mean((y - x) ** 2, axis=-1))
        measured = there & (weights > 0)
        scatter = np.full(len(y), error)
        scatter[measured] = np.maximum(error, median_filter(residual[measured], window, mode="nearest"))
        share = 1.0 / (1.0 + (residual / (TOLERANCE * scatter)) ** 2)
    cutoff = min(HEADROOM * chain.likely(y, weights * share)[0], FASTEST / chain.step)
    return chain.estimate(y, weights * share, chain.stiffness(cutoff)), share, cutoff


@dataclass(frozen=True)
class Chain:
    """Second differences of a joint over T frames, those within a stretch of one pass.

    differences: (T-2, 3) rows of their coefficients, zero where not within; bands: (3, T) of their normal
    matrix, lower form; links: how many rows are not zero; step: usual step in seconds.
    """

    differences: Array
    bands: Array
    links: int
    step: float

    @classmethod
    def of(cls, times: Array, passes: NDArray[np.int32], there: Mask, step: float) -> Chain:
        """The chain of frames that are `there` (T,)."""
        linked = (passes[2:] == passes[:-2]) & there[2:] & there[1:-1] & there[:-2]
        before, after = np.diff(times)[:-1] / step, np.diff(times)[1:] / step
        # Slope after minus slope before, x - 2 x' + x'' on an even clock; a longer wait has room for more
        # impulses, so that the variance grows with the mean of both steps.
        rows = np.stack([1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after], axis=-1)
        rows *= np.where(linked, np.sqrt(2.0 / (before + after)), 0.0)[:, None]
        bands = np.zeros((3, len(times)))
        for i in range(3):
            for j in range(i + 1):
                bands[i - j, j : j + len(rows)] += rows[:, i] * rows[:, j]
        return cls(rows, bands, int(linked.sum()), step)

    def stiffness(self, cutoff: float) -> float:
        """Weight of the second differences for which half the amplitude is left at `cutoff` Hz."""
        return float((2.0 * np.sin(np.pi * cutoff * self.step)) ** -4.0)

    def estimate(self, y: Array, weights: Array, stiffness: float) -> Array:
        """The most probable path (T, K) of measurements y (T, K) with weights (T,)."""
        return self._solve(y, weights, stiffness)[0]

    def likely(self, y: Array, weights: Array) -> tuple[float, float]:
        """The cut-off (Hz) under which the measurements are most probable, and their error then.

        The marginal likelihood with the error integrated out, "GML" of Wahba (1985, Annals of Statistics
        13), over a grid of cut-offs, with a parabola through the best and its neighbours.
        """
        fastest = FASTEST / self.step
        grid = np.geomspace(min(SLOWEST, 0.5 * fastest), fastest, CHOICES)
        scores, errors = np.empty(CHOICES), np.empty(CHOICES)
        freedom = y.shape[1] * self.links
        for k, cutoff in enumerate(grid):
            stiffness = self.stiffness(cutoff)
            x, log_determinant = self._solve(y, weights, stiffness)
            bends = np.einsum("ti,tik->tk", self.differences, _windows(x))
            squares = np.sum(weights[:, None] * (y - x) ** 2) + stiffness * np.sum(bends**2)
            errors[k] = np.sqrt(squares / freedom + LEAST_ERROR**2)
            scores[k] = 2.0 * freedom * np.log(errors[k])
            scores[k] += y.shape[1] * (log_determinant - self.links * np.log(stiffness))
        best = _vertex(scores)
        at = np.arange(CHOICES)
        return float(np.exp(np.interp(best, at, np.log(grid)))), float(np.interp(best, at, errors))

    def _solve(self, y: Array, weights: Array, stiffness: float) -> tuple[Array, float]:
        bands = stiffness * self.bands
        bands[0] += weights
        factor = cholesky_banded(bands, overwrite_ab=True, lower=True, check_finite=False)
        x = cho_solve_banded((factor, True), weights[:, None] * y, overwrite_b=True, check_finite=False)
        return x, float(2.0 * np.sum(np.log(factor[0])))


def _windows(x: Array) -> Array:
    """Three frames after each other: (T-2, 3, K)."""
    return np.stack([x[:-2], x[1:-1], x[2:]], axis=1)


def _vertex(scores: Array) -> float:
    """Where, between the indices, the parabola through the lowest score and its neighbours is lowest."""
    k = int(np.argmin(scores))
    if k in (0, len(scores) - 1):
        return float(k)
    low, middle, high = scores[k - 1 : k + 2]
    return float(k + 0.5 * (low - high) / (low - 2.0 * middle + high))

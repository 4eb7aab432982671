"""Learning curves over samples: aggregation of seeds with confidence intervals, and convergence.

Seeds are aggregated by the interquartile mean with a bootstrap interval (Agarwal et al. 2021, Deep
Reinforcement Learning at the Edge of the Statistical Precipice). It is more robust to a lucky or a failed
seed than the mean, and statistically more efficient than the median.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

RESAMPLES = 2000
CONFIDENCE = 0.95
SMOOTHED = 3  # evaluations in the moving average that is tested for convergence
NEAR = 0.95  # share of its maximum above which a converged curve stays to the end
SETTLED = 0.25  # last share of the samples: a curve that first approaches its maximum here is still rising


@dataclass(frozen=True)
class Estimate:
    """Interquartile mean with its CONFIDENCE interval; all None without values, no interval for one."""

    mean: float | None
    low: float | None
    high: float | None
    n: int


def interquartile(values: Sequence[float], seed: int = 0) -> Estimate:
    """Aggregate of several seeds; deterministic."""
    found = np.array(values, dtype=np.float64)
    if not len(found):
        return Estimate(None, None, None, 0)
    mean = float(_middle_half(found))
    if len(found) == 1:
        return Estimate(mean, None, None, 1)
    draws = np.random.default_rng(seed).choice(found, (RESAMPLES, len(found)))
    return Estimate(mean, *interval(_middle_half(draws)), len(found))


def resamples(seeds: NDArray[np.int64]) -> NDArray[np.int32]:
    """RESAMPLES of a bootstrap (RESAMPLES, N): how often each of (N,) measurements was drawn; deterministic.

    seeds: (N,) to which seed each measurement belongs. Seeds are drawn, then measurements of each, both with
    replacement (Davison and Hinkley 1997, "Bootstrap Methods and their Application", 3.8); with one seed, it
    is the usual bootstrap. If seeds have different numbers of measurements, so have the resamples.
    """
    return _resamples(tuple(seeds.tolist()))


@lru_cache(maxsize=4)
def _resamples(belonging: tuple[int, ...]) -> NDArray[np.int32]:
    seeds, random = np.array(belonging), np.random.default_rng(0)
    members = [np.flatnonzero(seeds == seed) for seed in np.unique(seeds)]
    counts = np.zeros((RESAMPLES, len(seeds)), dtype=np.int32)
    for row in counts:
        for k in random.integers(len(members), size=len(members)):
            own = members[k]
            row[own] += np.bincount(random.integers(len(own), size=len(own)), minlength=len(own))
    counts.flags.writeable = False  # it is shared
    return counts


def interval(draws: Array) -> tuple[float, float]:
    """Bounds of the central CONFIDENCE share of the resamples."""
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(draws, [tail, 100.0 - tail])
    return float(low), float(high)


def _middle_half(values: Array) -> Array:
    """Mean of the middle half along the last axis. A value on the border counts by its share: of three
    values, the first and the last count a quarter each."""
    size = values.shape[-1]
    edges = np.clip(np.arange(size + 1), 0.25 * size, 0.75 * size)
    mean: Array = np.sort(values, axis=-1) @ (np.diff(edges) / (0.5 * size))
    return mean


def converged_at(samples: Sequence[float], values: Sequence[float]) -> float | None:
    """Number of samples after which the smoothed values stay above NEAR times their maximum; None if they end
    below it, reach it only within the last SETTLED share of the samples, or never rise above 0."""
    found = np.array(values, dtype=np.float64)
    if not len(found):
        return None
    padded = np.pad(found, (SMOOTHED // 2, SMOOTHED // 2), mode="edge")
    smooth = np.convolve(padded, np.full(SMOOTHED, 1.0 / SMOOTHED), mode="valid")
    if smooth.max() <= 0.0:
        return None
    below = np.flatnonzero(smooth < NEAR * smooth.max())
    first = int(below[-1]) + 1 if len(below) else 0
    if first == len(found) or samples[first] > (1.0 - SETTLED) * samples[-1]:
        return None
    return float(samples[first])


def ahead(ones: Sequence[float], others: Sequence[float], seed: int = 0) -> Estimate:
    """Difference of the interquartile means of two groups of seeds; n: size of the smaller group.

    Both groups are resampled. With only a few seeds the interval is no wider than their range.
    """
    if not len(ones) or not len(others):
        return Estimate(None, None, None, 0)
    first, second = (np.array(values, dtype=np.float64) for values in (ones, others))
    mean, n = float(_middle_half(first) - _middle_half(second)), min(len(first), len(second))
    if n == 1:
        return Estimate(mean, None, None, 1)
    random = np.random.default_rng(seed)
    draws = [_middle_half(random.choice(one, (RESAMPLES, len(one)))) for one in (first, second)]
    return Estimate(mean, *interval(draws[0] - draws[1]), n)


def aggregated(records: Sequence[Mapping[str, Any]], key: str) -> list[dict[str, Any]]:
    """One row per number of samples at which every seed was evaluated: samples and the Estimate of `key` over
    the seeds. records: policy.json of each seed."""
    by_seed = [
        {one["samples"]: one[key] for one in record["evaluations"] if one.get(key) is not None}
        for record in records
    ]
    shared = sorted(set.intersection(*map(set, by_seed))) if by_seed else []
    return [
        {"samples": samples, **vars(interquartile([curve[samples] for curve in by_seed]))}
        for samples in shared
    ]

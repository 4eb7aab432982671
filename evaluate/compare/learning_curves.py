"""Curves of trainings over samples: several seeds as one, with intervals, and where they have converged.

Several seeds are told by their interquartile mean with a bootstrap interval (Agarwal et al. 2021, Deep
Reinforcement Learning at the Edge of the Statistical Precipice): the mean of the middle half, which neither a
lucky nor a failed seed carries away as it does a mean, and which wastes fewer seeds than a median.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array

RESAMPLES = 2000
CONFIDENCE = 0.95
SMOOTHED = 3  # trials that a curve is averaged over before its convergence is looked for
NEAR = 0.95  # of its largest value: what stays above it to the end has converged
SETTLED = 0.25  # of all samples, at the end: a curve that comes near its largest value only there still rises


@dataclass(frozen=True)
class Told:
    """An interquartile mean and its interval of CONFIDENCE; all None of no values, no interval of one."""

    mean: float | None
    low: float | None
    high: float | None
    n: int


def interquartile(values: Sequence[float], seed: int = 0) -> Told:
    """What several seeds come to; the same for the same values."""
    found = np.array(values, dtype=np.float64)
    if not len(found):
        return Told(None, None, None, 0)
    mean = float(_middle_half(found))
    if len(found) == 1:
        return Told(mean, None, None, 1)
    draws = np.random.default_rng(seed).choice(found, (RESAMPLES, len(found)))
    return Told(mean, *interval(_middle_half(draws)), len(found))


def interval(draws: Array) -> tuple[float, float]:
    """The middle CONFIDENCE of resamples."""
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(draws, [tail, 100.0 - tail])
    return float(low), float(high)


def _middle_half(values: Array) -> Array:
    """Mean of the middle half of the last axis; a value across its border counts by its share, as the first
    and last of three do by a quarter each."""
    size = values.shape[-1]
    edges = np.clip(np.arange(size + 1), 0.25 * size, 0.75 * size)
    mean: Array = np.sort(values, axis=-1) @ (np.diff(edges) / (0.5 * size))
    return mean


def converged_at(samples: Sequence[float], values: Sequence[float]) -> float | None:
    """The number of samples from which the smoothed values stay above NEAR of their largest; None where they
    end below it, come to it only in the last SETTLED of all samples, or never rise above 0."""
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


def ahead(ones: Sequence[float], others: Sequence[float], seed: int = 0) -> Told:
    """By how much the interquartile mean of some seeds is above that of others; n: of the fewer.

    The interval is of both groups' draws; of no more than a few seeds it is no wider than their range.
    """
    if not len(ones) or not len(others):
        return Told(None, None, None, 0)
    first, second = (np.array(values, dtype=np.float64) for values in (ones, others))
    mean, n = float(_middle_half(first) - _middle_half(second)), min(len(first), len(second))
    if n == 1:
        return Told(mean, None, None, 1)
    random = np.random.default_rng(seed)
    draws = [_middle_half(random.choice(one, (RESAMPLES, len(one)))) for one in (first, second)]
    return Told(mean, *interval(draws[0] - draws[1]), n)


def together(records: Sequence[Mapping[str, Any]], key: str) -> list[dict[str, Any]]:
    """One row for each number of samples at which all seeds were tried: samples and the seeds' Told of a
    figure of their trials. records: policy.json of each seed."""
    by_seed = [
        {trial["samples"]: trial[key] for trial in record["evaluations"] if trial.get(key) is not None}
        for record in records
    ]
    shared = sorted(set.intersection(*map(set, by_seed))) if by_seed else []
    return [
        {"samples": samples, **vars(interquartile([curve[samples] for curve in by_seed]))}
        for samples in shared
    ]

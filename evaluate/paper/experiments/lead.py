"""Survival, the drop in reward that a disturbance causes, and the lead of one policy over another in paired
trials.

Trial k has the same start and disturbance for every policy, so trials are compared in pairs: those in which
neither control run falls and, for times, which start at the first effect, those that affect both humanoids.
An algorithm takes part with the policies of all its seeds.
Intervals are of CONFIDENCE, from a paired bootstrap (Efron 1979, Bootstrap Methods: Another Look at the
Jackknife).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.compare.learning_curves import interval, resamples
from kinemimic.evaluate.robustness.scenario_trials import (
    Trials,
    event_times,
    finite,
    median_time,
    summarize,
)
from kinemimic.pipeline.arrays import Array
from kinemimic.train.sim.world import CONTROL_RATE

# A statistic (R,) of R selections of N trials, given by how often each was chosen (R, N).
Statistic = Callable[[NDArray[np.int32]], Array]


def loss(trials: Sequence[Trials]) -> dict[str, Any]:
    """Largest drop of the mean reward below the control runs', over trials whose control run does not fall.

    trials: of the policies of each seed. share: of the maximum reward; low, high: its interval; trials: their
    number. None without trials.
    """
    of, seeds = _joined(trials)
    stands = ~of.control_fell
    gaps = (of.control - of.rewards)[stands]
    result = _estimate(lambda chosen: _largest(gaps, chosen), seeds[stands], basic=True)
    return {"share": result.pop("ahead"), **result}


def survival_interval(trials: Sequence[Trials]) -> list[float]:
    """Interval of the share of trials without a fall, over the seeds and the trials of each.

    The wider of Wilson's over all trials, which takes them for independent, and of the bootstrap's, which has
    no width where all survive or all fall.
    """
    of, seeds = _joined(trials)
    upright = of.fallen_at == of.rewards.shape[1]
    low, high = summarize(of)["survived_ci95"]
    found = _estimate(lambda chosen: _mean(upright, chosen), seeds)
    if found["low"] is None:
        return [low, high]
    return [min(low, found["low"]), max(high, found["high"])]


def lead(ours: Sequence[Trials], theirs: Sequence[Trials]) -> dict[str, Any]:
    """The lead of one algorithm over another, each with the trials of the policies of its seeds.

    loss: difference of the reward drops; recovery_s: how much earlier it recovers; fall_s: how much later it
    falls, both as differences of medians over the pairs. Each has ahead, low, high and trials (number of
    pairs); the times also ours and theirs, which are None if most trials never recover or fall; then ahead is
    None, too. In the interval, "never" counts as the end of the trial. Seed k is paired with seed k; where
    one algorithm has fewer seeds, its seeds repeat.
    """
    pairs_of_seeds = max(len(ours), len(theirs))
    joined = [_joined([one[k % len(one)] for k in range(pairs_of_seeds)]) for one in (ours, theirs)]
    (mine, seeds), (other, _) = joined
    stand = ~(mine.control_fell | other.control_fell)
    gaps = [(one.control - one.rewards)[stand] for one in (mine, other)]
    of_both = [event_times(trials) for trials in (mine, other)]
    pairs = of_both[0].affected & of_both[1].affected
    end = mine.rewards.shape[1] / CONTROL_RATE
    # Remaining time of the trial after the first difference.
    left = [(end - one.onset_s)[pairs] for one in of_both]

    def less(chosen: NDArray[np.int32]) -> Array:
        return _largest(gaps[1], chosen) - _largest(gaps[0], chosen)

    return {
        "loss": _estimate(less, seeds[stand], basic=True),
        "recovery_s": _later([one.recovery_s[pairs] for one in of_both], left, seeds[pairs], sign=-1.0),
        "fall_s": _later([one.fall_s[pairs] for one in of_both], left, seeds[pairs], sign=1.0),
    }


def _joined(trials: Sequence[Trials]) -> tuple[Trials, NDArray[np.int64]]:
    """All trials, and to which seed each belongs."""
    return Trials.joined(trials), np.repeat(np.arange(len(trials)), [len(one.rewards) for one in trials])


def _later(
    times: Sequence[Array], left: Sequence[Array], seeds: NDArray[np.int64], *, sign: float
) -> dict[str, Any]:
    """Signed difference of the median times, which are truncated at `left`."""
    ours, theirs = (np.minimum(one, end) for one, end in zip(times, left, strict=True))
    result = _estimate(lambda chosen: sign * (_median(ours, chosen) - _median(theirs, chosen)), seeds)
    known = [finite(median_time(one)) for one in times]
    if None in known:
        result["ahead"] = None
    return {**result, "ours": known[0], "theirs": known[1]}


def _mean(values: Array | NDArray[np.bool_], chosen: NDArray[np.int32]) -> Array:
    """Mean (R, ...) of the chosen values (N, ...)."""
    mean: Array = chosen / chosen.sum(axis=1, keepdims=True) @ values
    return mean


def _largest(gaps: Array, chosen: NDArray[np.int32]) -> Array:
    """Maximum (R,) over time of the mean of the chosen gaps (N, T)."""
    largest: Array = _mean(gaps, chosen).max(axis=1)
    return largest


def _median(times: Array, chosen: NDArray[np.int32]) -> Array:
    """`median_time` (R,) of the chosen times (N,)."""
    order = np.argsort(times)
    until = chosen[:, order].cumsum(axis=1)
    median: Array = times[order][(until > until[:, -1:] // 2).argmax(axis=1)]
    return median


def _estimate(statistic: Statistic, seeds: NDArray[np.int64], *, basic: bool = False) -> dict[str, Any]:
    """The statistic of all trials and its bootstrap interval; no interval for one trial.

    seeds: (N,) to which seed each trial belongs; basic: use the basic (reverse percentile) bootstrap, as a
    maximum over time requires: a resample's maximum is biased upwards as the sample's is.
    """
    count = len(seeds)
    if not count:
        return {"ahead": None, "low": None, "high": None, "trials": 0}
    (value,) = statistic(np.ones((1, count), dtype=np.int32)).tolist()
    if count == 1:
        return {"ahead": round(value, 6), "low": None, "high": None, "trials": 1}
    low, high = interval(statistic(resamples(seeds)))
    if basic:
        low, high = 2.0 * value - high, 2.0 * value - low
    result = {"ahead": value, "low": low, "high": high}
    return {**{key: round(one, 6) for key, one in result.items()}, "trials": count}

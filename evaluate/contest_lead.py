"""What a disturbance costs in reward, and how far one policy is ahead of another in the same trials.

Trial k begins alike and meets the same whoever performs it, so that trials are compared in pairs: those in
which neither twin falls and both figures are touched. Intervals are of CONFIDENCE, by drawing trials anew,
pairs together (Efron 1979, Bootstrap Methods: Another Look at the Jackknife).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.learning_curves import RESAMPLES, interval
from kinemimic.evaluate.scenario_trials import Trials, moments
from kinemimic.train.world import CONTROL_RATE

Array = NDArray[np.float64]
# What a selection of trials, by their indices, comes to.
Statistic = Callable[[NDArray[np.int64]], float]


def loss(trials: Trials) -> dict[str, Any]:
    """The largest loss of the mean reward against the twins' mean, over the trials whose twin stands.

    share: of the largest reward; low, high: its interval; trials: how many; None of none.
    """
    stands = ~trials.twin_fell
    gaps = (trials.calm - trials.rewards)[stands]
    told = _told(lambda chosen: _largest(gaps[chosen]), len(gaps))
    return {"share": told.pop("ahead"), **told, "trials": len(gaps)}


def lead(ours: Trials, theirs: Trials) -> dict[str, Any]:
    """By how much ours is ahead of theirs.

    trials: the number of pairs; loss: by how much less reward it loses; recovery_s: how much sooner it has
    recovered, fall_s: how much later it falls, of medians over the pairs. Each has ahead, low and high, the
    times also ours and theirs, None where most never do, and then there is no number to be ahead by. For the
    interval who never does counts as doing so when the trial ends.
    """
    first, second = moments(ours), moments(theirs)
    pairs = first.touched & second.touched
    gaps = [(one.calm - one.rewards)[pairs] for one in (ours, theirs)]
    end = ours.rewards.shape[1] / CONTROL_RATE
    return {
        "trials": int(pairs.sum()),
        "loss": _told(lambda chosen: _largest(gaps[1][chosen]) - _largest(gaps[0][chosen]), len(gaps[0])),
        "recovery_s": _sooner(first.recovery_s[pairs], second.recovery_s[pairs], end),
        "fall_s": _sooner(second.fall_s[pairs], first.fall_s[pairs], end, turned=True),
    }


def _sooner(ones: Array, others: Array, end: float, *, turned: bool = False) -> dict[str, Any]:
    """By how much the first's median time comes before the second's; turned: the first are theirs."""
    medians = [_middle(times) if len(times) else np.inf for times in (ones, others)]
    cut = [np.minimum(times, end) for times in (ones, others)]
    told = _told(lambda chosen: _middle(cut[1][chosen]) - _middle(cut[0][chosen]), len(ones))
    known = [round(median, 6) if np.isfinite(median) else None for median in medians]
    if None in known:
        told["ahead"] = None
    return {**told, **dict(zip(("theirs", "ours") if turned else ("ours", "theirs"), known, strict=True))}


def _largest(gaps: Array) -> float:
    """Of gaps (N, T) the mean's largest."""
    return float(gaps.mean(axis=0).max())


def _middle(times: Array) -> float:
    """The median, of an even number the later of both: between a time and never there is no mean."""
    return float(np.sort(times)[len(times) // 2])


def _told(statistic: Statistic, count: int) -> dict[str, Any]:
    """What all trials come to, and the interval of resamples; no interval of one trial."""
    if not count:
        return {"ahead": None, "low": None, "high": None}
    value = round(statistic(np.arange(count)), 6)
    if count == 1:
        return {"ahead": value, "low": None, "high": None}
    random = np.random.default_rng(0)
    draws = [statistic(random.integers(count, size=count)) for _ in range(RESAMPLES)]
    low, high = interval(np.array(draws))
    return {"ahead": value, "low": round(low, 6), "high": round(high, 6)}

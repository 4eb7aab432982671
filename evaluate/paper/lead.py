"""What a disturbance costs in reward, and how far one policy is ahead of another in the same trials.

Trial k begins alike and meets the same whoever performs it, so that trials are compared in pairs: those in
which neither twin falls, and for times, which begin with a touch, those that touch both figures. Intervals
are of CONFIDENCE, by drawing trials anew, pairs together (Efron 1979, Bootstrap Methods: Another Look at the
Jackknife).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.compare.learning_curves import RESAMPLES, interval
from kinemimic.evaluate.robustness.scenario_trials import Trials, finite, median_time, moments
from kinemimic.pipeline.arrays import Array
from kinemimic.train.sim.world import CONTROL_RATE

# What a selection of trials, by their indices, comes to.
Statistic = Callable[[NDArray[np.int64]], float]


def loss(trials: Trials) -> dict[str, Any]:
    """The largest loss of the mean reward against the twins' mean, over the trials whose twin stands.

    share: of the largest reward; low, high: its interval; trials: how many; None of none.
    """
    stands = ~trials.twin_fell
    gaps = (trials.calm - trials.rewards)[stands]
    told = _told(lambda chosen: _largest(gaps[chosen]), len(gaps), basic=True)
    return {"share": told.pop("ahead"), **told}


def lead(ours: Trials, theirs: Trials) -> dict[str, Any]:
    """By how much ours is ahead of theirs.

    loss: by how much less reward it loses; recovery_s: how much sooner it has recovered, fall_s: how much
    later it falls, of medians over the pairs. Each has ahead, low, high and trials, the number of pairs; the
    times also ours and theirs, None where most never do, and then there is no number to be ahead by. For the
    interval who never does counts as doing so when the trial ends.
    """
    stand = ~(ours.twin_fell | theirs.twin_fell)
    gaps = [(one.calm - one.rewards)[stand] for one in (ours, theirs)]
    of_both = [moments(trials) for trials in (ours, theirs)]
    pairs = of_both[0].touched & of_both[1].touched
    end = ours.rewards.shape[1] / CONTROL_RATE
    # What is left of the trial after the first difference.
    left = [(end - one.onset_s)[pairs] for one in of_both]

    def less(chosen: NDArray[np.int64]) -> float:
        return _largest(gaps[1][chosen]) - _largest(gaps[0][chosen])

    return {
        "loss": _told(less, len(gaps[0]), basic=True),
        "recovery_s": _later([one.recovery_s[pairs] for one in of_both], left, sign=-1.0),
        "fall_s": _later([one.fall_s[pairs] for one in of_both], left, sign=1.0),
    }


def _later(times: Sequence[Array], left: Sequence[Array], *, sign: float) -> dict[str, Any]:
    """By how much our median time is later than theirs, or sooner, by the sign; left: where they are cut."""
    ours, theirs = (np.minimum(one, end) for one, end in zip(times, left, strict=True))
    told = _told(lambda chosen: sign * (median_time(ours[chosen]) - median_time(theirs[chosen])), len(ours))
    known = [finite(median_time(one)) for one in times]
    if None in known:
        told["ahead"] = None
    return {**told, "ours": known[0], "theirs": known[1]}


def _largest(gaps: Array) -> float:
    """Of gaps (N, T) the mean's largest."""
    return float(gaps.mean(axis=0).max())


def _told(statistic: Statistic, count: int, *, basic: bool = False) -> dict[str, Any]:
    """What all trials come to, and the interval of resamples; no interval of one trial.

    basic: the interval is mirrored at what all come to, as a maximum over time asks for: a resample's is too
    large by as much as the sample's is.
    """
    if not count:
        return {"ahead": None, "low": None, "high": None, "trials": 0}
    value = statistic(np.arange(count))
    if count == 1:
        return {"ahead": round(value, 6), "low": None, "high": None, "trials": 1}
    random = np.random.default_rng(0)
    draws = [statistic(random.integers(count, size=count)) for _ in range(RESAMPLES)]
    low, high = interval(np.array(draws))
    if basic:
        low, high = 2.0 * value - high, 2.0 * value - low
    told = {"ahead": value, "low": low, "high": high}
    return {**{key: round(one, 6) for key, one in told.items()}, "trials": count}

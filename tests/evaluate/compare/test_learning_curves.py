"""Curves of several seeds: means of the middle half by hand, intervals that cover, where curves converge."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.compare.learning_curves import (
    Estimate,
    aggregated,
    ahead,
    converged_at,
    interquartile,
    resamples,
)


def test_the_interquartile_mean_is_that_of_the_middle_half() -> None:
    assert interquartile([1.0, 100.0, 3.0, 5.0]).mean == pytest.approx(4.0)
    assert interquartile([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1000.0]).mean == pytest.approx(3.5)
    # Of three, ¼ of the first and of the last beside the middle one.
    assert interquartile([0.9, 0.9, 0.0]).mean == pytest.approx((0.25 * 0.9 + 0.9 + 0.0) / 1.5)
    assert interquartile([]) == Estimate(None, None, None, 0)
    assert interquartile([2.0]) == Estimate(2.0, None, None, 1)
    same = interquartile([2.0, 2.0, 2.0])
    assert (same.mean, same.low, same.high, same.n) == pytest.approx((2.0, 2.0, 2.0, 3))


def test_the_interval_covers_as_often_as_it_says() -> None:
    """The middle half's mean of Gaussian seeds is the distribution's: most of 200 intervals have it."""
    random = np.random.default_rng(1)
    covered = 0
    for _ in range(200):
        estimate = interquartile(random.normal(5.0, 2.0, 40).tolist())
        assert estimate.low is not None
        assert estimate.high is not None
        covered += estimate.low <= 5.0 <= estimate.high
    assert 0.88 <= covered / 200 <= 0.99
    values = random.normal(0.0, 1.0, 6).tolist()
    assert interquartile(values) == interquartile(values)


def test_resamples_draw_seeds_and_then_as_many_measurements_as_each_has() -> None:
    one = resamples(np.zeros(4, dtype=np.int64))
    assert (one.sum(axis=1) == 4).all()
    assert 0.2 < (one == 0).mean() < 0.4  # (3 / 4) to the power of 4
    seeds = np.array([0, 0, 1, 1, 1, 1, 1])
    two = resamples(seeds)
    assert set(two.sum(axis=1)) == {4, 7, 10}
    assert set(two[:, :2].sum(axis=1)) == {0, 2, 4}
    assert two is resamples(seeds)
    with pytest.raises(ValueError, match="read-only"):
        two[0, 0] = 1


def test_a_lead_has_the_interval_of_both_groups() -> None:
    estimate = ahead([3.0, 3.0, 3.0], [1.0, 1.0, 1.0])
    assert (estimate.mean, estimate.low, estimate.high, estimate.n) == (2.0, 2.0, 2.0, 3)
    # Of three the first and the last count by a quarter each, of which the middle one has four sixths.
    estimate = ahead([0.0, 3.0, 6.0], [1.0, 1.0])
    assert estimate.mean == pytest.approx(2.0)
    assert estimate.low is not None and estimate.high is not None
    assert (estimate.low, estimate.high) == (-1.0, 5.0) and estimate.n == 2
    assert ahead([2.0], [1.0, 0.5]) == Estimate(1.25, None, None, 1)
    assert ahead([], [1.0]) == Estimate(None, None, None, 0)


def test_convergence_is_where_a_curve_comes_to_stay() -> None:
    samples = [10.0 * k for k in range(1, 11)]
    rising = [0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0, 1.0, 1.0, 1.0]
    # Smoothed over three: 0.93 at 60, 1.0 from 70 on.
    assert converged_at(samples, rising) == 70.0
    # What rises and falls again has not converged where it was first high.
    fallen = [0.4, 1.0, 1.0, 0.2, *[1.0] * 6]
    assert converged_at(samples, fallen) == 60.0
    # What comes near its best in the last quarter only may rise further.
    assert converged_at(samples, [*rising[:7], 0.2, 1.0, 1.0]) is None
    assert converged_at(samples, [0.1 * k for k in range(10)]) is None
    assert converged_at(samples, [0.5] * 10) == 10.0
    assert converged_at(samples, [0.0] * 10) is None
    # What ends below its best has not converged at all.
    assert converged_at(samples, [*rising[:7], 0.4, 0.4, 0.4]) is None
    assert converged_at([], []) is None


def test_seeds_are_told_where_all_of_them_were_tried() -> None:
    records = [
        {"evaluations": [{"samples": 10, "reward": 0.2}, {"samples": 20, "reward": 0.4}]},
        {"evaluations": [{"samples": 10, "reward": 0.4}, {"samples": 20, "reward": None}, {"samples": 30}]},
    ]
    (row,) = aggregated(records, "reward")
    assert row["samples"] == 10
    assert row["mean"] == pytest.approx(0.3)
    assert row["n"] == 2
    assert aggregated([], "reward") == []

"""GAE, the penalty rule, KL and the normaliser against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.distributions import Independent, Normal, kl_divergence

from kinemimic.train.networks import Normalizer, divergence, log_density
from kinemimic.train.ppo import adapt_penalty, adapt_rate, advantages


def column(*values: float) -> np.ndarray:
    return np.array(values, dtype=np.float64)[:, None]


def test_advantages_by_hand() -> None:
    """γ = 0.5, λ = 0.5, three steps without an end: δ = r + γ v' - v.

    δ0 = 1 + 1 - 1 = 1; δ1 = 2 + 0.5·4 - 2 = 2; δ2 = 3 + 0.5·2 - 4 = 0
    A2 = 0; A1 = 2 + 0.25·0 = 2; A0 = 1 + 0.25·2 = 1.5
    """
    found = advantages(
        column(1, 2, 3), column(1, 2, 4), column(2, 4, 2), column(0, 0, 0).astype(bool), 0.5, 0.5
    )
    np.testing.assert_allclose(found[:, 0], [1.5, 2.0, 0.0])


def test_a_fall_and_a_time_out_differ_by_the_bootstrap() -> None:
    """After step 0 the episode ends. Fall: nothing follows, A0 = 1 - 1 = 0. Time-out with V(s') = 6: A0 = 3.

    Neither lets step 1 (δ1 = 2 + 0.5·0 - 1 = 1) reach back.
    """
    ended = column(1, 0).astype(bool)
    fall = advantages(column(1, 2), column(1, 1), column(0, 0), ended, 0.5, 0.5)
    time_out = advantages(column(1, 2), column(1, 1), column(6, 0), ended, 0.5, 0.5)
    np.testing.assert_allclose(fall[:, 0], [0.0, 1.0])
    np.testing.assert_allclose(time_out[:, 0], [3.0, 1.0])


@pytest.mark.parametrize(
    ("kl", "running", "initial"),
    [(0.0066, 2.0, 0.5), (0.0067, 4.0, 4.0), (0.0149, 4.0, 4.0), (0.0151, 8.0, 2.0)],
)
def test_penalty_rule(kl: float, running: float, initial: float) -> None:
    """η = 0.01, coefficient 4 in force, 1 at the beginning: borders at 0.00667 and 0.015."""
    assert adapt_penalty(4.0, kl, 0.01, 1.0, "running") == running
    assert adapt_penalty(4.0, kl, 0.01, 1.0, "initial") == initial


def test_rate_steers_towards_the_target() -> None:
    assert adapt_rate(3e-4, 0.2, 0.1) == pytest.approx(2e-4)
    assert adapt_rate(3e-4, 0.05, 0.1) == pytest.approx(4.5e-4)
    assert adapt_rate(3e-4, 0.1, 0.1) == 3e-4
    assert adapt_rate(1e-3, 0.0, 0.1) == 1e-3


def test_gaussians_agree_with_torch() -> None:
    torch.manual_seed(0)
    mean_old, mean_new, actions = torch.randn(3, 5, 4).double()
    log_old, log_new = torch.randn(2, 4).double() * 0.3
    old = Independent(Normal(mean_old, log_old.exp()), 1)
    new = Independent(Normal(mean_new, log_new.exp()), 1)
    torch.testing.assert_close(log_density(actions, mean_new, log_new), new.log_prob(actions))
    torch.testing.assert_close(divergence(mean_old, log_old, mean_new, log_new), kl_divergence(old, new))


def test_normalizer_equals_the_statistics_of_everything_seen() -> None:
    random = np.random.default_rng(0)
    batches = [random.normal(3.0, 2.0, (n, 3)) for n in (1, 7, 40)]
    normalizer = Normalizer(3)
    for batch in batches:
        normalizer.update(batch)
    every = np.concatenate(batches)
    np.testing.assert_allclose(normalizer.mean, every.mean(axis=0))
    np.testing.assert_allclose(normalizer.scale, every.std(axis=0))

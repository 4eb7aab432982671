"""Gaussians against torch's own, and the gradients against those that torch derives from the loss."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor
from torch.distributions import Independent, Normal
from torch.distributions import kl_divergence as torch_kl_divergence

from kinemimic.train.ppo.objective import ActorBatch, kl_divergence, log_prob, policy_gradients

ROWS, ACTIONS = 50, 4


def gaussians() -> tuple[ActorBatch, Tensor, Tensor, Tensor]:
    """Actions of an old policy, its log std, and another policy's mean and log std."""
    torch.manual_seed(0)
    mean_old, shift, draws = torch.randn(3, ROWS, ACTIONS).double()
    log_old, change = 0.3 * torch.randn(2, ACTIONS).double()
    actions = mean_old + log_old.exp() * draws
    old = ActorBatch(actions, mean_old, log_prob(actions, mean_old, log_old), torch.randn(ROWS).double())
    return old, log_old, mean_old + 0.1 * shift, log_old + 0.1 * change


def test_gaussians_agree_with_torch() -> None:
    old, log_old, mean, log_std = gaussians()
    before = Independent(Normal(old.mean, log_old.exp()), 1)
    after = Independent(Normal(mean, log_std.exp()), 1)
    torch.testing.assert_close(log_prob(old.actions, mean, log_std), after.log_prob(old.actions))
    torch.testing.assert_close(
        kl_divergence(old.mean, log_old, mean, log_std), torch_kl_divergence(before, after)
    )


@pytest.mark.parametrize("clip", [None, 0.05, 0.2])
@pytest.mark.parametrize("penalty", [0.0, 2.0])
@pytest.mark.parametrize("entropy", [0.0, 0.01])
def test_gradients_are_the_derivatives_of_the_loss(
    clip: float | None, penalty: float, entropy: float
) -> None:
    old, log_old, mean, log_std = gaussians()
    mean.requires_grad_()
    log_std.requires_grad_()
    ratio = (log_prob(old.actions, mean, log_std) - old.log_prob).exp()
    surrogate = ratio * old.advantage
    if clip is not None:
        surrogate = torch.minimum(surrogate, ratio.clamp(1 - clip, 1 + clip) * old.advantage)
    distance = kl_divergence(old.mean, log_old, mean, log_std).mean()
    (penalty * distance - surrogate.mean() - entropy * log_std.sum()).backward()
    found = policy_gradients(old, log_old, mean.detach(), log_std.detach(), clip, penalty, entropy)
    torch.testing.assert_close(found.mean, mean.grad)
    torch.testing.assert_close(found.log_std, log_std.grad)
    outside = 0.0 if clip is None else float(((ratio - 1).abs() > clip).double().mean())
    assert float(found.clip_fraction) == pytest.approx(outside)
    assert clip is None or 0 < outside < 1

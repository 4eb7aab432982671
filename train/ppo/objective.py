"""Gradients of the policy loss: the clipped ratio of Schulman et al. 2017, and the KL penalty of Eq. 6."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor


def log_prob(actions: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """Log density (N,) of a diagonal Gaussian."""
    z = (actions - mean) / log_std.exp()
    return (-0.5 * z.square() - log_std - 0.5 * math.log(2 * math.pi)).sum(-1)


def kl_divergence(mean_old: Tensor, log_std_old: Tensor, mean_new: Tensor, log_std_new: Tensor) -> Tensor:
    """KL(old ‖ new) (N,) of diagonal Gaussians: the paper's Eq. 6 before its mean over time steps."""
    ratio = (2 * (log_std_old - log_std_new)).exp()
    shift = ((mean_old - mean_new) / log_std_new.exp()).square()
    return 0.5 * (ratio + shift - 1 + 2 * (log_std_new - log_std_old)).sum(-1)


class ActorBatch(NamedTuple):
    """N actions of the old policy.

    actions, mean: (N, A); log_prob: (N,); advantage: (N,).
    """

    actions: Tensor
    mean: Tensor
    log_prob: Tensor
    advantage: Tensor


class PolicyGradients(NamedTuple):
    """Gradients of the loss with respect to the new mean (N, A) and log std (A,); the share clipped."""

    mean: Tensor
    log_std: Tensor
    clip_fraction: Tensor


def policy_gradients(
    old: ActorBatch,
    log_std_old: Tensor,
    mean: Tensor,
    log_std: Tensor,
    clip: float | None,
    penalty: float,
    entropy: float,
) -> PolicyGradients:
    """Gradients of L = - mean min(ρ A, clamp(ρ, 1 ± clip) A) + penalty mean KL(old ‖ new) - entropy Σ log σ.

    ρ = π(a) / π_old(a), so that with z = (a - μ) / σ:  ∂ρ/∂μ = ρ z / σ  and  ∂ρ/∂log σ = ρ (z² - 1).
    The gradient is zero where the minimum takes the clamped branch.
    clip: None for the plain ratio; penalty, entropy: 0 without that term.
    """
    std, rows = log_std.exp(), len(mean)
    z = (old.actions - mean) / std
    ratio = (log_prob(old.actions, mean, log_std) - old.log_prob).exp()
    surrogate = old.advantage * ratio
    clip_fraction = torch.zeros(())
    if clip is not None:
        surrogate = surrogate * (surrogate <= old.advantage * ratio.clamp(1 - clip, 1 + clip))
        clip_fraction = ((ratio - 1).abs() > clip).float().mean()
    weight = (surrogate / -rows)[:, None]
    by_mean, by_log_std = weight * z / std, (weight * (z.square() - 1)).sum(0) - entropy
    if penalty > 0:
        shift = (mean - old.mean) / std
        by_mean = by_mean + penalty / rows * shift / std
        by_log_std = by_log_std + penalty * (1 - (2 * (log_std_old - log_std)).exp() - shift.square().mean(0))
    return PolicyGradients(by_mean, by_log_std, clip_fraction)

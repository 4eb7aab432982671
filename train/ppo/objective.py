"""What the policy descends, as slopes: the clipped ratio of Schulman et al. 2017, and Eq. 6's KL penalty."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor


def log_density(actions: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    """Logarithm of the diagonal Gaussian's density, (N,)."""
    z = (actions - mean) / log_std.exp()
    return (-0.5 * z.square() - log_std - 0.5 * math.log(2 * math.pi)).sum(-1)


def divergence(mean_old: Tensor, log_old: Tensor, mean_new: Tensor, log_new: Tensor) -> Tensor:
    """KL(old ‖ new) of diagonal Gaussians, (N,): the paper's Eq. 6 before its mean over time steps."""
    ratio = (2 * (log_old - log_new)).exp()
    shift = ((mean_old - mean_new) / log_new.exp()).square()
    return 0.5 * (ratio + shift - 1 + 2 * (log_new - log_old)).sum(-1)


class Choices(NamedTuple):
    """N actions that the old policy took.

    actions, mean: (N, A); density: (N,) its logarithm; gain: (N,) the advantage.
    """

    actions: Tensor
    mean: Tensor
    density: Tensor
    gain: Tensor


class Slopes(NamedTuple):
    """Derivatives of the loss by the new mean (N, A) and by its noise's logarithm (A,); the share clipped."""

    mean: Tensor
    log_std: Tensor
    clipped: Tensor


def policy_slopes(
    old: Choices,
    log_old: Tensor,
    mean: Tensor,
    log_std: Tensor,
    clip: float | None,
    penalty: float,
    entropy: float,
) -> Slopes:
    """Slopes of L = - mean min(ρ A, clamp(ρ, 1 ± clip) A) + penalty mean KL(old ‖ new) - entropy Σ log σ.

    ρ = π(a) / π_old(a), so that with z = (a - μ) / σ:  ∂ρ/∂μ = ρ z / σ  and  ∂ρ/∂log σ = ρ (z² - 1).
    Where the minimum takes the clamped branch nothing flows.
    clip: None for the plain ratio; penalty, entropy: 0 without such a term.
    """
    action_std, rows = log_std.exp(), len(mean)
    z = (old.actions - mean) / action_std
    ratio = (log_density(old.actions, mean, log_std) - old.density).exp()
    flow = old.gain * ratio
    clipped = torch.zeros(())
    if clip is not None:
        flow = flow * (flow <= old.gain * ratio.clamp(1 - clip, 1 + clip))
        clipped = ((ratio - 1).abs() > clip).float().mean()
    weight = (flow / -rows)[:, None]
    by_mean, by_noise = weight * z / action_std, (weight * (z.square() - 1)).sum(0) - entropy
    if penalty > 0:
        shift = (mean - old.mean) / action_std
        by_mean = by_mean + penalty / rows * shift / action_std
        by_noise = by_noise + penalty * (1 - (2 * (log_old - log_std)).exp() - shift.square().mean(0))
    return Slopes(by_mean, by_noise, clipped)

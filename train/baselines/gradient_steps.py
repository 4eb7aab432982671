"""Gradient steps of DDPG, TD3 and SAC on stable-baselines3's networks, faster than its own.

The steps draw no random numbers and never wait for a loss, so a CUDA graph can record them (`cuda_graph.py`).
The actor's loss is not differentiated with respect to the critics' weights. The arithmetic is
stable-baselines3's, with the same draws in the same order: a step gives the same weights up to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import torch
from stable_baselines3 import SAC, TD3
from stable_baselines3.sac.policies import Actor
from torch import Tensor, nn

_LOG_ROOT = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class Minibatch:
    """N samples of the replay buffer: observations, next_observations (N, O), normalised; actions (N, 42) in
    [-1, 1], before the bound; dones, rewards (N, 1); noise (D, N, 42): standard normal, D draws each."""

    observations: Tensor
    actions: Tensor
    next_observations: Tensor
    dones: Tensor
    rewards: Tensor
    noise: Tensor


def sac_step(model: SAC, batch: Minibatch) -> None:
    """One step of SAC (Haarnoja et al. 2018, arXiv:1812.05905): entropy's weight, critics, actor, targets."""
    logarithm, optimizer = model.log_ent_coef, model.ent_coef_optimizer
    assert logarithm is not None and optimizer is not None  # noqa: S101 (the weight is learned)
    assert isinstance(model.target_entropy, float)  # noqa: S101 (narrows the type)
    actions, likelihood = _sampled(model.actor, batch.observations, batch.noise[0])
    weight = logarithm.detach().exp()
    surplus = (likelihood + model.target_entropy).detach()
    _descend(optimizer, -(logarithm * surplus).mean())

    with torch.no_grad():
        following, following_likelihood = _sampled(model.actor, batch.next_observations, batch.noise[1])
        values = _lowest(model.critic_target(batch.next_observations, following))
        values = values - weight * following_likelihood
        target = batch.rewards + (1.0 - batch.dones) * model.gamma * values
    _descend(model.critic.optimizer, 0.5 * _errors(model.critic(batch.observations, batch.actions), target))

    values = _lowest(model.critic(batch.observations, actions))
    _descend(model.actor.optimizer, (weight * likelihood - values).mean())
    _approach(model.critic_target, model.critic, model.tau)


def td3_step(model: TD3, batch: Minibatch, *, actor: bool) -> None:
    """One step of TD3 (Fujimoto et al. 2018, arXiv:1802.09477), or of DDPG, which is its special case.

    actor: also update the actor and the targets, which are delayed.
    """
    with torch.no_grad():
        limit = model.target_noise_clip
        noise = (batch.noise[0] * model.target_policy_noise).clamp(-limit, limit)
        following = (model.actor_target(batch.next_observations) + noise).clamp(-1.0, 1.0)
        values = _lowest(model.critic_target(batch.next_observations, following))
        target = batch.rewards + (1.0 - batch.dones) * model.gamma * values
    _descend(model.critic.optimizer, _errors(model.critic(batch.observations, batch.actions), target))
    if not actor:
        return
    values = model.critic.q1_forward(batch.observations, model.actor(batch.observations))
    _descend(model.actor.optimizer, -values.mean())
    _approach(model.critic_target, model.critic, model.tau)
    _approach(model.actor_target, model.actor, model.tau)


def draw(model: SAC | TD3, size: int) -> Minibatch:
    """A minibatch on the model's device, drawn as stable-baselines3 does."""
    assert model.replay_buffer is not None  # noqa: S101 (narrows the type)
    samples = model.replay_buffer.sample(size, env=model._vec_normalize_env)
    draws = 2 if isinstance(model, SAC) else 1
    noise = torch.stack([_normal(samples.actions) for _ in range(draws)])
    return Minibatch(
        samples.observations,
        samples.actions,
        samples.next_observations,
        samples.dones,
        samples.rewards,
        noise,
    )


def steps(model: SAC | TD3, batches: list[Minibatch], first: int) -> None:
    """A gradient step on each minibatch; first: number of steps since the actor's last one."""
    for number, batch in enumerate(batches, start=first + 1):
        if isinstance(model, SAC):
            sac_step(model, batch)
        else:
            td3_step(model, batch, actor=number % model.policy_delay == 0)


def steps_since_actor(model: SAC | TD3) -> int:
    """Gradient steps since the actor's last one, which TD3 delays."""
    return 0 if isinstance(model, SAC) else model._n_updates % model.policy_delay


def _normal(actions: Tensor) -> Tensor:
    """Drawn on the CPU, whose generator a checkpoint holds."""
    return torch.empty(actions.shape).normal_().to(actions.device)


def _sampled(actor: Actor, observations: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Actions (N, 42) of SAC's actor, and their log-likelihood (N, 1)."""
    mean, log_std, _ = actor.get_action_dist_params(observations)
    gaussian = mean + log_std.exp() * noise
    actions = torch.tanh(gaussian)
    # With the standardised action as the noise, not as the difference to the mean: no gradient reaches the
    # actor through it, as (g - mean) / std is constant.
    density = -0.5 * noise.square() - log_std - _LOG_ROOT
    # 1e-6: as in stable-baselines3, against the logarithm of 0.
    squashed = torch.log(1.0 - actions.square() + 1e-6)
    return actions, (density - squashed).sum(dim=1, keepdim=True)


def _lowest(values: Iterable[Tensor]) -> Tensor:
    """(N, 1) the lowest of the critics' values, each (N, 1)."""
    return torch.cat([*values], dim=1).min(dim=1, keepdim=True).values


def _errors(values: Iterable[Tensor], target: Tensor) -> Tensor:
    """The sum of the critics' mean squared errors."""
    return torch.stack([nn.functional.mse_loss(one, target) for one in values]).sum()


def _descend(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    """One step of an optimiser; networks of other optimisers get no gradient."""
    weights = [weight for group in optimizer.param_groups for weight in group["params"]]
    for weight, gradient in zip(weights, torch.autograd.grad(loss, weights), strict=True):
        weight.grad = gradient
    optimizer.step()


def _approach(target: nn.Module, network: nn.Module, tau: float) -> None:
    """Move the weights of a target by the share `tau` towards those of its network."""
    with torch.no_grad():
        torch._foreach_lerp_([*target.parameters()], [*network.parameters()], tau)

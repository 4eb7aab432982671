"""Build stable-baselines3's DDPG, TD3 and SAC, which learn from a replay buffer, and read from them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DDPG, SAC, TD3
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor, nn

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.baselines.cuda_graph import GraphedSteps
from kinemimic.train.baselines.gradient_steps import draw, steps, steps_since_actor
from kinemimic.train.baselines.replay_memory import RescalingReplayBuffer
from kinemimic.train.config.baseline_config import OffPolicy, Sac, Td3
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.ppo.mlp import CPU
from kinemimic.train.task.env import ACTIONS

OffPolicyModel = TD3 | SAC  # DDPG is a TD3 there

# As in our PPO: the humanoid starts at its reference, not up to 0.3 rad away.
_LAST_GAIN = 0.01


class SeparateRates:
    """Keeps the learning rates that were set for each network."""

    def _update_learning_rate(self, optimizers: object) -> None:
        """Does nothing: stable-baselines3 would set its single rate for actor and critic."""


class _OwnSteps(OffPolicyAlgorithm):
    """Our gradient steps in place of stable-baselines3's; on a GPU, a CUDA graph of them."""

    _graphed: GraphedSteps | None = None

    def train(self, gradient_steps: int, batch_size: int = 256) -> None:
        """`gradient_steps` steps, each on `batch_size` samples."""
        assert isinstance(self, OffPolicyModel)  # noqa: S101 (mixed into those)
        if self.device == CPU:
            for number in range(gradient_steps):
                steps(self, [draw(self, batch_size)], steps_since_actor(self) + number)
        else:
            self._graphed = self._graphed or GraphedSteps(self)
            try:
                self._graphed.run(gradient_steps, batch_size)
            except torch.OutOfMemoryError:
                raise KinemimicError(
                    "--device cuda: expected enough memory on the GPU, found none left; use fewer --jobs"
                ) from None
        self._n_updates += gradient_steps


class _Ddpg(SeparateRates, _OwnSteps, DDPG):
    pass


class _Td3(SeparateRates, _OwnSteps, TD3):
    pass


class _Sac(SeparateRates, _OwnSteps, SAC):
    pass


def build(
    config: TrainConfig,
    baseline: OffPolicy,
    env: VecNormalize,
    networks: dict[str, Any],
    device: torch.device,
) -> OffPolicyModel:
    """The untrained algorithm; networks: stable-baselines3's `policy_kwargs`."""
    options: dict[str, Any] = {
        "buffer_size": baseline.buffer,
        "batch_size": baseline.batch,
        "tau": baseline.tau,
        "gamma": config.discount,
        "train_freq": baseline.train_every,
        # No uniform actions in the warm-up, and no updates before its end: see `enable_updates`.
        "learning_starts": 0,
        "gradient_steps": 0,
        "replay_buffer_class": RescalingReplayBuffer,
        "replay_buffer_kwargs": {"terms": len(config.env.reward.weights)},
        "policy_kwargs": networks,
        "device": device,
    }
    if isinstance(baseline, Sac):
        model = _Sac(
            "MlpPolicy",
            env,
            ent_coef=f"auto_{baseline.entropy}",
            target_entropy=baseline.target * ACTIONS,
            **options,
        )
        _start_small(actor_layers(model)[-1])
        assert isinstance(model.actor.log_std, nn.Linear)  # noqa: S101 (narrows the type)
        _start_small(model.actor.log_std, math.log(config.action_std[0][1] / baseline.bound))
        return _fused(model)
    if isinstance(baseline, Td3):
        options |= {
            "policy_delay": baseline.policy_delay,
            "target_policy_noise": baseline.target_noise,
            "target_noise_clip": baseline.target_clip,
        }
    kind = _Td3 if isinstance(baseline, Td3) else _Ddpg
    deterministic = kind("MlpPolicy", env, **options)
    _start_small(actor_layers(deterministic)[-1])
    deterministic.actor_target.load_state_dict(deterministic.actor.state_dict())
    return _fused(deterministic)


def _fused(model: OffPolicyModel) -> OffPolicyModel:
    """The model with optimisers that update all weights in one pass; on a GPU, a graph can record it."""
    for optimizer in optimizers(model).values():
        for group in optimizer.param_groups:
            group.update(fused=True, capturable=model.device != CPU)
    return model


def _start_small(layer: nn.Linear, bias: float = 0.0) -> None:
    with torch.no_grad():
        layer.weight.mul_(_LAST_GAIN)
        layer.bias.mul_(_LAST_GAIN).add_(bias)


def actor_layers(model: OffPolicyModel) -> list[nn.Linear]:
    """The linear layers of the actor's mean action, from the input on."""
    parts = [*model.actor.latent_pi, model.actor.mu] if isinstance(model, SAC) else [*model.actor.mu]
    return [part for part in parts if isinstance(part, nn.Linear)]


def optimizers(model: OffPolicyModel) -> dict[str, torch.optim.Optimizer]:
    """The optimisers by name."""
    found = {"actor": model.actor.optimizer, "critic": model.critic.optimizer}
    if isinstance(model, SAC):
        assert model.ent_coef_optimizer is not None  # noqa: S101 (its weight is learned)
        found["entropy"] = model.ent_coef_optimizer
    return found


def set_rates(model: OffPolicyModel, baseline: OffPolicy) -> None:
    """Set a learning rate for each optimiser."""
    rates = {"actor": baseline.actor_rate, "critic": baseline.critic_rate}
    if isinstance(baseline, Sac):
        rates["entropy"] = baseline.entropy_rate
    for name, optimizer in optimizers(model).items():
        for group in optimizer.param_groups:
            group["lr"] = rates[name]


def set_exploration(model: OffPolicyModel, action_std: float, bound: float) -> float:
    """Set the noise on the actions of DDPG and TD3; returns its standard deviation, rad.

    SAC's is learned: its mean at the mean observation.
    """
    if isinstance(model, SAC):
        with torch.no_grad():
            _, logarithms, _ = model.actor.get_action_dist_params(
                torch.zeros(1, *model.observation_space.shape or (), device=model.device)
            )
        return bound * float(logarithms.exp().mean())
    # Relative to the bound, like the actor's tanh.
    model.action_noise = NormalActionNoise(np.zeros(ACTIONS), np.full(ACTIONS, action_std / bound))
    return action_std


def enable_updates(model: OffPolicyModel, baseline: OffPolicy, envs: int, samples: int) -> None:
    """Set the gradient steps per sample of `envs` environments once the warm-up is over."""
    if samples >= baseline.warm_up:
        model.gradient_steps = max(1, round(baseline.updates_per_sample * baseline.train_every * envs))


def entropy_weight(model: OffPolicyModel) -> dict[str, Tensor]:
    """SAC's learned weight of the entropy, its logarithm (1,) by name; empty for others."""
    if not isinstance(model, SAC):
        return {}
    assert model.log_ent_coef is not None  # noqa: S101 (its weight is learned)
    return {"log_entropy": model.log_ent_coef.detach()}


def critic_errors(model: OffPolicyModel, count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Errors (C count,) of C critics against their targets for samples of the replay buffer, and the targets
    (count,)."""
    assert model.replay_buffer is not None  # noqa: S101 (narrows the type)
    batch = model.replay_buffer.sample(count, env=model._vec_normalize_env)
    following = batch.next_observations
    with torch.no_grad():
        if isinstance(model, SAC):
            actions, log_likelihood = model.actor.action_log_prob(following)
            (logarithm,) = entropy_weight(model).values()
            bonus = -logarithm.exp() * log_likelihood[:, None]
        else:
            actions, bonus = model.actor_target(following), torch.zeros(1, device=model.device)
        values = torch.cat(model.critic_target(following, actions), dim=1).min(dim=1, keepdim=True).values
        target = batch.rewards + (1.0 - batch.dones) * model.gamma * (values + bonus)
        errors = torch.cat(model.critic(batch.observations, batch.actions), dim=1) - target
    return errors.T.reshape(-1).cpu().numpy(), target[:, 0].cpu().numpy()

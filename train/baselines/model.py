"""Build stable-baselines3's algorithms from a `TrainConfig`, and read policies and statistics from them."""

from __future__ import annotations

import math

import numpy as np
import torch
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch import nn

from kinemimic.train.baselines import off_policy
from kinemimic.train.baselines.off_policy import OffPolicyModel, SeparateRates
from kinemimic.train.config.baseline_config import A2c, Baseline, OffPolicy
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.config.env_config import OBSERVATION_CLIP
from kinemimic.train.ppo.mlp import CPU, choose_gradient_dtype
from kinemimic.train.rollout.policy import Policy

Model = OffPolicyModel | A2C | PPO

_ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}


def with_normalization(env: VecEnv) -> VecNormalize:
    """The environments with stable-baselines3's running statistics, clipped and bounded below as ours."""
    return VecNormalize(env, norm_reward=False, clip_obs=OBSERVATION_CLIP, epsilon=1e-6)


def observation_statistics(env: VecNormalize) -> RunningMeanStd:
    """Running mean and variance of the observations."""
    assert isinstance(env.obs_rms, RunningMeanStd)  # noqa: S101 (narrows the type)
    return env.obs_rms


def build_model(config: TrainConfig, env: VecNormalize, device: torch.device = CPU) -> Model:
    """The untrained algorithm, initialised from the global random generators.

    device: of the networks of an algorithm with a replay buffer; others stay on the CPU.
    """
    if config.baseline is None:
        raise ValueError("expected a configuration with a baseline, found none")
    device = device if isinstance(config.baseline, OffPolicy) else CPU
    choose_gradient_dtype(device)
    hidden = list(config.hidden)
    networks = {"pi": hidden, "qf" if config.bound else "vf": hidden}
    model = _build(config, config.baseline, env, networks, device)
    _set_rates(model, config.baseline)
    set_exploration(model, config, 0)
    return model


def _build(
    config: TrainConfig,
    baseline: Baseline,
    env: VecNormalize,
    nets: dict[str, list[int]],
    device: torch.device,
) -> Model:
    kwargs = {"net_arch": nets, "activation_fn": _ACTIVATIONS[baseline.activation]}
    if isinstance(baseline, OffPolicy):
        return off_policy.build(config, baseline, env, kwargs, device)
    if isinstance(baseline, A2c):
        return _A2c(
            "MlpPolicy",
            env,
            n_steps=baseline.n_steps,
            gamma=config.discount,
            gae_lambda=baseline.gae_lambda,
            max_grad_norm=baseline.max_grad_norm,
            use_rms_prop=baseline.use_rms_prop,
            normalize_advantage=baseline.normalize_advantage,
            policy_kwargs=kwargs,
            device="cpu",
        )
    return _Ppo(
        "MlpPolicy",
        env,
        n_steps=config.horizon,
        batch_size=baseline.batch,
        n_epochs=baseline.epochs,
        gamma=config.discount,
        gae_lambda=baseline.gae_lambda,
        clip_range=baseline.clip,
        max_grad_norm=baseline.max_grad_norm,
        policy_kwargs=kwargs,
        device="cpu",
    )


class _A2c(SeparateRates, A2C):
    pass


class _Ppo(SeparateRates, PPO):
    pass


def _set_rates(model: Model, baseline: Baseline) -> None:
    """Set separate learning rates for actor and critic."""
    if isinstance(model, OffPolicyModel):
        assert isinstance(baseline, OffPolicy)  # noqa: S101 (narrows the type)
        off_policy.set_rates(model, baseline)
        return
    rates = (baseline.actor_rate, baseline.critic_rate)
    policy = actor_critic_policy(model)
    critic = [*policy.mlp_extractor.value_net.parameters(), *policy.value_net.parameters()]
    in_critic = {id(weights) for weights in critic}
    actor = [weights for weights in policy.parameters() if id(weights) not in in_critic]
    groups = [{"params": part, "lr": rate} for part, rate in zip((actor, critic), rates, strict=True)]
    policy.optimizer = policy.optimizer_class(groups, **policy.optimizer_kwargs)


def set_exploration(model: Model, config: TrainConfig, samples: int) -> float:
    """Set the exploration scheduled for this number of samples; returns its mean standard deviation."""
    action_std = scheduled_at(config.action_std, samples)
    if isinstance(model, OffPolicyModel):
        return off_policy.set_exploration(model, action_std, config.bound or 1.0)
    logarithm = actor_critic_policy(model).log_std
    if samples == 0 or not config.learn_action_std:
        logarithm.data.fill_(math.log(action_std))
    logarithm.requires_grad_(config.learn_action_std)
    return float(logarithm.detach().exp().mean())


def enable_updates(model: Model, config: TrainConfig, samples: int) -> None:
    """Set the gradient steps per sample of an algorithm with a replay buffer once its warm-up is over."""
    if isinstance(model, OffPolicyModel) and isinstance(config.baseline, OffPolicy):
        off_policy.enable_updates(model, config.baseline, config.num_envs, samples)


def actor_critic_policy(model: A2C | PPO) -> ActorCriticPolicy:
    """The networks of an algorithm with a stochastic policy."""
    assert isinstance(model.policy, ActorCriticPolicy)  # noqa: S101 (narrows the type)
    return model.policy


def actor_layers(model: Model) -> list[nn.Linear]:
    """The actor's linear layers, from the input on."""
    if isinstance(model, OffPolicyModel):
        return off_policy.actor_layers(model)
    policy = actor_critic_policy(model)
    parts = [*policy.mlp_extractor.policy_net, policy.action_net]
    return [part for part in parts if isinstance(part, nn.Linear)]


def optimizers(model: Model) -> dict[str, torch.optim.Optimizer]:
    """The optimisers by name."""
    if isinstance(model, OffPolicyModel):
        return off_policy.optimizers(model)
    return {"both": model.policy.optimizer}


def export_policy(model: Model, env: VecNormalize, config: TrainConfig) -> Policy:
    """The actor with its normaliser."""
    layers = tuple(
        (part.weight.detach().cpu().numpy().copy(), part.bias.detach().cpu().numpy().copy())
        for part in actor_layers(model)
    )
    statistics = observation_statistics(env)
    mean, scale = statistics.mean, np.sqrt(statistics.var + env.epsilon)
    return Policy(layers, mean.astype(np.float32), scale.astype(np.float32), config.activation, config.bound)

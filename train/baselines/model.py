"""Build stable-baselines3's algorithms from a `TrainConfig`, and read policies and statistics from them."""

from __future__ import annotations

import math

import numpy as np
import torch
from stable_baselines3 import A2C, DDPG, PPO
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch import nn

from kinemimic.train.baselines.replay_memory import RescalingReplayBuffer
from kinemimic.train.config.baseline_config import A2c, Baseline, Ddpg
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.ppo.mlp import choose_gradient_dtype
from kinemimic.train.rollout.policy import OBSERVATION_CLIP, Policy
from kinemimic.train.task.env import ACTIONS

Model = DDPG | A2C | PPO

_ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
# As in our PPO: the humanoid starts at its reference, not up to 0.3 rad away.
_LAST_GAIN = 0.01


def with_normalization(env: VecEnv) -> VecNormalize:
    """The environments with stable-baselines3's running statistics, clipped and bounded below as ours."""
    return VecNormalize(env, norm_reward=False, clip_obs=OBSERVATION_CLIP, epsilon=1e-6)


def observation_statistics(env: VecNormalize) -> RunningMeanStd:
    """Running mean and variance of the observations."""
    assert isinstance(env.obs_rms, RunningMeanStd)  # noqa: S101 (narrows the type)
    return env.obs_rms


def build_model(config: TrainConfig, env: VecNormalize) -> Model:
    """The untrained algorithm, initialised from the global random generators."""
    if config.baseline is None:
        raise ValueError("expected a configuration with a baseline, found none")
    choose_gradient_dtype()
    hidden = list(config.hidden)
    model = _build(config, config.baseline, env, {"pi": hidden, "qf" if config.bound else "vf": hidden})
    _set_rates(model, config.baseline)
    set_exploration(model, config, 0)
    return model


def _build(config: TrainConfig, baseline: Baseline, env: VecNormalize, nets: dict[str, list[int]]) -> Model:
    kwargs = {"net_arch": nets, "activation_fn": _ACTIVATIONS[baseline.activation]}
    if isinstance(baseline, Ddpg):
        model = _Ddpg(
            "MlpPolicy",
            env,
            buffer_size=baseline.buffer,
            batch_size=baseline.batch,
            tau=baseline.tau,
            gamma=config.discount,
            train_freq=baseline.train_every,
            # No uniform actions in the warm-up, and no updates before its end: see `enable_updates`.
            learning_starts=0,
            gradient_steps=0,
            replay_buffer_class=RescalingReplayBuffer,
            replay_buffer_kwargs={"terms": len(config.env.reward.weights)},
            policy_kwargs=kwargs,
            device="cpu",
        )
        last = actor_layers(model)[-1]
        with torch.no_grad():
            last.weight.mul_(_LAST_GAIN)
            last.bias.mul_(_LAST_GAIN)
        model.actor_target.load_state_dict(model.actor.state_dict())
        return model
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


class _SeparateRates:
    """Keeps the learning rates of `_set_rates`."""

    def _update_learning_rate(self, optimizers: object) -> None:
        """Does nothing: stable-baselines3 would set its single rate for actor and critic."""


class _Ddpg(_SeparateRates, DDPG):
    pass


class _A2c(_SeparateRates, A2C):
    pass


class _Ppo(_SeparateRates, PPO):
    pass


def _set_rates(model: Model, baseline: Baseline) -> None:
    """Set separate learning rates for actor and critic."""
    rates = (baseline.actor_rate, baseline.critic_rate)
    if isinstance(model, DDPG):
        for optimizer, rate in zip(optimizers(model).values(), rates, strict=True):
            for group in optimizer.param_groups:
                group["lr"] = rate
        return
    policy = actor_critic_policy(model)
    critic = [*policy.mlp_extractor.value_net.parameters(), *policy.value_net.parameters()]
    in_critic = {id(weights) for weights in critic}
    actor = [weights for weights in policy.parameters() if id(weights) not in in_critic]
    groups = [{"params": part, "lr": rate} for part, rate in zip((actor, critic), rates, strict=True)]
    policy.optimizer = policy.optimizer_class(groups, **policy.optimizer_kwargs)


def set_exploration(model: Model, config: TrainConfig, samples: int) -> float:
    """Set the exploration scheduled for this number of samples; returns its mean standard deviation."""
    action_std = scheduled_at(config.action_std, samples)
    if isinstance(model, DDPG):
        # Relative to the bound, like the actor's tanh.
        share = np.full(ACTIONS, action_std / (config.bound or 1.0))
        model.action_noise = NormalActionNoise(np.zeros(ACTIONS), share)
        return action_std
    logarithm = actor_critic_policy(model).log_std
    if samples == 0 or not config.learn_action_std:
        logarithm.data.fill_(math.log(action_std))
    logarithm.requires_grad_(config.learn_action_std)
    return float(logarithm.detach().exp().mean())


def enable_updates(model: Model, config: TrainConfig, samples: int) -> None:
    """Set DDPG's gradient steps per sample once its warm-up is over."""
    baseline = config.baseline
    if isinstance(model, DDPG) and isinstance(baseline, Ddpg) and samples >= baseline.warm_up:
        samples_between = baseline.train_every * config.num_envs
        model.gradient_steps = max(1, round(baseline.updates_per_sample * samples_between))


def actor_critic_policy(model: A2C | PPO) -> ActorCriticPolicy:
    """The networks of an algorithm with a stochastic policy."""
    assert isinstance(model.policy, ActorCriticPolicy)  # noqa: S101 (narrows the type)
    return model.policy


def actor_layers(model: Model) -> list[nn.Linear]:
    """The actor's linear layers, from the input on."""
    if isinstance(model, DDPG):
        parts = [*model.actor.mu]
    else:
        policy = actor_critic_policy(model)
        parts = [*policy.mlp_extractor.policy_net, policy.action_net]
    return [part for part in parts if isinstance(part, nn.Linear)]


def optimizers(model: Model) -> dict[str, torch.optim.Optimizer]:
    """The optimisers by name."""
    if isinstance(model, DDPG):
        return {"actor": model.actor.optimizer, "critic": model.critic.optimizer}
    return {"both": model.policy.optimizer}


def export_policy(model: Model, env: VecNormalize, config: TrainConfig) -> Policy:
    """The actor with its normaliser."""
    layers = tuple(
        (part.weight.detach().numpy().copy(), part.bias.detach().numpy().copy())
        for part in actor_layers(model)
    )
    statistics = observation_statistics(env)
    mean, scale = statistics.mean, np.sqrt(statistics.var + env.epsilon)
    return Policy(layers, mean.astype(np.float32), scale.astype(np.float32), config.activation, config.bound)


def critic_errors(model: DDPG, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The critic's errors (count,) against its targets for samples of the replay buffer, and the targets."""
    assert model.replay_buffer is not None  # noqa: S101 (narrows the type)
    batch = model.replay_buffer.sample(count, env=model._vec_normalize_env)
    with torch.no_grad():
        next_actions = model.actor_target(batch.next_observations)
        (next_values,) = model.critic_target(batch.next_observations, next_actions)
        (values,) = model.critic(batch.observations, batch.actions)
        target = batch.rewards + (1.0 - batch.dones) * model.gamma * next_values
    return (values - target).numpy()[:, 0], target.numpy()[:, 0]

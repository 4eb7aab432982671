"""stable-baselines3's algorithms as `TrainConfig` asks for them, and what is taken out of them."""

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

from kinemimic.train.baselines.replay_memory import Memory
from kinemimic.train.config.baseline_config import A2c, Baseline, Ddpg
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.ppo.mlp import choose_products
from kinemimic.train.rollout.policy import OBSERVATION_CLIP, Policy
from kinemimic.train.task.env import ACTIONS

Model = DDPG | A2C | PPO

_ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
# As with our PPO, whose last layer has a gain of 0.01: the figure begins at its reference, not at ±0.3 rad.
_SMALL = 0.01


def normalized(env: VecEnv) -> VecNormalize:
    """The figures with stable-baselines3's running statistics, clipped as ours, deviations no less."""
    return VecNormalize(env, norm_reward=False, clip_obs=OBSERVATION_CLIP, epsilon=1e-6)


def statistics(env: VecNormalize) -> RunningMeanStd:
    """Of the observations."""
    assert isinstance(env.obs_rms, RunningMeanStd)  # noqa: S101 (for the type's sake)
    return env.obs_rms


def build(config: TrainConfig, env: VecNormalize) -> Model:
    """The untrained algorithm, from the global random states as they are."""
    if config.baseline is None:
        raise ValueError("expected a configuration with a rival, found none")
    choose_products()
    hidden = list(config.hidden)
    model = _build(config, config.baseline, env, {"pi": hidden, "qf" if config.bound else "vf": hidden})
    _set_rates(model, config.baseline)
    explore(model, config, 0)
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
            # Neither uniform actions to warm up nor learning before the end of it: see `learns`.
            learning_starts=0,
            gradient_steps=0,
            replay_buffer_class=Memory,
            replay_buffer_kwargs={"terms": len(config.env.reward.weights)},
            policy_kwargs=kwargs,
            device="cpu",
        )
        last = actor_layers(model)[-1]
        with torch.no_grad():
            last.weight.mul_(_SMALL)
            last.bias.mul_(_SMALL)
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


class _OwnRates:
    """Leaves every optimiser the rates that `_set_rates` gave it."""

    def _update_learning_rate(self, optimizers: object) -> None:
        """stable-baselines3 has one rate, which it would set here for actor and critic."""


class _Ddpg(_OwnRates, DDPG):
    pass


class _A2c(_OwnRates, A2C):
    pass


class _Ppo(_OwnRates, PPO):
    pass


def _set_rates(model: Model, baseline: Baseline) -> None:
    """Give actor and critic a rate each."""
    rates = (baseline.actor_rate, baseline.critic_rate)
    if isinstance(model, DDPG):
        for optimizer, rate in zip(optimizers(model).values(), rates, strict=True):
            for group in optimizer.param_groups:
                group["lr"] = rate
        return
    policy = gaussian(model)
    critic = [*policy.mlp_extractor.value_net.parameters(), *policy.value_net.parameters()]
    theirs = {id(weights) for weights in critic}
    actor = [weights for weights in policy.parameters() if id(weights) not in theirs]
    groups = [{"params": part, "lr": rate} for part, rate in zip((actor, critic), rates, strict=True)]
    policy.optimizer = policy.optimizer_class(groups, **policy.optimizer_kwargs)


def explore(model: Model, config: TrainConfig, samples: int) -> float:
    """Set the exploration that is scheduled after so many samples; returns its mean standard deviation."""
    action_std = scheduled_at(config.action_std, samples)
    if isinstance(model, DDPG):
        # In shares of the bound, as the actor's tanh is.
        share = np.full(ACTIONS, action_std / (config.bound or 1.0))
        model.action_noise = NormalActionNoise(np.zeros(ACTIONS), share)
        return action_std
    logarithm = gaussian(model).log_std
    if samples == 0 or not config.learn_action_std:
        logarithm.data.fill_(math.log(action_std))
    logarithm.requires_grad_(config.learn_action_std)
    return float(logarithm.detach().exp().mean())


def learns(model: Model, config: TrainConfig, samples: int) -> None:
    """Let a DDPG that has warmed up learn, with so many gradient steps for every sample as it shall."""
    baseline = config.baseline
    if isinstance(model, DDPG) and isinstance(baseline, Ddpg) and samples >= baseline.warm_up:
        taken = baseline.train_every * config.num_envs
        model.gradient_steps = max(1, round(baseline.updates_per_sample * taken))


def gaussian(model: A2C | PPO) -> ActorCriticPolicy:
    """The networks of an algorithm that draws its actions."""
    assert isinstance(model.policy, ActorCriticPolicy)  # noqa: S101 (for the type's sake)
    return model.policy


def actor_layers(model: Model) -> list[nn.Linear]:
    """The actor's linear layers from the input on."""
    if isinstance(model, DDPG):
        parts = [*model.actor.mu]
    else:
        policy = gaussian(model)
        parts = [*policy.mlp_extractor.policy_net, policy.action_net]
    return [part for part in parts if isinstance(part, nn.Linear)]


def optimizers(model: Model) -> dict[str, torch.optim.Optimizer]:
    """Each of its optimisers by a name."""
    if isinstance(model, DDPG):
        return {"actor": model.actor.optimizer, "critic": model.critic.optimizer}
    return {"both": model.policy.optimizer}


def exported(model: Model, env: VecNormalize, config: TrainConfig) -> Policy:
    """The actor with its normaliser, as our own policies are."""
    layers = tuple(
        (part.weight.detach().numpy().copy(), part.bias.detach().numpy().copy())
        for part in actor_layers(model)
    )
    seen = statistics(env)
    mean, scale = seen.mean, np.sqrt(seen.var + env.epsilon)
    return Policy(layers, mean.astype(np.float32), scale.astype(np.float32), config.activation, config.bound)


def critic_errors(model: DDPG, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(count,) of samples remembered: what the critic is off its targets, and the targets."""
    assert model.replay_buffer is not None  # noqa: S101 (for the type's sake)
    found = model.replay_buffer.sample(count, env=model._vec_normalize_env)
    with torch.no_grad():
        following = model.actor_target(found.next_observations)
        (later,) = model.critic_target(found.next_observations, following)
        (now,) = model.critic(found.observations, found.actions)
        target = found.rewards + (1.0 - found.dones) * model.gamma * later
    return (now - target).numpy()[:, 0], target.numpy()[:, 0]

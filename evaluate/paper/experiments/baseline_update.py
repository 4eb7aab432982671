"""One gradient step of actor and critic on n samples, of the baselines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from msgspec import structs
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import DummyVecEnv

from kinemimic.train.baselines.env import spaces
from kinemimic.train.baselines.model import (
    actor_critic_policy,
    build_model,
    export_policy,
    with_normalization,
)
from kinemimic.train.baselines.off_policy import OffPolicyModel
from kinemimic.train.baselines.runner import GlobalRandomState
from kinemimic.train.config.baseline_config import A2c, OffPolicy, StablePpo
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import Policy


class _Spaces(gym.Env[Any, Any]):
    """The observation and action spaces, without a simulation."""

    def __init__(self, config: TrainConfig) -> None:
        self.observation_space, self.action_space = spaces(config)


class BaselineUpdate:
    """`OneUpdate` (`ppo_update.py`) of a baseline as the training builds it, with samples drawn from a seed.

    An algorithm with a replay buffer samples its batch from one as large as at its first gradient step, and
    its step includes the target networks; A2C's and PPO's batch is one rollout, used once.
    """

    def __init__(self, config: TrainConfig, samples: int, seed: int) -> None:
        baseline = config.baseline
        if isinstance(baseline, OffPolicy):
            baseline = structs.replace(baseline, buffer=baseline.warm_up, batch=samples)
        elif isinstance(baseline, A2c):
            baseline = structs.replace(baseline, n_steps=samples)
        elif isinstance(baseline, StablePpo):
            baseline = structs.replace(baseline, batch=samples, epochs=1)
        else:
            raise ValueError("expected a configuration with a baseline, found none")
        # One environment, so that any number of samples is a whole number of steps.
        self._config = replace(config, num_envs=1, horizon=samples, baseline=baseline)
        self._env = with_normalization(DummyVecEnv([lambda: _Spaces(config)]))
        with GlobalRandomState(config.seed).installed():
            self.model = build_model(self._config, self._env)
        self.model.set_logger(Logger(None, []))
        self._fill(np.random.default_rng(seed))

    def _fill(self, random: np.random.Generator) -> None:
        """Fill the buffer as if the algorithm had sampled."""
        if isinstance(self.model, OffPolicyModel):
            memory = self.model.replay_buffer
            assert memory is not None  # noqa: S101 (for the type's sake)
            for column in (memory.observations, memory.next_observations, memory.rewards):
                random.standard_normal(out=column, dtype=np.float32)
            memory.actions[:] = random.uniform(-1.0, 1.0, memory.actions.shape)
            memory.full = True
        else:
            rollout = self.model.rollout_buffer
            for column in (rollout.observations, rollout.advantages, rollout.returns, rollout.values):
                random.standard_normal(out=column, dtype=np.float32)
            action_std = self._config.action_std[0][1]
            rollout.actions[:] = action_std * random.standard_normal(rollout.actions.shape, dtype=np.float32)
            # PPO's ratio starts at 1, as in training; otherwise it would be clipped or undefined.
            with torch.no_grad():
                seen, done = (torch.from_numpy(one[:, 0]) for one in (rollout.observations, rollout.actions))
                _, found, _ = actor_critic_policy(self.model).evaluate_actions(seen, done)
            rollout.log_probs[:, 0] = found.numpy()
            rollout.full = True

    def policy(self) -> Policy:
        return export_policy(self.model, self._env, self._config)

    def step(self) -> None:
        if isinstance(self.model, OffPolicyModel):
            self.model.train(gradient_steps=1, batch_size=self.model.batch_size)
        else:
            self.model.train()

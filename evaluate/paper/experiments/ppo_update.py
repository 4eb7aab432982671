"""One gradient step of actor and critic of our PPO on n samples; `baseline_update.py` has the baselines'.

A step consists of the operations that the training performs on one batch: gather its rows and update both
networks with their optimisers. The samples are random: the time does not depend on their values.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.ppo.objective import ActorBatch, log_prob
from kinemimic.train.ppo.ppo import PpoAlgorithm, minibatches
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import observation_size


class OneUpdate(Protocol):
    """An algorithm with a batch of samples to update from repeatedly."""

    def policy(self) -> Policy:
        """The current actor."""

    def step(self) -> None:
        """One gradient step of actor and critic on the batch."""


class PpoUpdate:
    """`OneUpdate` of `ppo.py`, with observations, actions, advantages and returns drawn from a seed.

    Actor and critic are updated one after the other; the two threads and the work done once per round
    (advantages, KL divergence) belong to `PpoAlgorithm.update`.
    """

    def __init__(self, config: TrainConfig, samples: int, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.algorithm = PpoAlgorithm(config)
        net = self.algorithm.net
        self._observations, action_std, self._returns, gain = (
            torch.from_numpy(random.standard_normal((samples, width), dtype=np.float32))
            for width in (observation_size(config.env), ACTIONS, 1, 1)
        )
        mean = net.actor.forward(self._observations)
        actions = mean + net.log_std.exp() * action_std
        self._old = ActorBatch(actions, mean, log_prob(actions, mean, net.log_std), gain[:, 0])
        self._log_old = net.log_std.clone()
        self._orders = [torch.from_numpy(random.permutation(samples))]

    def policy(self) -> Policy:
        return self.algorithm.policy()

    def step(self) -> None:
        size = len(self._observations)
        ((seen, *chosen),) = minibatches(self._orders, size, self._observations, *self._old)
        self.algorithm.actor_step(seen, ActorBatch(*chosen), self._log_old)
        ((seen, wanted),) = minibatches(self._orders, size, self._observations, self._returns)
        self.algorithm.critic_step(seen, wanted)

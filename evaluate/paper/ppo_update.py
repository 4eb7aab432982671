"""One gradient step of actor and critic on n samples, of our PPO; of the rivals in `rival_update.py`.

A step is what the training's own code does with one batch: it gathers the batch's rows, and moves both
networks by their optimisers. The samples are made up: how long it takes does not depend on what they say.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.ppo.objective import Choices, log_density
from kinemimic.train.ppo.ppo import PpoAlgorithm, minibatches
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS, observation_size


class OneUpdate(Protocol):
    """An algorithm with a batch of samples to learn from, again and again."""

    def policy(self) -> Policy:
        """The actor as it is now."""

    def step(self) -> None:
        """One gradient step of actor and critic on the batch."""


class PpoUpdate:
    """`OneUpdate` of `ppo.py`, with observations, actions, advantages and returns drawn from a seed.

    Its threads for actor and critic, and what it does once a round (advantages, the KL divergence), belong to
    `Learner.update`; here one follows the other.
    """

    def __init__(self, config: TrainConfig, samples: int, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.learner = PpoAlgorithm(config)
        net = self.learner.net
        self._observations, action_std, self._returns, gain = (
            torch.from_numpy(random.standard_normal((samples, width), dtype=np.float32))
            for width in (observation_size(config.env), ACTIONS, 1, 1)
        )
        mean = net.actor.forward(self._observations)
        actions = mean + net.log_std.exp() * action_std
        self._old = Choices(actions, mean, log_density(actions, mean, net.log_std), gain[:, 0])
        self._log_old = net.log_std.clone()
        self._orders = [torch.from_numpy(random.permutation(samples))]

    def policy(self) -> Policy:
        return self.learner.policy()

    def step(self) -> None:
        size = len(self._observations)
        ((seen, *chosen),) = minibatches(self._orders, size, self._observations, *self._old)
        self.learner.step_policy(seen, Choices(*chosen), self._log_old)
        ((seen, wanted),) = minibatches(self._orders, size, self._observations, self._returns)
        self.learner.step_value(seen, wanted)

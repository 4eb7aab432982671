"""The update of `train/ppo/ppo.py` as it is usually written: torch's layers, autograd, Adam, one loop."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor, nn

from kinemimic.train.ppo.advantages import advantages
from kinemimic.train.ppo.mlp import Mlp
from kinemimic.train.ppo.objective import kl_divergence, log_prob
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.sampling.sampler import Samples


def sequential(mlp: Mlp) -> nn.Sequential:
    """The same network in torch's own parts, with weights of its own."""
    parts: list[nn.Module] = []
    for weight, bias in mlp.layers:
        linear = nn.Linear(weight.shape[1], weight.shape[0], dtype=weight.dtype)
        with torch.no_grad():
            linear.weight.copy_(weight)
            linear.bias.copy_(bias)
        parts += [linear, nn.Tanh()]
    return nn.Sequential(*parts[:-1])


class PlainPPO:
    """Starts from the weights of `algorithm`; `update` does what `PpoAlgorithm.update` does."""

    def __init__(self, algorithm: PpoAlgorithm) -> None:
        c = self.config = algorithm.config
        self.actor, self.critic = sequential(algorithm.net.actor), sequential(algorithm.net.critic)
        self.log_std = algorithm.net.log_std.clone().requires_grad_(c.learn_action_std)
        self.normalizer = copy.deepcopy(algorithm.normalizer)
        self.random = copy.deepcopy(algorithm.random)
        self.progress = replace(algorithm.progress)
        moved = [*self.actor.parameters(), *([self.log_std] if c.learn_action_std else [])]
        self.actor_optimizer = torch.optim.Adam(moved, c.actor_rate)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), c.critic_rate)

    def update(self, samples: Samples) -> None:
        """One round; rates and penalty are left as they are."""
        c, rows = self.config, samples.terminated.size
        observations = self.normalizer.apply(samples.observations.reshape(rows, -1))
        actions = torch.from_numpy(samples.actions.reshape(rows, -1))
        with torch.no_grad():
            mean_old, log_old = self.actor(observations), self.log_std.detach().clone()
            values = self.critic(observations).numpy().reshape(samples.terminated.shape)
            after = self.critic(self.normalizer.apply(samples.next_observations.reshape(rows, -1))).numpy()
        next_values = np.where(samples.terminated, 0.0, after.reshape(values.shape)).astype(np.float32)
        ended = samples.terminated | samples.truncated
        estimates = advantages(samples.terms.sum(-1), values, next_values, ended, c.discount, c.gae_lambda)
        returns, advantage = (torch.from_numpy(x.reshape(-1)) for x in (estimates + values, estimates))
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        log_prob_old = log_prob(actions, mean_old, log_old)
        for _ in range(c.epochs):
            for part in torch.split(torch.from_numpy(self.random.permutation(rows)), c.minibatch):
                mean = self.actor(observations[part])
                ratio = (log_prob(actions[part], mean, self.log_std) - log_prob_old[part]).exp()
                surrogate = ratio * advantage[part]
                if c.clip is not None:
                    surrogate = torch.minimum(
                        surrogate, ratio.clamp(1 - c.clip, 1 + c.clip) * advantage[part]
                    )
                loss = -surrogate.mean()
                if c.kl_penalty:
                    kl = kl_divergence(mean_old[part], log_old, mean, self.log_std)
                    loss = loss + self.progress.penalty * kl.mean()
                if c.learn_action_std:
                    loss = loss - self.progress.entropy * self.log_std.sum()
                self._gradient_step(loss, self.actor, self.actor_optimizer)
                error = self.critic(observations[part])[:, 0] - returns[part]
                self._gradient_step(0.5 * error.square().mean(), self.critic, self.critic_optimizer)

    @staticmethod
    def _gradient_step(loss: Tensor, net: nn.Module, optimizer: torch.optim.Optimizer) -> None:
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()

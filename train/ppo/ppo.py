"""Proximal policy optimisation with a clipped ratio, a KL penalty, or both (Schulman et al. 2017; Eq. 6)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.ppo.advantages import advantages
from kinemimic.train.ppo.mlp import Mlp
from kinemimic.train.ppo.networks import ActorCritic, Normalizer, export
from kinemimic.train.ppo.objective import Choices, divergence, log_density, policy_slopes
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.sampler import Samples
from kinemimic.train.runner.base import Progress, normalized_loss
from kinemimic.train.task.env import ACTIONS, observation_size

Array = NDArray[np.float32]

RATE_BOUNDS = (1e-6, 1e-3)
PENALTY_BOUNDS = (1e-4, 1e4)


def adapt_penalty(penalty: float, kl: float, target: float, initial: float, rule: str) -> float:
    """Penalty coefficient after a round: halved below target/1.5, doubled above 1.5 target.

    rule: "running" halves and doubles the coefficient in force; "initial" sets half or twice the initial one,
    which is how the paper's text reads.
    """
    base = penalty if rule == "running" else initial
    if kl < target / 1.5:
        penalty = 0.5 * base
    elif kl > 1.5 * target:
        penalty = 2.0 * base
    return min(max(penalty, PENALTY_BOUNDS[0]), PENALTY_BOUNDS[1])


def adapt_rate(rate: float, kl: float, target: float) -> float:
    """Learning rate after a round: steered so that a round moves the policy by about the KL target."""
    if kl > 1.5 * target:
        rate /= 1.5
    elif kl < target / 1.5:
        rate *= 1.5
    return min(max(rate, RATE_BOUNDS[0]), RATE_BOUNDS[1])


@dataclass
class PpoProgress(Progress):
    """With what the rules of the penalty, of the rate and of the entropy's weight came to."""

    penalty: float = 1.0
    actor_rate: float = 3e-4
    entropy: float = 0.0


class PpoAlgorithm:
    """Networks, optimisers and normaliser; `update` learns from one round of samples.

    Actor and critic share nothing, so each learns in a thread of its own with half of torch's threads. On two
    cores no operation then waits for another thread: what comes out does not depend on who is faster, and a
    busy machine only costs its share, where threads inside of an operation spin until the last one is there.
    """

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        torch.manual_seed(config.seed)
        size = observation_size(config.env)
        self.net = ActorCritic(size, ACTIONS, config.hidden, scheduled_at(config.action_std, 0))
        self.normalizer = Normalizer(size)
        actor = [self.net.actor.parameters] + ([self.net.log_std] if config.learn_action_std else [])
        self.actor_optimizer = torch.optim.Adam(actor, config.actor_rate, fused=True)
        self.critic_optimizer = torch.optim.Adam([self.net.critic.parameters], config.critic_rate, fused=True)
        self.random = np.random.default_rng(config.seed)
        self.progress = PpoProgress(
            penalty=config.penalty_initial, actor_rate=config.actor_rate, entropy=config.entropy
        )

    def action_std(self) -> Array:
        """Standard deviation (A,) of the exploration: scheduled over samples, or what was learnt."""
        c = self.config
        if not c.learn_action_std:
            self.net.log_std.fill_(math.log(scheduled_at(c.action_std, self.progress.samples)))
        action_std: Array = self.net.log_std.exp().numpy()
        return action_std

    def update(self, samples: Samples) -> dict[str, float]:
        """Several passes of minibatches over (T, E) samples; returns what is worth logging."""
        c, state = self.config, self.progress
        steps, figures = samples.terminated.shape
        count = steps * figures
        rewards = samples.terms.sum(axis=-1)
        seen = samples.observations.reshape(count, -1)
        observations = self.normalizer.apply(seen)
        orders = [torch.from_numpy(self.random.permutation(count)) for _ in range(c.epochs)]
        share = max(1, torch.get_num_threads() // 2)
        with ThreadPoolExecutor(2, initializer=torch.set_num_threads, initargs=(share,)) as threads:
            acting = threads.submit(self.net.actor.forward, observations)
            values, following = threads.submit(self._values, samples, observations).result()
            ended = samples.terminated | samples.truncated
            gains = advantages(rewards, values, following, ended, c.discount, c.gae_lambda)
            returns = torch.from_numpy((gains + values).reshape(-1))
            gain = torch.from_numpy(gains.reshape(-1))
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            actions, mean = torch.from_numpy(samples.actions.reshape(count, -1)), acting.result()
            old = Choices(actions, mean, log_density(actions, mean, self.net.log_std), gain)
            actor = threads.submit(self._learn_policy, observations, old, orders)
            critic = threads.submit(self._learn_value, observations, returns, orders)
            (kl, clipped), value_loss = actor.result(), critic.result()
        if not (math.isfinite(kl) and math.isfinite(value_loss)):
            raise FloatingPointError("the policy or its value became infinite or NaN")
        if c.kl_penalty:
            state.penalty = adapt_penalty(state.penalty, kl, c.kl_target, c.penalty_initial, c.penalty_rule)
        if c.adapt_rate:
            state.actor_rate = adapt_rate(state.actor_rate, kl, c.kl_target)
            for group in self.actor_optimizer.param_groups:
                group["lr"] = state.actor_rate
        state.entropy *= c.entropy_decay
        state.samples += count
        state.rounds += 1
        # The statistics move only after the update: old and new policy saw the same observations.
        self.normalizer.update(seen)
        spread = float(returns.var(correction=0))
        errors = returns - torch.from_numpy(values.reshape(-1))
        return {
            "reward/mean": float(rewards.mean()),
            "episode/length": float(samples.lengths.mean()) if len(samples.lengths) else float(steps),
            "policy/kl": kl,
            "policy/clip_fraction": clipped,
            "policy/penalty": state.penalty,
            "policy/rate": state.actor_rate,
            "policy/noise": float(self.net.log_std.exp().mean()),
            # Of a Gaussian: the sum of log σ + ½ log 2πe.
            "policy/entropy": float((self.net.log_std + 0.5 * math.log(2.0 * math.pi * math.e)).sum()),
            "value/loss": value_loss,
            "value/explained_variance": 1.0 - float(errors.var(correction=0)) / spread if spread > 0 else 0.0,
            "value/normalized_loss": normalized_loss(float(errors.square().mean()), spread),
        }

    def _values(self, samples: Samples, observations: Tensor) -> tuple[Array, Array]:
        """Value (T, E) of the states before and after each step: 0 after a fall."""
        shape = samples.terminated.shape
        values: Array = self.net.critic.forward(observations).numpy().reshape(shape)
        # What follows a step is what the next one begins with, but for the ends of episodes and of the round.
        following = np.empty_like(values)
        following[:-1] = values[1:]
        asked = samples.truncated.copy()
        asked[-1] = True
        last = self.normalizer.apply(samples.final[asked])
        following[asked] = self.net.critic.forward(last).numpy()[:, 0]
        following[samples.terminated] = 0.0
        return values, following

    def _learn_policy(self, observations: Tensor, old: Choices, orders: list[Tensor]) -> tuple[float, float]:
        """KL of the old policy from the new one, and the share of ratios that were clipped."""
        actor, log_std = self.net.actor, self.net.log_std
        log_old = log_std.clone()
        clipped = [
            self.step_policy(seen, Choices(*chosen), log_old)
            for seen, *chosen in minibatches(orders, self.config.minibatch, observations, *old)
        ]
        kl = divergence(old.mean, log_old, actor.forward(observations), log_std).mean()
        return float(kl), float(torch.stack(clipped).mean())

    def step_policy(self, seen: Tensor, old: Choices, log_old: Tensor) -> Tensor:
        """One gradient step of the actor; returns the share of ratios that were clipped.

        seen: (N, O) normalised observations; old: what was chosen at them; log_old: (A,) the logarithm of the
        noise that it was chosen with.
        """
        c, actor, log_std = self.config, self.net.actor, self.net.log_std
        penalty = self.progress.penalty if c.kl_penalty else 0.0
        entropy = self.progress.entropy if c.learn_action_std else 0.0
        slopes = policy_slopes(old, log_old, actor.forward(seen), log_std, c.clip, penalty, entropy)
        log_std.grad = slopes.log_std
        _descend(actor, slopes.mean, self.actor_optimizer)
        return slopes.clipped

    def _learn_value(self, observations: Tensor, returns: Tensor, orders: list[Tensor]) -> float:
        """Mean of the minibatches' losses."""
        rows = minibatches(orders, self.config.minibatch, observations, returns[:, None])
        return float(torch.stack([self.step_value(*row) for row in rows]).mean())

    def step_value(self, seen: Tensor, wanted: Tensor) -> Tensor:
        """One gradient step of the critic; returns its loss before it: half the mean squared error.

        seen: (N, O) normalised observations; wanted: (N, 1) their returns.
        """
        error = self.net.critic.forward(seen) - wanted
        _descend(self.net.critic, error / len(error), self.critic_optimizer)
        return 0.5 * error.square().mean()

    def policy(self) -> Policy:
        """The actor with its normaliser."""
        return export(self.net, self.normalizer)

    def notes(self) -> dict[str, Any]:
        """Nothing that other learners have not."""
        return {}

    def record(self) -> dict[str, Any]:
        """Everything of the learner that is no array, for a checkpoint."""
        return {
            "progress": asdict(self.progress),
            "random": self.random.bit_generator.state,
            "normalizer_count": self.normalizer.count,
        }

    def tensors(self) -> dict[str, Tensor]:
        """Everything of the learner that is an array, for a checkpoint."""
        found = {
            "actor": self.net.actor.parameters,
            "critic": self.net.critic.parameters,
            "log_noise": self.net.log_std,
            "normalizer.mean": torch.from_numpy(self.normalizer.mean),
            "normalizer.squares": torch.from_numpy(self.normalizer.squares),
        }
        for kind, optimizer in (("actor", self.actor_optimizer), ("critic", self.critic_optimizer)):
            for index, slots in optimizer.state_dict()["state"].items():
                found |= {f"optimizer.{kind}.{index}.{slot}": value for slot, value in slots.items()}
        return {name: value.detach().clone() for name, value in found.items()}

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        """Take up what `tensors` and `record` gave."""
        self.net.actor.parameters.copy_(tensors["actor"])
        self.net.critic.parameters.copy_(tensors["critic"])
        self.net.log_std.copy_(tensors["log_noise"])
        self.progress = PpoProgress(**record["progress"])
        self.random.bit_generator.state = record["random"]
        self.normalizer.count = record["normalizer_count"]
        self.normalizer.mean = tensors["normalizer.mean"].numpy().copy()
        self.normalizer.squares = tensors["normalizer.squares"].numpy().copy()
        for kind, optimizer in (("actor", self.actor_optimizer), ("critic", self.critic_optimizer)):
            saved = optimizer.state_dict()
            prefix = f"optimizer.{kind}."
            slots: dict[int, dict[str, Tensor]] = {}
            weights = optimizer.param_groups[0]["params"]
            for name, value in tensors.items():
                if name.startswith(prefix):
                    index, slot = name.removeprefix(prefix).split(".")
                    # torch looks at neither, and fails in the next round.
                    if value.ndim and value.shape != weights[int(index)].shape:
                        raise ValueError(f"{name} of shape {tuple(value.shape)}")
                    slots.setdefault(int(index), {})[slot] = value
            saved["state"] = slots
            optimizer.load_state_dict(saved)
        for group in self.actor_optimizer.param_groups:
            group["lr"] = self.progress.actor_rate


def minibatches(orders: list[Tensor], size: int, *columns: Tensor) -> Iterator[tuple[Tensor, ...]]:
    """Rows of the columns in each order after the other, `size` at a time."""
    for order in orders:
        yield from zip(*(torch.split(column.index_select(0, order), size) for column in columns), strict=True)


def _descend(network: Mlp, slope: Tensor, optimizer: torch.optim.Optimizer) -> None:
    """One step of the optimiser down the loss whose slope by the network's output (N, out) is given."""
    network.backward(slope)
    norm = torch.linalg.vector_norm(network.gradient)
    network.gradient.mul_((1.0 / (norm + 1e-6)).clamp(max=1.0))
    optimizer.step()

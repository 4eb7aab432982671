"""Proximal policy optimisation with a clipped ratio, a KL penalty, or both (Schulman et al. 2017; Eq. 6)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kinemimic.train.config import TrainConfig
from kinemimic.train.env import ACTIONS, OBSERVATIONS
from kinemimic.train.networks import ActorCritic, Normalizer, divergence, log_density
from kinemimic.train.rollout import Samples

Array = NDArray[np.float32]

RATE_BOUNDS = (1e-6, 1e-3)
PENALTY_BOUNDS = (1e-4, 1e4)


def advantages(
    rewards: Array, values: Array, following: Array, ended: NDArray[np.bool_], discount: float, lam: float
) -> Array:
    """Generalised advantage estimates (T, E) (Schulman et al. 2016).

    rewards, values: (T, E); following: (T, E) value of the state after each step: 0 after a fall, the
    critic's own value where time ran out; ended: (T, E) the episode ended there, for whichever reason.
    """
    result = np.zeros_like(rewards)
    tail = np.zeros(rewards.shape[1], dtype=rewards.dtype)
    for t in range(len(rewards) - 1, -1, -1):
        delta = rewards[t] + discount * following[t] - values[t]
        tail = delta + discount * lam * np.where(ended[t], 0.0, tail)
        result[t] = tail
    return result


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
class Progress:
    """What changes from round to round beside the networks."""

    samples: int = 0
    rounds: int = 0
    seconds: float = 0.0
    penalty: float = 1.0
    actor_rate: float = 3e-4
    entropy: float = 0.0


class Learner:
    """Networks, optimisers and normaliser; `update` learns from one round of samples."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        torch.manual_seed(config.seed)
        self.net = ActorCritic(OBSERVATIONS, ACTIONS, config.hidden, config.noise_start, config.learn_noise)
        self.normalizer = Normalizer(OBSERVATIONS)
        actor = [*self.net.actor.parameters()] + ([self.net.log_noise] if config.learn_noise else [])
        self.actor_optimizer = torch.optim.Adam(actor, config.actor_rate, fused=True)
        self.critic_optimizer = torch.optim.Adam(self.net.critic.parameters(), config.critic_rate, fused=True)
        self.random = np.random.default_rng(config.seed)
        self.progress = Progress(
            penalty=config.penalty_initial, actor_rate=config.actor_rate, entropy=config.entropy
        )

    def noise(self) -> Array:
        """Standard deviation (A,) of the exploration: scheduled over samples, or what was learnt."""
        c = self.config
        if not c.learn_noise:
            share = min(self.progress.samples / c.noise_samples, 1.0)
            level = c.noise_start + (c.noise_end - c.noise_start) * share
            with torch.no_grad():
                self.net.log_noise.fill_(math.log(level))
        noise: Array = self.net.log_noise.detach().exp().numpy().copy()
        return noise

    def update(self, samples: Samples) -> dict[str, float]:
        """Several passes of minibatches over (T, E) samples; returns what is worth logging."""
        c, state = self.config, self.progress
        steps, figures = samples.terminated.shape
        rewards = samples.terms.sum(axis=-1)
        observations = self.normalizer.apply(samples.observations.reshape(steps * figures, -1))
        with torch.no_grad():
            values = self.net.value(observations).numpy().reshape(steps, figures)
            after = self.net.value(self.normalizer.apply(samples.final.reshape(steps * figures, -1)))
            mean_old = self.net.actor(observations)
            log_old = self.net.log_noise.detach().clone()
        following = np.where(samples.terminated, 0.0, after.numpy().reshape(steps, figures)).astype(
            np.float32
        )
        ended = samples.terminated | samples.truncated
        gains = advantages(rewards, values, following, ended, c.discount, c.gae_lambda)
        returns = torch.from_numpy((gains + values).reshape(-1))
        gain = torch.from_numpy(gains.reshape(-1))
        gain = (gain - gain.mean()) / (gain.std() + 1e-8)
        actions = torch.from_numpy(samples.actions.reshape(steps * figures, -1))
        density_old = log_density(actions, mean_old, log_old)

        clipped: list[float] = []
        value_losses: list[float] = []
        for _ in range(c.passes):
            order = torch.from_numpy(self.random.permutation(steps * figures))
            for rows in torch.split(order, c.minibatch):
                fraction = self._actor_step(
                    observations[rows], actions[rows], gain[rows], density_old[rows], mean_old[rows], log_old
                )
                clipped.append(fraction)
                value_losses.append(self._critic_step(observations[rows], returns[rows]))
        with torch.no_grad():
            kl = float(divergence(mean_old, log_old, self.net.actor(observations), self.net.log_noise).mean())
        if not math.isfinite(kl):
            raise FloatingPointError("the policy became infinite or NaN")
        if c.kl_penalty:
            state.penalty = adapt_penalty(state.penalty, kl, c.kl_target, c.penalty_initial, c.penalty_rule)
        if c.adapt_rate:
            state.actor_rate = adapt_rate(state.actor_rate, kl, c.kl_target)
            for group in self.actor_optimizer.param_groups:
                group["lr"] = state.actor_rate
        state.entropy *= c.entropy_decay
        state.samples += steps * figures
        state.rounds += 1
        # The statistics move only after the update: old and new policy saw the same observations.
        self.normalizer.update(samples.observations.reshape(steps * figures, -1))
        spread = float(returns.var())
        return {
            "reward/mean": float(rewards.mean()),
            "episode/length": float(samples.lengths.mean()) if len(samples.lengths) else float(steps),
            "policy/kl": kl,
            "policy/clip_fraction": float(np.mean(clipped)),
            "policy/penalty": state.penalty,
            "policy/rate": state.actor_rate,
            "policy/noise": float(self.net.log_noise.detach().exp().mean()),
            "value/loss": float(np.mean(value_losses)),
            "value/explained_variance": 1.0
            - float((returns - torch.from_numpy(values.reshape(-1))).var()) / spread
            if spread > 0
            else 0.0,
        }

    def _actor_step(
        self,
        observations: Tensor,
        actions: Tensor,
        gain: Tensor,
        density_old: Tensor,
        mean_old: Tensor,
        log_old: Tensor,
    ) -> float:
        c = self.config
        mean, log_noise = self.net.actor(observations), self.net.log_noise
        ratio = (log_density(actions, mean, log_noise) - density_old).exp()
        surrogate = ratio * gain
        if c.clip is not None:
            surrogate = torch.minimum(surrogate, ratio.clamp(1 - c.clip, 1 + c.clip) * gain)
        loss = -surrogate.mean()
        if c.kl_penalty:
            loss = loss + self.progress.penalty * divergence(mean_old, log_old, mean, log_noise).mean()
        if c.learn_noise and self.progress.entropy > 0:
            loss = loss - self.progress.entropy * log_noise.sum()
        self.actor_optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.net.actor.parameters(), 1.0)
        self.actor_optimizer.step()
        return float(((ratio.detach() - 1).abs() > c.clip).float().mean()) if c.clip is not None else 0.0

    def _critic_step(self, observations: Tensor, returns: Tensor) -> float:
        loss = 0.5 * (self.net.value(observations) - returns).square().mean()
        self.critic_optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.net.critic.parameters(), 1.0)
        self.critic_optimizer.step()
        return float(loss.detach())

    def tensors(self) -> dict[str, Tensor]:
        """Everything of the learner that is an array, for a checkpoint."""
        found = {f"net.{name}": value for name, value in self.net.state_dict().items()}
        for kind, optimizer in (("actor", self.actor_optimizer), ("critic", self.critic_optimizer)):
            for index, slots in optimizer.state_dict()["state"].items():
                found |= {
                    f"optimizer.{kind}.{index}.{slot}": torch.as_tensor(value)
                    for slot, value in slots.items()
                }
        found["normalizer.mean"] = torch.from_numpy(self.normalizer.mean.copy())
        found["normalizer.squares"] = torch.from_numpy(self.normalizer.squares.copy())
        return {name: value.detach().clone().contiguous() for name, value in found.items()}

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        """Take up what `tensors` and a checkpoint's record hold."""
        self.net.load_state_dict(
            {n.removeprefix("net."): v for n, v in tensors.items() if n.startswith("net.")}
        )
        self.progress = Progress(**record["progress"])
        self.random.bit_generator.state = record["random"]
        self.normalizer.count = record["normalizer_count"]
        self.normalizer.mean = tensors["normalizer.mean"].numpy().copy()
        self.normalizer.squares = tensors["normalizer.squares"].numpy().copy()
        for kind, optimizer in (("actor", self.actor_optimizer), ("critic", self.critic_optimizer)):
            saved = optimizer.state_dict()
            prefix = f"optimizer.{kind}."
            slots: dict[int, dict[str, Tensor]] = {}
            for name, value in tensors.items():
                if name.startswith(prefix):
                    index, slot = name.removeprefix(prefix).split(".")
                    slots.setdefault(int(index), {})[slot] = value
            saved["state"] = slots
            optimizer.load_state_dict(saved)
        for group in self.actor_optimizer.param_groups:
            group["lr"] = self.progress.actor_rate

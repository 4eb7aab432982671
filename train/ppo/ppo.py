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

from kinemimic.train.config.config import PenaltyRule, TrainConfig, scheduled_at
from kinemimic.train.ppo.advantages import advantages
from kinemimic.train.ppo.mlp import CPU, Mlp
from kinemimic.train.ppo.networks import ActorCritic, Normalizer, export
from kinemimic.train.ppo.objective import ActorBatch, kl_divergence, log_prob, policy_gradients
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner.base import TrainingProgress, normalized_loss
from kinemimic.train.runner.tensors import below, restore_optimizer
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.task.env import ACTIONS, ANKLES
from kinemimic.train.task.observation import observation_size
from kinemimic.train.task.observation_layout import observation_limits

Array = NDArray[np.float32]

RATE_BOUNDS = (1e-6, 1e-3)
PENALTY_BOUNDS = (1e-4, 1e4)
MAX_GRADIENT_NORM = 1.0


def adapt_penalty(penalty: float, kl: float, target: float, initial: float, rule: PenaltyRule) -> float:
    """Penalty coefficient after a round: halved for a KL below target/1.5, doubled above 1.5 target.

    rule: "running" halves and doubles the current coefficient; "initial" sets half or twice the initial one,
    as the paper's text reads.
    """
    base = penalty if rule == "running" else initial
    if kl < target / 1.5:
        penalty = 0.5 * base
    elif kl > 1.5 * target:
        penalty = 2.0 * base
    return min(max(penalty, PENALTY_BOUNDS[0]), PENALTY_BOUNDS[1])


def adapt_rate(rate: float, kl: float, target: float) -> float:
    """Learning rate after a round, adapted so that a round moves the policy by about the KL target."""
    if kl > 1.5 * target:
        rate /= 1.5
    elif kl < target / 1.5:
        rate *= 1.5
    return min(max(rate, RATE_BOUNDS[0]), RATE_BOUNDS[1])


@dataclass
class PpoProgress(TrainingProgress):
    """With the current penalty coefficient, learning rate and entropy coefficient."""

    penalty: float = 1.0
    actor_rate: float = 3e-4
    entropy: float = 0.0


class PpoAlgorithm:
    """Networks, optimisers and normaliser; `update` trains on one round of samples.

    Actor and critic share nothing, so each is updated in its own thread with half of torch's threads. On two
    cores no operation then waits for another thread: the result does not depend on their speed, and a busy
    machine costs only its share, whereas threads within an operation spin until the last one arrives.

    device: where the networks are updated. Samples, normaliser and checkpoints stay in main memory, so that
    another device can continue a training; its results differ by rounding.
    """

    def __init__(self, config: TrainConfig, device: torch.device = CPU) -> None:
        self.config, self.device = config, device
        torch.manual_seed(config.seed)
        size = observation_size(config.env)
        self.net = ActorCritic(size, ACTIONS, config.hidden, scheduled_at(config.action_std, 0), device)
        self.normalizer = Normalizer(size, observation_limits(config.env))
        actor = [self.net.actor.parameters] + ([self.net.log_std] if config.learn_action_std else [])
        self.actor_optimizer = torch.optim.Adam(actor, config.actor_rate, fused=True)
        self.critic_optimizer = torch.optim.Adam([self.net.critic.parameters], config.critic_rate, fused=True)
        self.random = np.random.default_rng(config.seed)
        self.progress = PpoProgress(
            penalty=config.penalty_initial, actor_rate=config.actor_rate, entropy=config.entropy
        )

    def begin_from(self, policy: Policy) -> None:
        """Start with the networks and the normaliser of a policy of the same shape; without its critic, the
        critic starts from random weights."""
        for network, layers in ((self.net.actor, policy.layers), (self.net.critic, policy.critic)):
            for (weight, bias), (own_weight, own_bias) in zip(layers, network.layers, strict=bool(layers)):
                own_weight.copy_(torch.from_numpy(weight))
                own_bias.copy_(torch.from_numpy(bias))
        self.normalizer.begin_from(policy)

    def action_std(self) -> Array:
        """Standard deviation (A,) of the exploration: scheduled over samples, or trained."""
        c = self.config
        if not c.learn_action_std:
            self.net.log_std.fill_(math.log(scheduled_at(c.action_std, self.progress.samples)))
            self.net.log_std[ANKLES] += math.log(c.ankle_exploration)
        action_std: Array = self.net.log_std.exp().cpu().numpy()
        return action_std

    def update(self, samples: Samples) -> dict[str, float]:
        """Several epochs of minibatches over (T, E) samples; returns scalars to log."""
        c, state = self.config, self.progress
        steps, num_envs = samples.terminated.shape
        count = steps * num_envs
        rewards = samples.terms.sum(axis=-1)
        raw = samples.observations.reshape(count, -1)
        observations = self.normalizer.apply(raw).to(self.device)
        permutations = [
            torch.from_numpy(self.random.permutation(count)).to(self.device) for _ in range(c.epochs)
        ]
        share = max(1, torch.get_num_threads() // 2)
        with ThreadPoolExecutor(2, initializer=_begin_thread, initargs=(share, self.device)) as threads:
            forward = threads.submit(self.net.actor.forward, observations)
            values, next_values = threads.submit(self._values, samples, observations).result()
            ended = samples.terminated | samples.truncated
            estimates = advantages(rewards, values, next_values, ended, c.discount, c.gae_lambda)
            returns = torch.from_numpy((estimates + values).reshape(-1)).to(self.device)
            advantage = torch.from_numpy(estimates.reshape(-1)).to(self.device)
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            actions = torch.from_numpy(samples.actions.reshape(count, -1)).to(self.device)
            mean = forward.result()
            old = ActorBatch(actions, mean, log_prob(actions, mean, self.net.log_std), advantage)
            actor = threads.submit(self._update_actor, observations, old, permutations)
            critic = threads.submit(self._update_critic, observations, returns, permutations)
            (kl, clip_fraction), value_loss = actor.result(), critic.result()
        if not (math.isfinite(kl) and math.isfinite(value_loss)):
            raise FloatingPointError("the policy or its value became infinite or NaN")
        self._adapt(kl)
        state.entropy *= c.entropy_decay
        state.samples += count
        state.rounds += 1
        # Only after the update, so that the old and the new policy see the same observations.
        self.normalizer.update(raw)
        lengths = samples.episode_lengths
        return {
            "reward/mean": float(rewards.mean()),
            # No episode may end in a round.
            **({"episode/length": float(lengths.mean())} if len(lengths) else {}),
            "policy/kl": kl,
            "policy/clip_fraction": clip_fraction,
            "policy/penalty": state.penalty,
            "policy/rate": state.actor_rate,
            "policy/noise": float(self.net.log_std.exp().mean()),
            # Entropy of a Gaussian: the sum of log σ + ½ log 2πe.
            "policy/entropy": float((self.net.log_std + 0.5 * math.log(2.0 * math.pi * math.e)).sum()),
            "value/loss": value_loss,
            **_value_errors(returns, torch.from_numpy(values.reshape(-1)).to(self.device)),
        }

    def _adapt(self, kl: float) -> None:
        """Adapt the penalty and the learning rate to the KL divergence of a round, if they are adaptive."""
        c, state = self.config, self.progress
        if c.kl_penalty:
            state.penalty = adapt_penalty(state.penalty, kl, c.kl_target, c.penalty_initial, c.penalty_rule)
        if c.adapt_rate:
            state.actor_rate = adapt_rate(state.actor_rate, kl, c.kl_target)
            for group in self.actor_optimizer.param_groups:
                group["lr"] = state.actor_rate

    def _values(self, samples: Samples, observations: Tensor) -> tuple[Array, Array]:
        """Values (T, E) of the states before and after each step; 0 after a fall."""
        shape = samples.terminated.shape
        values: Array = self.net.critic.forward(observations).cpu().numpy().reshape(shape)
        # The state after a step is the one before the next step, except at the end of an episode or a round.
        next_values = np.empty_like(values)
        next_values[:-1] = values[1:]
        evaluated = samples.truncated.copy()
        evaluated[-1] = True
        last = self.normalizer.apply(samples.next_observations[evaluated]).to(self.device)
        next_values[evaluated] = self.net.critic.forward(last).cpu().numpy()[:, 0]
        next_values[samples.terminated] = 0.0
        return values, next_values

    def _update_actor(
        self, observations: Tensor, old: ActorBatch, permutations: list[Tensor]
    ) -> tuple[float, float]:
        """Train the actor; returns KL(old ‖ new) and the share of clipped ratios."""
        actor, log_std = self.net.actor, self.net.log_std
        log_std_old = log_std.clone()
        clip_fractions = [
            self.actor_step(batch, ActorBatch(*columns), log_std_old)
            for batch, *columns in minibatches(permutations, self.config.minibatch, observations, *old)
        ]
        kl = kl_divergence(old.mean, log_std_old, actor.forward(observations), log_std).mean()
        return float(kl), float(torch.stack(clip_fractions).mean())

    def actor_step(self, observations: Tensor, old: ActorBatch, log_std_old: Tensor) -> Tensor:
        """One gradient step of the actor; returns the share of clipped ratios.

        observations: (N, O) normalised; old: the old policy's actions there; log_std_old: (A,) its log
        standard deviation.
        """
        c, actor, log_std = self.config, self.net.actor, self.net.log_std
        penalty = self.progress.penalty if c.kl_penalty else 0.0
        entropy = self.progress.entropy if c.learn_action_std else 0.0
        mean = actor.forward(observations)
        gradients = policy_gradients(old, log_std_old, mean, log_std, c.clip, penalty, entropy)
        log_std.grad = gradients.log_std
        _gradient_step(actor, gradients.mean, self.actor_optimizer)
        return gradients.clip_fraction

    def _update_critic(self, observations: Tensor, returns: Tensor, permutations: list[Tensor]) -> float:
        """Train the critic; returns the mean of the minibatches' losses."""
        batches = minibatches(permutations, self.config.minibatch, observations, returns[:, None])
        return float(torch.stack([self.critic_step(*batch) for batch in batches]).mean())

    def critic_step(self, observations: Tensor, returns: Tensor) -> Tensor:
        """One gradient step of the critic; returns its loss before the step, half the mean squared error.

        observations: (N, O) normalised; returns: (N, 1).
        """
        error = self.net.critic.forward(observations) - returns
        _gradient_step(self.net.critic, error / len(error), self.critic_optimizer)
        return 0.5 * error.square().mean()

    def policy(self) -> Policy:
        """What is evaluated and kept."""
        return self.acting()

    def acting(self) -> Policy:
        """The actor with its normaliser, as it samples; a tracker's has the critic too."""
        return export(self.net, self.normalizer, critic=self.config.env.tracking is not None)

    def record_extras(self) -> dict[str, Any]:
        """The GPU that updates the networks, if one does."""
        return {} if self.device == CPU else {"device": torch.cuda.get_device_name(self.device)}

    def record(self) -> dict[str, Any]:
        """The state except arrays, as JSON for a checkpoint."""
        return {
            "progress": asdict(self.progress),
            "random": self.random.bit_generator.state,
            "normalizer_count": self.normalizer.count,
        }

    def tensors(self) -> dict[str, Tensor]:
        """All arrays of the state, for a checkpoint."""
        tensors = {
            "actor": self.net.actor.parameters,
            "critic": self.net.critic.parameters,
            "log_std": self.net.log_std,
            "normalizer.mean": torch.from_numpy(self.normalizer.mean),
            "normalizer.squares": torch.from_numpy(self.normalizer.squares),
        }
        for kind, optimizer in (("actor", self.actor_optimizer), ("critic", self.critic_optimizer)):
            for index, slots in optimizer.state_dict()["state"].items():
                tensors |= {f"optimizer.{kind}.{index}.{slot}": value for slot, value in slots.items()}
        return {name: value.detach().to("cpu", copy=True) for name, value in tensors.items()}

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        """Restore the state from `tensors` and `record`."""
        self.net.actor.parameters.copy_(tensors["actor"])
        self.net.critic.parameters.copy_(tensors["critic"])
        self.net.log_std.copy_(tensors["log_std"])
        self.progress = PpoProgress(**record["progress"])
        self.random.bit_generator.state = record["random"]
        self.normalizer.count = record["normalizer_count"]
        self.normalizer.mean = tensors["normalizer.mean"].numpy().copy()
        self.normalizer.squares = tensors["normalizer.squares"].numpy().copy()
        for kind, optimizer in (("actor", self.actor_optimizer), ("critic", self.critic_optimizer)):
            restore_optimizer(optimizer, below(f"optimizer.{kind}.", tensors))
        for group in self.actor_optimizer.param_groups:
            group["lr"] = self.progress.actor_rate


def _value_errors(returns: Tensor, values: Tensor) -> dict[str, float]:
    """How well values (N,) predict returns (N,), as scalars to log."""
    variance, errors = float(returns.var(correction=0)), returns - values
    unexplained = float(errors.var(correction=0))
    return {
        "value/explained_variance": 1.0 - unexplained / variance if variance > 0 else 0.0,
        "value/normalized_loss": normalized_loss(float(errors.square().mean()), variance),
    }


def minibatches(permutations: list[Tensor], size: int, *columns: Tensor) -> Iterator[tuple[Tensor, ...]]:
    """Rows of the columns, `size` at a time, in the order of one permutation after the other."""
    for order in permutations:
        yield from zip(*(torch.split(column.index_select(0, order), size) for column in columns), strict=True)


def _begin_thread(share: int, device: torch.device) -> None:
    torch.set_num_threads(share)
    # cuBLAS warns if it is the first to use a GPU in a thread.
    torch.zeros((), device=device)


def _gradient_step(network: Mlp, output_gradient: Tensor, optimizer: torch.optim.Optimizer) -> None:
    """One optimiser step for a loss with this gradient (N, out) by the output; the gradient is clipped."""
    network.backward(output_gradient)
    norm = torch.linalg.vector_norm(network.gradient)
    network.gradient.mul_((MAX_GRADIENT_NORM / (norm + 1e-6)).clamp(max=1.0))
    optimizer.step()

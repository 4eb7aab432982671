"""A rival at work: stable-baselines3 trains on our figures, in rounds that can be stored and resumed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DDPG
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from torch import Tensor

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.baselines.env import ImitationVecEnv
from kinemimic.train.baselines.model import (
    build,
    critic_errors,
    explore,
    exported,
    learns,
    normalized,
    optimizers,
    statistics,
)
from kinemimic.train.baselines.replay_memory import Memory
from kinemimic.train.config.config import RewardConfig, TrainConfig, scheduled_at
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import FIGURES
from kinemimic.train.rollout.sampler import INFERENCE, Figures, Sampler
from kinemimic.train.runner.base import ROLLOUT, UPDATE, Progress, normalized_loss
from kinemimic.train.task.timer import Seconds, Timer, split

_POLICY, _OPTIMIZER, _MEMORY = "policy.", "optimizer.", "memory."
_RANDOM = "random.torch"
_LOOK = 4096  # samples of DDPG's memory that its critic is measured on


class Randomness:
    """numpy's and torch's global generators, which stable-baselines3 draws from, as a training left them.

    What draws between its rounds changes nothing for it, and it changes nothing for others.
    """

    def __init__(self, seed: int) -> None:
        bits = np.random.MT19937(np.random.SeedSequence(seed))
        self._numpy: dict[str, Any] = np.random.RandomState(bits).get_state(legacy=False)
        self.torch: Tensor = torch.Generator().manual_seed(seed).get_state()

    @contextmanager
    def here(self) -> Iterator[None]:
        """In here the global generators are ours."""
        outside = np.random.get_state(), torch.get_rng_state()  # noqa: NPY002 (it is theirs)
        np.random.set_state(self._numpy)  # noqa: NPY002
        torch.set_rng_state(self.torch)
        try:
            yield
        finally:
            self._numpy, self.torch = np.random.get_state(legacy=False), torch.get_rng_state()  # noqa: NPY002
            np.random.set_state(outside[0])  # noqa: NPY002
            torch.set_rng_state(outside[1])

    def record(self) -> dict[str, Any]:
        """numpy's, as JSON."""
        inner = self._numpy["state"]
        return {**self._numpy, "state": {"key": inner["key"].tolist(), "pos": int(inner["pos"])}}

    def restore(self, record: dict[str, Any], state: Tensor) -> None:
        """Take up what `record` and `torch` were."""
        key = np.array(record["state"]["key"], dtype=np.uint32)
        self._numpy, self.torch = {**record, "state": {**record["state"], "key": key}}, state.clone()


class BaselineAlgorithm:
    """`Learning` (`learning.py`) by stable-baselines3, with the figures, which its algorithms own.

    threads: of the native engine.
    """

    def __init__(self, config: TrainConfig, motion: Motion, engine: str, threads: int) -> None:
        self.config = config
        self.progress = Progress()
        seeds = np.random.SeedSequence(config.seed).spawn(config.num_envs)
        self.env = ImitationVecEnv(Sampler(motion, config.env, seeds, engine, threads), config)
        self.normalizer = normalized(self.env)
        self.random = Randomness(config.seed)
        with self.random.here():
            self.model = build(config, self.normalizer)
        self.model.set_logger(Logger(None, []))

    @property
    def memory(self) -> Memory | None:
        """What DDPG remembers."""
        memory = getattr(self.model, "replay_buffer", None)
        return memory if isinstance(memory, Memory) else None

    def policy(self) -> Policy:
        return exported(self.model, self.normalizer, self.config)

    def notes(self) -> dict[str, Any]:
        if not isinstance(self.model, DDPG):
            return {}
        return {"gradient_steps_per_sample": round(self.model._n_updates / max(1, self.progress.samples), 4)}

    def tensors(self) -> dict[str, Tensor]:
        found = {_POLICY + name: value for name, value in self.model.policy.state_dict().items()}
        for kind, optimizer in optimizers(self.model).items():
            for index, slots in optimizer.state_dict()["state"].items():
                found |= {f"{_OPTIMIZER}{kind}.{index}.{slot}": value for slot, value in slots.items()}
        seen = statistics(self.normalizer)
        found |= {
            "normalizer.mean": torch.from_numpy(seen.mean),
            "normalizer.variance": torch.from_numpy(seen.var),
            _RANDOM: self.random.torch,
        }
        if self.memory is not None:
            found |= {_MEMORY + name: value for name, value in self.memory.tensors().items()}
        return found

    def record(self) -> dict[str, Any]:
        return {
            "progress": asdict(self.progress),
            "updates": self.model._n_updates,
            "random": self.random.record(),
            "normalizer_count": float(statistics(self.normalizer).count),
            "memory_position": self.memory.pos if self.memory is not None else 0,
        }

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        self.model.policy.load_state_dict(_below(_POLICY, tensors))
        for kind, optimizer in optimizers(self.model).items():
            saved, slots = optimizer.state_dict(), dict[int, dict[str, Tensor]]()
            for name, value in _below(f"{_OPTIMIZER}{kind}.", tensors).items():
                index, slot = name.split(".")
                slots.setdefault(int(index), {})[slot] = value
            optimizer.load_state_dict({**saved, "state": slots})
        seen = statistics(self.normalizer)
        seen.mean = tensors["normalizer.mean"].numpy().copy()
        seen.var = tensors["normalizer.variance"].numpy().copy()
        seen.count = record["normalizer_count"]
        self.random.restore(record["random"], tensors[_RANDOM])
        if self.memory is not None:
            self.memory.restore(_below(_MEMORY, tensors), record["memory_position"])
        self.progress = Progress(**record["progress"])
        self.model.num_timesteps = self.progress.samples
        self.model._n_updates = record["updates"]


def _below(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


class _Watching(BaseCallback):
    """Tells rollouts from updates, and keeps what the critic took the states of each rollout to be worth.

    errors, targets: of the critic, a list of (steps, E) arrays; none with DDPG, which rolls out without.
    """

    def __init__(self, timer: Timer) -> None:
        super().__init__()
        self._timer = timer
        self.errors: list[NDArray[np.float32]] = []
        self.targets: list[NDArray[np.float32]] = []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self._timer.lap(UPDATE)
        check(self.model.policy)

    def _on_rollout_end(self) -> None:
        if (rollout := getattr(self.model, "rollout_buffer", None)) is not None:
            self.errors.append(rollout.values - rollout.returns)
            self.targets.append(rollout.returns.copy())
        self._timer.lap(ROLLOUT)


def check(networks: torch.nn.Module) -> None:
    """FloatingPointError if a weight is infinite or NaN."""
    if not all(bool(torch.isfinite(weights).all()) for weights in networks.parameters()):
        raise FloatingPointError("the policy or its value became infinite or NaN")


class BaselineRunner:
    """`Practice` (`learning.py`) of a rival."""

    def __init__(self, learner: BaselineAlgorithm, timer: Timer) -> None:
        self._learner, self._env, self._timer = learner, learner.env, timer

    @property
    def patience(self) -> float:
        # Five minutes with 0.7 GB of memory.
        return 1.0 if self._learner.memory is None else 10.0

    def begin(self, figures: Figures | None) -> None:
        if figures is not None:
            self._env.sampler.place(figures)
            return
        # As the first call of `VecNormalize.reset` does.
        statistics(self._learner.normalizer).update(self._put())

    def _put(self) -> NDArray[np.float32]:
        config, samples = self._learner.config, self._learner.progress.samples
        return self._env.begin(config.reward(samples), scheduled_at(config.strength, samples))

    def round(self) -> dict[str, float]:
        learner, env, config, state = self._learner, self._env, self._learner.config, self._learner.progress
        model, watching = learner.model, _Watching(self._timer)
        seen = self._put()
        model._last_original_obs, model._last_obs = seen, learner.normalizer.normalize_obs(seen)
        model._last_episode_starts = env.sampler.batch.ages == 0
        action_std = explore(model, config, state.samples)
        learns(model, config, state.samples)
        if learner.memory is not None:
            learner.memory.under(config.reward(state.samples))
        self._timer.lap(ROLLOUT)
        with learner.random.here():
            model.learn(config.batch, watching, reset_num_timesteps=False)
            if isinstance(model, DDPG):
                errors, targets = critic_errors(model, _LOOK)
            else:
                errors, targets = np.concatenate(watching.errors), np.concatenate(watching.targets)
        check(model.policy)
        env.sampler.end()
        self._timer.lap(UPDATE)
        tally = env.tally
        state.samples += config.batch
        state.rounds += 1
        state.exploded += tally.exploded
        spread = float(targets.var())
        logged = {
            "reward/mean": float(np.mean(tally.rewards)),
            "episode/length": float(np.mean(tally.lengths)) if tally.lengths else float(config.horizon),
            "policy/noise": action_std,
            "value/loss": 0.5 * float(np.square(errors).mean()),
            "value/explained_variance": 1.0 - float(errors.var()) / spread if spread > 0 else 0.0,
            "value/normalized_loss": normalized_loss(float(np.square(errors).mean()), spread),
            "simulation/exploded": float(tally.exploded),
        }
        told = model.logger.name_to_value
        theirs = {"policy/kl": "train/approx_kl", "policy/clip_fraction": "train/clip_fraction"}
        return logged | {ours: float(told[name]) for ours, name in theirs.items() if name in told}

    def seconds(self) -> Seconds:
        return split(self._timer.seconds, ROLLOUT, self._env.seconds, INFERENCE)

    def figures(self) -> Figures:
        return self._env.sampler.figures()

    def run_episodes(
        self, policy: Policy, reward: RewardConfig, phases: Sequence[float]
    ) -> Sequence[Episode]:
        return self._env.sampler.run_episodes(policy, reward, phases)

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        return self._env.sampler.robust_returns(policy, reward, range(FIGURES))

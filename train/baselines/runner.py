"""Training a baseline: stable-baselines3 on our environments, in rounds that can be stored and resumed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from torch import Tensor

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.baselines.env import ImitationVecEnv
from kinemimic.train.baselines.model import (
    build_model,
    enable_updates,
    export_policy,
    observation_statistics,
    optimizers,
    set_exploration,
    with_normalization,
)
from kinemimic.train.baselines.off_policy import OffPolicyModel, critic_errors, entropy_weight
from kinemimic.train.baselines.replay_memory import RescalingReplayBuffer
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.config.env_config import RewardConfig
from kinemimic.train.ppo.mlp import CPU
from kinemimic.train.rollout import evaluation
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.robustness import ROBUSTNESS_EPISODES
from kinemimic.train.runner.base import ROLLOUT, UPDATE, TrainingProgress, normalized_loss
from kinemimic.train.runner.tensors import MEMORY, below, restore_optimizer
from kinemimic.train.sampling.sampler import INFERENCE, EnvStates, Sampler
from kinemimic.train.task.timer import Seconds, Timer, split

_POLICY, _OPTIMIZER = "policy.", "optimizer."
_RANDOM = "random.torch"
_CRITIC_SAMPLES = 4096  # of the replay buffer, to measure its critic


class GlobalRandomState:
    """numpy's and torch's global generators, which stable-baselines3 draws from, in a separate state.

    Draws outside the rounds of training do not affect it, and it does not affect them.
    """

    def __init__(self, seed: int) -> None:
        bits = np.random.MT19937(np.random.SeedSequence(seed))
        self._numpy: dict[str, Any] = np.random.RandomState(bits).get_state(legacy=False)
        self.torch: Tensor = torch.Generator().manual_seed(seed).get_state()

    @contextmanager
    def installed(self) -> Iterator[None]:
        """A context in which the global generators have this state."""
        outside = np.random.get_state(), torch.get_rng_state()  # noqa: NPY002 (stable-baselines3 uses it)
        np.random.set_state(self._numpy)  # noqa: NPY002
        torch.set_rng_state(self.torch)
        try:
            yield
        finally:
            self._numpy, self.torch = np.random.get_state(legacy=False), torch.get_rng_state()  # noqa: NPY002
            np.random.set_state(outside[0])  # noqa: NPY002
            torch.set_rng_state(outside[1])

    def record(self) -> dict[str, Any]:
        """numpy's state, as JSON."""
        inner = self._numpy["state"]
        return {**self._numpy, "state": {"key": inner["key"].tolist(), "pos": int(inner["pos"])}}

    def restore(self, record: dict[str, Any], state: Tensor) -> None:
        """Restore the states of `record` and `torch`."""
        key = np.array(record["state"]["key"], dtype=np.uint32)
        self._numpy, self.torch = {**record, "state": {**record["state"], "key": key}}, state.clone()


class BaselineAlgorithm:
    """`Algorithm` (train/runner/base.py) of stable-baselines3, which owns its environments.

    threads: of the native engine; device: see `build_model`.
    """

    def __init__(
        self, config: TrainConfig, motion: Motion, engine: str, threads: int, device: torch.device = CPU
    ) -> None:
        self.config = config
        self.progress = TrainingProgress()
        seeds = np.random.SeedSequence(config.seed).spawn(config.num_envs)
        self.env = ImitationVecEnv(Sampler(motion, config.env, seeds, engine, threads), config)
        self.normalizer = with_normalization(self.env)
        self.random = GlobalRandomState(config.seed)
        with self.random.installed():
            self.model = build_model(config, self.normalizer, device)
        self.model.set_logger(Logger(None, []))

    @property
    def memory(self) -> RescalingReplayBuffer | None:
        """The replay buffer, None for algorithms without one."""
        memory = getattr(self.model, "replay_buffer", None)
        return memory if isinstance(memory, RescalingReplayBuffer) else None

    def policy(self) -> Policy:
        return export_policy(self.model, self.normalizer, self.config)

    def record_extras(self) -> dict[str, Any]:
        if not isinstance(self.model, OffPolicyModel):
            return {}
        steps = round(self.model._n_updates / max(1, self.progress.samples), 4)
        device = self.model.device
        where = {} if device == CPU else {"device": torch.cuda.get_device_name(device)}
        return {"gradient_steps_per_sample": steps, **where}

    def tensors(self) -> dict[str, Tensor]:
        tensors = {_POLICY + name: value for name, value in self.model.policy.state_dict().items()}
        for kind, optimizer in optimizers(self.model).items():
            for index, slots in optimizer.state_dict()["state"].items():
                tensors |= {f"{_OPTIMIZER}{kind}.{index}.{slot}": value for slot, value in slots.items()}
        statistics = observation_statistics(self.normalizer)
        tensors |= {
            "normalizer.mean": torch.from_numpy(statistics.mean),
            "normalizer.variance": torch.from_numpy(statistics.var),
            _RANDOM: self.random.torch,
        }
        if isinstance(self.model, OffPolicyModel):
            tensors |= entropy_weight(self.model)
        if self.memory is not None:
            tensors |= {MEMORY + name: value for name, value in self.memory.tensors().items()}
        return {name: value.cpu() for name, value in tensors.items()}

    def record(self) -> dict[str, Any]:
        return {
            "progress": asdict(self.progress),
            "updates": self.model._n_updates,
            "random": self.random.record(),
            "normalizer_count": float(observation_statistics(self.normalizer).count),
            "memory_position": self.memory.pos if self.memory is not None else 0,
        }

    def restore(self, tensors: dict[str, Tensor], record: dict[str, Any]) -> None:
        self.model.policy.load_state_dict(below(_POLICY, tensors))
        for kind, optimizer in optimizers(self.model).items():
            restore_optimizer(optimizer, below(f"{_OPTIMIZER}{kind}.", tensors))
        if isinstance(self.model, OffPolicyModel):
            for name, weight in entropy_weight(self.model).items():
                weight.copy_(tensors[name])
        statistics = observation_statistics(self.normalizer)
        statistics.mean = tensors["normalizer.mean"].numpy().copy()
        statistics.var = tensors["normalizer.variance"].numpy().copy()
        statistics.count = record["normalizer_count"]
        self.random.restore(record["random"], tensors[_RANDOM])
        if self.memory is not None:
            self.memory.restore(below(MEMORY, tensors), record["memory_position"])
        self.progress = TrainingProgress(**record["progress"])
        self.model.num_timesteps = self.progress.samples
        self.model._n_updates = record["updates"]


class _RolloutMonitor(BaseCallback):
    """Separates the time of rollouts from that of updates, and keeps the critic's errors.

    errors, targets: of the critic in each rollout, lists of (steps, E) arrays; empty with a replay
    buffer.
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
        check_finite(self.model.policy)

    def _on_rollout_end(self) -> None:
        if (rollout := getattr(self.model, "rollout_buffer", None)) is not None:
            self.errors.append(rollout.values - rollout.returns)
            self.targets.append(rollout.returns.copy())
        self._timer.lap(ROLLOUT)


def check_finite(networks: torch.nn.Module) -> None:
    """FloatingPointError if a weight is infinite or NaN."""
    if not torch.stack([torch.isfinite(weights).all() for weights in networks.parameters()]).all():
        raise FloatingPointError("the policy or its value became infinite or NaN")


class BaselineRunner:
    """`Runner` (train/runner/base.py) of a baseline; phases: of the evaluation episodes."""

    def __init__(self, algorithm: BaselineAlgorithm, timer: Timer, phases: Sequence[float] = (0.0,)) -> None:
        self._algorithm, self._env, self._timer, self._phases = algorithm, algorithm.env, timer, phases

    @property
    def evaluation_interval(self) -> int:
        return evaluation.EVALUATION_INTERVAL

    @property
    def checkpoint_interval_factor(self) -> float:
        # Five minutes with a replay buffer of 0.7 GB.
        return 1.0 if self._algorithm.memory is None else 10.0

    def start(self, env_states: EnvStates | None) -> None:
        if env_states is not None:
            self._env.sampler.set_env_states(env_states)
            return
        # As the first call of `VecNormalize.reset` does.
        observation_statistics(self._algorithm.normalizer).update(self._begin_round())

    def _begin_round(self) -> NDArray[np.float32]:
        config, samples = self._algorithm.config, self._algorithm.progress.samples
        return self._env.begin_round(config.reward(samples), scheduled_at(config.strength, samples))

    def round(self) -> dict[str, float]:
        algorithm, env, config, state = (
            self._algorithm,
            self._env,
            self._algorithm.config,
            self._algorithm.progress,
        )
        model, monitor = algorithm.model, _RolloutMonitor(self._timer)
        observations = self._begin_round()
        model._last_original_obs = observations
        model._last_obs = algorithm.normalizer.normalize_obs(observations)
        model._last_episode_starts = env.sampler.batch.ages == 0
        action_std = set_exploration(model, config, state.samples)
        enable_updates(model, config, state.samples)
        if algorithm.memory is not None:
            algorithm.memory.set_reward(config.reward(state.samples))
        self._timer.lap(ROLLOUT)
        with algorithm.random.installed():
            if isinstance(model, SAC) and model.device != CPU:
                # Its actor draws there, from a generator that is in no checkpoint.
                torch.cuda.manual_seed(int(torch.randint(2**62, ())))
            model.learn(config.batch, monitor, reset_num_timesteps=False)
            if isinstance(model, OffPolicyModel):
                errors, targets = critic_errors(model, _CRITIC_SAMPLES)
            else:
                errors, targets = np.concatenate(monitor.errors), np.concatenate(monitor.targets)
        check_finite(model.policy)
        env.sampler.end_round()
        self._timer.lap(UPDATE)
        statistics = env.statistics
        state.samples += config.batch
        state.rounds += 1
        state.exploded += statistics.exploded
        variance = float(targets.var())
        logged = {
            "reward/mean": float(np.mean(statistics.rewards)),
            **(
                {"episode/length": float(np.mean(statistics.episode_lengths))}
                if statistics.episode_lengths
                else {}
            ),
            "policy/noise": action_std,
            "value/loss": 0.5 * float(np.square(errors).mean()),
            "value/explained_variance": 1.0 - float(errors.var()) / variance if variance > 0 else 0.0,
            "value/normalized_loss": normalized_loss(float(np.square(errors).mean()), variance),
            "simulation/exploded": float(statistics.exploded),
        }
        values = model.logger.name_to_value
        theirs = {"policy/kl": "train/approx_kl", "policy/clip_fraction": "train/clip_fraction"}
        return logged | {ours: float(values[name]) for ours, name in theirs.items() if name in values}

    def seconds(self) -> Seconds:
        return split(self._timer.seconds, ROLLOUT, self._env.seconds, INFERENCE)

    def env_states(self) -> EnvStates:
        return self._env.sampler.env_states()

    def run_episodes(self, policy: Policy, reward: RewardConfig) -> Sequence[Episode]:
        return self._env.sampler.run_episodes(policy, reward, self._phases)

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        return self._env.sampler.robust_returns(policy, reward, range(ROBUSTNESS_EPISODES))

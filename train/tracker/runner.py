"""PPO on a motion library: the algorithm with the failures of each motion, its workers and its runner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kinemimic.pipeline.arrays import Array
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.config.env_config import RewardConfig
from kinemimic.train.ppo.mlp import CPU
from kinemimic.train.ppo.networks import copies
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.ppo.runner import PpoRunner
from kinemimic.train.reference.reference_library import ReferenceLibrary
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sampling.pool import OpenPool
from kinemimic.train.sampling.processes import SamplerProcesses
from kinemimic.train.sampling.sampler import Samples
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.task.timer import Timer
from kinemimic.train.tracker.motion_sampling import MotionStatistics, Outcome
from kinemimic.train.tracker.sampler import TrackerSampler

EVALUATION_INTERVAL = 1_048_576  # samples
# Samples that the policy is an average over: the weights of any one round perform some motions and fall in
# others, which their mean performs (Izmailov et al. 2018, "Averaging weights leads to wider optima and better
# generalization").
AVERAGED = 2_000_000
EARLY = 0.1  # share of the samples so far that the average is over at most: at first, the latest are the best
_STATISTICS = ("failures", "lengths")


class TrackerAlgorithm(PpoAlgorithm):
    """PPO that also keeps the `statistics` of the episodes of each of M motions.

    Its policy has a moving average of the actor's weights.
    """

    def __init__(self, config: TrainConfig, motions: int, device: torch.device = CPU) -> None:
        super().__init__(config, device)
        self.statistics = MotionStatistics(motions, config.env.steps)
        self._average = self.net.actor.parameters.clone()

    def begin_from(self, policy: Policy) -> None:
        super().begin_from(policy)
        self._average.copy_(self.net.actor.parameters)

    def policy(self) -> Policy:
        return replace(self.acting(), layers=copies(self.net.actor.split(self._average)))

    def update(self, samples: Samples) -> dict[str, float]:
        logged = super().update(samples)
        count = samples.terminated.size
        window = min(AVERAGED, EARLY * self.progress.samples)
        self._average.lerp_(self.net.actor.parameters, count / max(count, window))
        return logged

    def tensors(self) -> dict[str, Tensor]:
        """All arrays of the state, for a checkpoint."""
        own = {name: torch.from_numpy(getattr(self.statistics, name).copy()) for name in _STATISTICS}
        return {**super().tensors(), **own, "average": self._average.to("cpu", copy=True)}

    def restore(self, tensors: dict[str, Tensor], record: dict[str, object]) -> None:
        """Restore the state from `tensors` and `record`."""
        super().restore(tensors, record)
        for name in _STATISTICS:
            setattr(self.statistics, name, tensors[name].numpy().copy())
        self._average.copy_(tensors["average"])


class TrackerWorkers(Workers):
    """`count` samplers that share E environments on the motions of a library.

    tables: folder of the library's tables, or the library itself for samplers that do not share this
    machine's disk; open_pool: where they run.
    """

    def __init__(
        self,
        tables: Path | ReferenceLibrary,
        config: TrainConfig,
        count: int,
        engine: str,
        open_pool: OpenPool = SamplerProcesses,
    ) -> None:
        opened = partial(TrackerSampler, tables, config.env)
        self._begin(opened, config.num_envs, config.seed, count, engine, open_pool)

    def set_weights(self, weights: Array) -> None:
        """Probabilities (M,) of the motions of the episodes to come."""
        self._ask("set_weights", (weights,))

    def set_body_error(self, largest: float) -> None:
        """Mean distance of the bodies from their references at which an episode ends, m."""
        self._ask("set_body_error", (largest,))

    def take_outcomes(self) -> list[Outcome]:
        """The episodes that ended since the last call."""
        return [outcome for part in self._ask("take_outcomes") for outcome in part]

    def evaluate(self, policy: Policy, reward: RewardConfig, motions: NDArray[np.intp]) -> list[Episode]:
        """One evaluation episode of each of these motions (N,), in their order."""
        count = self._count
        parts = self._ask("evaluate", (policy, reward), [(motions[k::count],) for k in range(count)])
        return [parts[k % count][k // count] for k in range(len(motions))]


class TrackerRunner(PpoRunner):
    """`Runner` (train/runner/base.py) of a tracker; evaluated: (N,) the motions of its evaluations."""

    def __init__(
        self,
        algorithm: TrackerAlgorithm,
        workers: TrackerWorkers,
        timer: Timer,
        evaluated: NDArray[np.intp],
    ) -> None:
        super().__init__(algorithm, workers, timer)
        self._tracker, self._motions, self._evaluated = algorithm, workers, evaluated

    @property
    def evaluation_interval(self) -> int:
        return EVALUATION_INTERVAL

    def _sample(self, steps: int) -> Samples:
        config = self._tracker.config
        if config.body_error:
            self._motions.set_body_error(scheduled_at(config.body_error, self._tracker.progress.samples))
        self._motions.set_weights(self._tracker.statistics.weights())
        samples = super()._sample(steps)
        self._tracker.statistics.update(self._motions.take_outcomes())
        return samples

    def round(self) -> dict[str, float]:
        logged = super().round()
        return logged | {"library/failures": float(self._tracker.statistics.failures.mean())}

    def run_episodes(self, policy: Policy, reward: RewardConfig) -> Sequence[Episode]:
        return self._motions.evaluate(policy, reward, self._evaluated)

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        return ()

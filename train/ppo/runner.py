"""The runner of our PPO: workers sample with its policy, then the algorithm updates it."""

from __future__ import annotations

from collections.abc import Sequence

from kinemimic.train.config.config import scheduled_at
from kinemimic.train.config.env_config import RewardConfig
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.rollout import evaluation
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner.base import OTHER, ROLLOUT, UPDATE
from kinemimic.train.sampling.sampler import EnvStates, Samples
from kinemimic.train.sampling.workers import Workers
from kinemimic.train.task.timer import Seconds, Timer, split

WAITING = "transfer and waiting"  # the rest of a rollout's time, apart from the workers' seconds
_WARM_UP = 16  # steps of the untrained policy for the normaliser's first statistics


class PpoRunner:
    """`Runner` (train/runner/base.py) of our PPO; phases: of the evaluation episodes."""

    checkpoint_interval_factor = 1.0

    def __init__(
        self, algorithm: PpoAlgorithm, workers: Workers, timer: Timer, phases: Sequence[float] = (0.0,)
    ) -> None:
        self._algorithm, self._workers, self._timer, self._phases = algorithm, workers, timer, phases

    @property
    def evaluation_interval(self) -> int:
        return evaluation.EVALUATION_INTERVAL

    def start(self, env_states: EnvStates | None) -> None:
        if env_states is not None:
            self._workers.set_env_states(env_states)
            return
        if self._algorithm.normalizer.count:  # it started from a policy
            return
        first = self._sample(_WARM_UP)
        self._algorithm.progress.exploded += first.exploded
        self._algorithm.normalizer.update(first.observations.reshape(-1, first.observations.shape[-1]))

    def round(self) -> dict[str, float]:
        samples = self._sample(self._algorithm.config.horizon)
        logged = self._algorithm.update(samples)
        self._timer.lap(UPDATE)
        self._algorithm.progress.exploded += samples.exploded
        return logged | {"simulation/exploded": samples.exploded}

    def _sample(self, steps: int) -> Samples:
        algorithm, config, samples = self._algorithm, self._algorithm.config, self._algorithm.progress.samples
        self._timer.lap(OTHER)
        found = self._workers.sample(
            algorithm.acting(),
            algorithm.action_std(),
            config.reward(samples),
            scheduled_at(config.strength, samples),
            steps,
        )
        self._timer.lap(ROLLOUT)
        return found

    def seconds(self) -> Seconds:
        return split(self._timer.seconds, ROLLOUT, self._workers.seconds, WAITING)

    def env_states(self) -> EnvStates:
        return self._workers.env_states()

    def run_episodes(self, policy: Policy, reward: RewardConfig) -> Sequence[Episode]:
        return self._workers.run_episodes(policy, reward, self._phases)

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        return self._workers.robust_returns(policy, reward)

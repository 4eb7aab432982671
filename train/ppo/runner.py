"""Our PPO at work: workers sample with its policy, then it learns from what they bring."""

from __future__ import annotations

from collections.abc import Sequence

from kinemimic.train.config.config import RewardConfig, scheduled_at
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.rollout.evaluation import Episode
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.sampler import Figures, Samples
from kinemimic.train.rollout.workers import Workers
from kinemimic.train.runner.base import OTHER, ROLLOUT, UPDATE
from kinemimic.train.task.timer import Seconds, Timer, split

# What is left of a rollout's time beside what the workers say of it.
WAITING = "transfer and waiting"
_WARM_UP = 16  # steps of the untrained policy that give the normaliser its first statistics


class PpoRunner:
    """`Practice` (`learning.py`) of a learner with a crew."""

    patience = 1.0

    def __init__(self, learner: PpoAlgorithm, crew: Workers, timer: Timer) -> None:
        self._learner, self._crew, self._timer = learner, crew, timer

    def begin(self, figures: Figures | None) -> None:
        if figures is not None:
            self._crew.place(figures)
            return
        first = self._sample(_WARM_UP)
        self._learner.progress.exploded += first.exploded
        self._learner.normalizer.update(first.observations.reshape(-1, first.observations.shape[-1]))

    def round(self) -> dict[str, float]:
        samples = self._sample(self._learner.config.horizon)
        logged = self._learner.update(samples)
        self._timer.lap(UPDATE)
        self._learner.progress.exploded += samples.exploded
        return logged | {"simulation/exploded": samples.exploded}

    def _sample(self, steps: int) -> Samples:
        learner, config, samples = self._learner, self._learner.config, self._learner.progress.samples
        self._timer.lap(OTHER)
        found = self._crew.sample(
            learner.policy(),
            learner.action_std(),
            config.reward(samples),
            scheduled_at(config.strength, samples),
            steps,
        )
        self._timer.lap(ROLLOUT)
        return found

    def seconds(self) -> Seconds:
        return split(self._timer.seconds, ROLLOUT, self._crew.seconds, WAITING)

    def figures(self) -> Figures:
        return self._crew.figures()

    def run_episodes(
        self, policy: Policy, reward: RewardConfig, phases: Sequence[float]
    ) -> Sequence[Episode]:
        return self._crew.run_episodes(policy, reward, phases)

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        return self._crew.robust_returns(policy, reward)

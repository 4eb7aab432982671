"""Our PPO at work: workers sample with its policy, then it learns from what they bring."""

from __future__ import annotations

from collections.abc import Sequence

from kinemimic.train.config.config import RewardConfig, scheduled_at
from kinemimic.train.ppo.ppo import Learner
from kinemimic.train.rollout.evaluation import Attempt
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.sampler import Figures, Samples
from kinemimic.train.rollout.workers import Workers
from kinemimic.train.runner.base import OTHER, ROLLOUT, UPDATE
from kinemimic.train.task.stopwatch import Seconds, Stopwatch, split

# What is left of a rollout's time beside what the workers say of it.
WAITING = "transfer and waiting"
_WARM_UP = 16  # steps of the untrained policy that give the normaliser its first statistics


class PpoPractice:
    """`Practice` (`learning.py`) of a learner with a crew."""

    patience = 1.0

    def __init__(self, learner: Learner, crew: Workers, watch: Stopwatch) -> None:
        self._learner, self._crew, self._watch = learner, crew, watch

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
        self._watch.lap(UPDATE)
        self._learner.progress.exploded += samples.exploded
        return logged | {"simulation/exploded": samples.exploded}

    def _sample(self, steps: int) -> Samples:
        learner, config, samples = self._learner, self._learner.config, self._learner.progress.samples
        self._watch.lap(OTHER)
        found = self._crew.sample(
            learner.policy(),
            learner.noise(),
            config.reward(samples),
            scheduled_at(config.strength, samples),
            steps,
        )
        self._watch.lap(ROLLOUT)
        return found

    def seconds(self) -> Seconds:
        return split(self._watch.seconds, ROLLOUT, self._crew.seconds, WAITING)

    def figures(self) -> Figures:
        return self._crew.figures()

    def attempts(self, policy: Policy, reward: RewardConfig, phases: Sequence[float]) -> Sequence[Attempt]:
        return self._crew.attempts(policy, reward, phases)

    def ordeals(self, policy: Policy, reward: RewardConfig) -> Sequence[float]:
        return self._crew.ordeals(policy, reward)

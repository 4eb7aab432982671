"""Robustness evaluations: the return of a policy under its full domain randomization, without noise.

An evaluation without perturbations cannot tell robust policies from others: a policy that was never pushed
does best in it and falls at the first push. The draws have their own seeds, the same for every policy, so
that policies can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.evaluation import episode_frames
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.domain_randomization import RandomizationSample, draw
from kinemimic.train.task.env import ImitationBatch

ROBUSTNESS_EPISODES = 16


class RobustnessEvaluation:
    """One episode for each of some `numbers` (0 to ROBUSTNESS_EPISODES - 1) of the random draw.

    An episode lasts as in training: a motion that is performed once ends with it.
    """

    def __init__(self, reference: Reference, config: EnvConfig, numbers: Sequence[int], engine: str) -> None:
        self.numbers = tuple(numbers)
        self._config, self._size = config, len(numbers)
        self._batch = ImitationBatch(open_world(self._size, engine), reference, config)
        drawn = [draw(config.domain_randomization, 1.0, np.random.default_rng(number)) for number in numbers]
        self._conditions = RandomizationSample.concatenated(drawn)
        self._seeds = np.array(numbers, dtype=np.uint64)
        # Episodes start all around a cycle; a non-cyclic motion has one start.
        starts = np.array(numbers) / ROBUSTNESS_EPISODES
        self._phases = starts if reference.cyclic else np.zeros(self._size)
        self._frames = config.steps if reference.cyclic else episode_frames(reference)
        if config.scenario is not None:
            self._frames = min(self._frames, config.scenario.steps)

    def robust_returns(self, policy: Policy, reward: RewardConfig) -> list[float]:
        """Mean reward of each episode, 0 after a fall, as a share of the largest possible."""
        batch = self._batch
        batch.reward = reward
        batch.reset(np.arange(self._size), self._phases, self._conditions, self._seeds)
        total = np.zeros(self._size)

        def add_rewards(_: int, standing: NDArray[np.bool_]) -> None:
            total[:] += standing * batch.terms().sum(axis=1)

        roll_out(batch, policy.act, self._frames, add_rewards)
        shares: list[float] = (total / self._frames / sum(reward.weights.values())).tolist()
        return shares

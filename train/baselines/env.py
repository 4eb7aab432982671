"""A stable-baselines3 `VecEnv` over the environments of one `Sampler`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.train.baselines.shared_object import SharedObjectVecEnv
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import RewardConfig
from kinemimic.train.sampling.sampler import Sampler
from kinemimic.train.task.env import ACTIONS, SIMULATION, TASK
from kinemimic.train.task.observation import observation_size
from kinemimic.train.task.timer import Seconds

# stable-baselines3 clips actions to finite limits; at this one nothing is clipped, as in our own rollouts.
_UNBOUNDED = 1e3
_ELSEWHERE = "elsewhere"  # on the batch's timer: time between two steps


@dataclass
class RoundStatistics:
    """Of the current round.

    rewards: mean of each step; episode_lengths, exploded: of episodes that ended, how many were ended by the
    engine.
    """

    rewards: list[float] = field(default_factory=list)
    episode_lengths: list[int] = field(default_factory=list)
    exploded: int = 0


def spaces(config: TrainConfig) -> tuple[Box, Box]:
    """Spaces of an environment's observations (O,) and actions (42,)."""
    limit = _UNBOUNDED if config.bound is None else config.bound
    return (
        Box(-np.inf, np.inf, (observation_size(config.env),), np.float32),
        Box(-limit, limit, (ACTIONS,), np.float32),
    )


class ImitationVecEnv(SharedObjectVecEnv):
    """E imitation environments, each with its own random generator, as in our PPO.

    Observations (E, O), actions (E, 42) and ends of episodes are those of `ImitationBatch`. The next episode
    begins at once; `infos` then has the last one's `terminal_observation`, and `TimeLimit.truncated` if its
    time ran out. `terms` (K,) of each info are the reward's terms.
    """

    def __init__(self, sampler: Sampler, config: TrainConfig) -> None:
        self.sampler, self.statistics = sampler, RoundStatistics()
        self._strength = 0.0
        self._actions: Floats = np.zeros((config.num_envs, ACTIONS), np.float32)
        super().__init__(config.num_envs, *spaces(config))

    def begin_round(self, reward: RewardConfig, strength: float) -> Floats:
        """Begin a round with this reward; strength: of the domain randomization in episodes begun in it.

        Returns the observations (E, O). Humanoids are reset to their state, so that the engine forgets (see
        `sampler.py`).
        """
        self.sampler.batch.timer.lap(_ELSEWHERE)
        self.sampler.begin_round(reward)
        self._strength, self.statistics = strength, RoundStatistics()
        return self._observe()

    def _observe(self) -> Floats:
        return self.sampler.batch.observe().astype(np.float32)

    @property
    def seconds(self) -> Seconds:
        """Seconds spent in this environment, by purpose."""
        spent = self.sampler.batch.timer.seconds
        return {name: spent.get(name, 0.0) for name in (SIMULATION, TASK)}

    def reset(self) -> Floats:
        """Begin new episodes in all environments."""
        self.sampler.restart(np.arange(self.num_envs), self._strength)
        return self._observe()

    def step_async(self, actions: NDArray[Any]) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Floats, Floats, NDArray[np.bool_], list[dict[str, Any]]]:
        batch = self.sampler.batch
        batch.timer.lap(_ELSEWHERE)
        step = batch.step(self._actions.astype(np.float64))
        observations, rewards = step.observations.astype(np.float32), step.terms.sum(axis=1)
        dones = step.terminated | step.truncated
        infos: list[dict[str, Any]] = [{"terms": terms} for terms in step.terms]
        self.statistics.rewards.append(float(rewards.mean()))
        ended = np.flatnonzero(dones)
        if len(ended):
            self.statistics.episode_lengths += batch.ages[ended].tolist()
            self.statistics.exploded += int(step.exploded.sum())
            for k in ended:
                infos[k]["terminal_observation"] = observations[k].copy()
                infos[k]["TimeLimit.truncated"] = bool(step.truncated[k])
            self.sampler.restart(ended, self._strength)
            observations[ended] = self._observe()[ended]
        batch.timer.lap(TASK)
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        self.sampler.batch.world.close()

"""The figures of one process as stable-baselines3 takes them: a `VecEnv` over one `Sampler`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from kinemimic.pipeline.arrays import Floats
from kinemimic.train.config.config import RewardConfig, TrainConfig
from kinemimic.train.rollout.sampler import Sampler
from kinemimic.train.task.env import ACTIONS, SIMULATION, TASK, observation_size
from kinemimic.train.task.timer import Seconds

# stable-baselines3 wants finite limits and clips to them: so far off that nothing is, as in our own rollouts.
_FREE = 1e3
# On the batch's timer what others do between two steps.
_ELSEWHERE = "elsewhere"


@dataclass
class Tally:
    """What became of the figures since a round began.

    rewards: each step's mean; lengths: of the episodes that ended; exploded: figures that the engine lost.
    """

    rewards: list[float] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    exploded: int = 0


def spaces(config: TrainConfig) -> tuple[Box, Box]:
    """Of a figure's observations (O,) and actions (42,)."""
    limit = _FREE if config.bound is None else config.bound
    return (
        Box(-np.inf, np.inf, (observation_size(config.env),), np.float32),
        Box(-limit, limit, (ACTIONS,), np.float32),
    )


class ImitationVecEnv(VecEnv):
    """E figures that imitate, each from a random generator of its own, as those of our PPO.

    Observations (E, O) and actions (E, 42) are those of `ImitationBatch`, and an episode ends as there; then
    the figure begins the next one at once, and `infos` has what the last one led to: `terminal_observation`,
    and `TimeLimit.truncated` where it was only its time that was up. `terms` of each figure's info (K,) are
    those of its reward.
    """

    def __init__(self, sampler: Sampler, config: TrainConfig) -> None:
        self.sampler, self.tally = sampler, Tally()
        self._strength = 0.0
        self._actions: Floats = np.zeros((config.num_envs, ACTIONS), np.float32)
        super().__init__(config.num_envs, *spaces(config))

    def begin(self, reward: RewardConfig, strength: float) -> Floats:
        """Begin a round under this reward, and hardships of this strength in the episodes that begin in it.

        Returns the observations (E, O) of the figures as they are, put anew so that the engine forgets (see
        `rollout.py`).
        """
        self.sampler.batch.timer.lap(_ELSEWHERE)
        self.sampler.begin(reward)
        self._strength, self.tally = strength, Tally()
        return self._observe()

    def _observe(self) -> Floats:
        return self.sampler.batch.observe().astype(np.float32)

    @property
    def seconds(self) -> Seconds:
        """Where the time in here went."""
        spent = self.sampler.batch.timer.seconds
        return {name: spent.get(name, 0.0) for name in (SIMULATION, TASK)}

    def reset(self) -> Floats:
        """New episodes for all."""
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
        self.tally.rewards.append(float(rewards.mean()))
        ended = np.flatnonzero(dones)
        if len(ended):
            self.tally.lengths += batch.ages[ended].tolist()
            self.tally.exploded += int(step.exploded.sum())
            for k in ended:
                infos[k]["terminal_observation"] = observations[k].copy()
                infos[k]["TimeLimit.truncated"] = bool(step.truncated[k])
            self.sampler.restart(ended, self._strength)
            observations[ended] = self._observe()[ended]
        batch.timer.lap(TASK)
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        self.sampler.batch.world.close()

    # What the interface asks for beside: there is one environment, not one for each figure.

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        if attr_name != "render_mode":
            raise AttributeError(f"expected render_mode, found {attr_name}: figures have no environment each")
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        raise AttributeError(f"expected nothing to set, found {attr_name}: figures have no environment each")

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **kwargs: Any
    ) -> list[Any]:
        raise AttributeError(f"expected no method, found {method_name}: figures have no environment each")

    def env_is_wrapped(
        self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None
    ) -> list[bool]:
        return [False] * self.num_envs

"""The replay buffer of DDPG, TD3 and SAC: it recomputes old rewards when the reward's scales change.

An on-policy algorithm discards its samples after every round, so scales that change between rounds do not
matter to it. A replay buffer would mix rewards of different scales; this one stores the errors behind them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from torch import Tensor

from kinemimic.train.config.env_config import RewardConfig

# Error of a term that is 0, as after a fall: it stays 0 at any scale.
_VANISHED = 1e9


class RescalingReplayBuffer(ReplayBuffer):
    """stable-baselines3's, with `errors` (steps, E, K): e of every sample's terms w exp(-k e)."""

    def __init__(self, *arguments: Any, terms: int, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.errors: NDArray[np.float32] = np.zeros((self.buffer_size, self.n_envs, terms), np.float32)
        self._weights, self._scales = np.ones(terms), np.ones(terms)

    def set_reward(self, reward: RewardConfig) -> None:
        """Use this reward, of other scales at most, for all samples, old and new."""
        scales = np.array([reward.scales[name] for name in reward.weights])
        self._weights = np.array([*reward.weights.values()])
        if (scales == self._scales).all():
            return
        self._scales, count = scales, self.size()
        self.rewards[:count] = np.exp(-scales.astype(np.float32) * self.errors[:count]) @ self._weights

    def add(
        self,
        obs: NDArray[Any],
        next_obs: NDArray[Any],
        action: NDArray[Any],
        reward: NDArray[Any],
        done: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        terms = np.array([info["terms"] for info in infos])
        with np.errstate(divide="ignore"):
            errors = -np.log(terms / self._weights) / self._scales
        self.errors[self.pos] = np.minimum(errors, _VANISHED)
        super().add(obs, next_obs, action, reward, done, infos)

    def tensors(self) -> dict[str, Tensor]:
        """Arrays for a checkpoint; of next observations those that are not the next step's observation."""
        count = self.size()
        following = np.roll(self.observations[:count], -1, axis=0)
        breaks = (self.next_observations[:count] != following).any(axis=-1)
        arrays = {name: getattr(self, name)[:count] for name in _STORED}
        arrays |= {
            "breaks": breaks,
            "next_at_breaks": self.next_observations[:count][breaks],
            "scales": self._scales,
        }
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    def restore(self, tensors: dict[str, Tensor], position: int) -> None:
        """Restore the arrays of `tensors`; position: row of the next sample."""
        arrays = {name: tensor.numpy() for name, tensor in tensors.items()}
        count = len(arrays["rewards"])
        for name in _STORED:
            getattr(self, name)[:count] = arrays[name]
        self.next_observations[:count] = np.roll(arrays["observations"], -1, axis=0)
        self.next_observations[:count][arrays["breaks"]] = arrays["next_at_breaks"]
        self._scales = arrays["scales"]
        self.pos, self.full = position, count == self.buffer_size


_STORED = ("observations", "actions", "rewards", "dones", "timeouts", "errors")

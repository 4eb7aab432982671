"""DDPG's memory, which tells old samples anew when the reward's scales change.

A reward that changes with the samples is the same to an algorithm that forgets after every round. Whoever
remembers would learn from rewards of another time; so what is remembered are the errors behind them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from torch import Tensor

from kinemimic.train.config.config import RewardConfig

# Of a term that vanished, as after a fall: no scale brings it back.
_LOST = 1e9


class Memory(ReplayBuffer):
    """stable-baselines3's, with `errors` (steps, E, K): eᵢ of every sample's terms w exp(-k e)."""

    def __init__(self, *arguments: Any, terms: int, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.errors: NDArray[np.float32] = np.zeros((self.buffer_size, self.n_envs, terms), np.float32)
        self._weights, self._scales = np.ones(terms), np.ones(terms)

    def under(self, reward: RewardConfig) -> None:
        """Tell all that is remembered, and what will be, under this reward, which differs in scales alone."""
        scales = np.array([reward.scales[name] for name in reward.weights])
        self._weights, before = np.array([*reward.weights.values()]), self._scales
        if (scales == before).all():
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
            found = -np.log(terms / self._weights) / self._scales
        self.errors[self.pos] = np.minimum(found, _LOST)
        super().add(obs, next_obs, action, reward, done, infos)

    def tensors(self) -> dict[str, Tensor]:
        """What it remembers, for a checkpoint: of the next observations those that the next step does not
        begin with."""
        count = self.size()
        following = np.roll(self.observations[:count], -1, axis=0)
        apart = (self.next_observations[:count] != following).any(axis=-1)
        arrays = {name: getattr(self, name)[:count] for name in _PLAIN}
        arrays |= {
            "apart": apart,
            "next_apart": self.next_observations[:count][apart],
            "scales": self._scales,
        }
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    def restore(self, tensors: dict[str, Tensor], position: int) -> None:
        """Remember what `tensors` gave when the next sample's place was `position`."""
        arrays = {name: tensor.numpy() for name, tensor in tensors.items()}
        count = len(arrays["rewards"])
        for name in _PLAIN:
            getattr(self, name)[:count] = arrays[name]
        self.next_observations[:count] = np.roll(arrays["observations"], -1, axis=0)
        self.next_observations[:count][arrays["apart"]] = arrays["next_apart"]
        self._scales = arrays["scales"]
        self.pos, self.full = position, count == self.buffer_size


_PLAIN = ("observations", "actions", "rewards", "dones", "timeouts", "errors")

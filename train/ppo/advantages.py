"""Generalised advantage estimation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


def advantages(
    rewards: Array, values: Array, next_values: Array, ended: NDArray[np.bool_], discount: float, lam: float
) -> Array:
    """Generalised advantage estimates (T, E) (Schulman et al. 2016).

    rewards, values: (T, E); next_values: (T, E) value of the state after each step: 0 after a fall, the
    critic's value where time ran out; ended: (T, E) whether the episode ended there, for any reason.
    """
    result = np.zeros_like(rewards)
    tail = np.zeros(rewards.shape[1], dtype=rewards.dtype)
    for t in range(len(rewards) - 1, -1, -1):
        delta = rewards[t] + discount * next_values[t] - values[t]
        tail = delta + discount * lam * np.where(ended[t], 0.0, tail)
        result[t] = tail
    return result

"""Actor and critic of the paper's Fig. 1, the observation normaliser, and the policy exported from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kinemimic.pipeline.arrays import Floats
from kinemimic.train.config.env_config import OBSERVATION_CLIP
from kinemimic.train.ppo.mlp import CPU, Mlp, choose_gradient_dtype
from kinemimic.train.rollout.network import normalized
from kinemimic.train.rollout.policy import Policy

# Samples that the statistics of a policy count for when training starts from it.
START_COUNT = 1e7


class ActorCritic:
    """Two networks with the same hidden sizes, and the log standard deviation (actions,) of the policy.

    The actor's output is the mean of a Gaussian, the critic's is the value (N, 1).
    """

    def __init__(
        self,
        observations: int,
        actions: int,
        hidden: tuple[int, ...],
        action_std: float,
        device: torch.device = CPU,
    ) -> None:
        dtype = choose_gradient_dtype(device)
        self.actor = Mlp((observations, *hidden, actions), 0.01, dtype, device)
        self.critic = Mlp((observations, *hidden, 1), 1.0, dtype, device)
        self.log_std = torch.full((actions,), math.log(action_std), device=device)


class Normalizer:
    """Running mean and variance of observations, merged batch by batch (Chan et al. 1979).

    limit: at which normalised observations are clipped, one or (O,).
    """

    def __init__(self, size: int, limit: Floats | float = OBSERVATION_CLIP) -> None:
        self.limit = limit
        self.count = 0.0
        self.mean: NDArray[np.float64] = np.zeros(size)
        self.squares: NDArray[np.float64] = np.zeros(size)

    def update(self, batch: NDArray[np.floating]) -> None:
        """Merge a batch (N, O)."""
        rows = batch.astype(np.float64)
        mean, count = rows.mean(axis=0), float(len(rows))
        shift, total = mean - self.mean, self.count + count
        rows -= mean
        self.squares += np.einsum("no,no->o", rows, rows) + shift**2 * self.count * count / total
        self.mean = self.mean + shift * count / total
        self.count = total

    @property
    def scale(self) -> NDArray[np.float64]:
        """Standard deviation, at least 1e-3 so that constant entries do not blow up."""
        if self.count < 2:
            return np.ones_like(self.mean)
        return np.maximum(np.sqrt(self.squares / self.count), 1e-3)

    def begin_from(self, policy: Policy) -> None:
        """Start with the statistics of a policy, which then hardly change."""
        self.count = START_COUNT
        self.mean = policy.mean.astype(np.float64)
        self.squares = policy.scale.astype(np.float64) ** 2 * self.count

    def apply(self, observations: NDArray[np.floating]) -> Tensor:
        """Observations normalised and clipped as in the stored policy, float32."""
        mean, scale = self.mean.astype(np.float32), self.scale.astype(np.float32)
        return torch.from_numpy(normalized(observations, mean, scale, self.limit))


def export(net: ActorCritic, normalizer: Normalizer, *, critic: bool = False) -> Policy:
    """The actor with its normaliser, and the critic on demand."""
    mean, scale = normalizer.mean.astype(np.float32), normalizer.scale.astype(np.float32)
    value = copies(net.critic.layers) if critic else ()
    return Policy(copies(net.actor.layers), mean, scale, critic=value, limit=normalizer.limit)


def copies(layers: Sequence[tuple[Tensor, Tensor]]) -> tuple[tuple[Floats, Floats], ...]:
    """Layers (weight, bias) as a policy has them."""
    return tuple((weight.cpu().numpy().copy(), bias.cpu().numpy().copy()) for weight, bias in layers)

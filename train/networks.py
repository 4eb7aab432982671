"""Actor and critic of the paper's Fig. 1: tanh networks; the actor's output is the mean of a Gaussian."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from kinemimic.train.policy import OBSERVATION_CLIP, Policy


def mlp(sizes: tuple[int, ...], last_gain: float) -> nn.Sequential:
    """Linear layers with tanh between, orthogonal weights; `last_gain` scales the output layer."""
    layers: list[nn.Module] = []
    for k, (a, b) in enumerate(pairwise(sizes)):
        linear = nn.Linear(a, b)
        last = k == len(sizes) - 2
        nn.init.orthogonal_(linear.weight, last_gain if last else 5 / 3)
        nn.init.zeros_(linear.bias)
        layers += [linear] if last else [linear, nn.Tanh()]
    return nn.Sequential(*layers)


class ActorCritic(nn.Module):
    """Two networks of the same hidden sizes, and the logarithm of the noise (actions,)."""

    def __init__(
        self, observations: int, actions: int, hidden: tuple[int, ...], noise: float, learn: bool
    ) -> None:
        super().__init__()
        self.actor = mlp((observations, *hidden, actions), 0.01)
        self.critic = mlp((observations, *hidden, 1), 1.0)
        self.log_noise = nn.Parameter(torch.full((actions,), math.log(noise)), requires_grad=learn)

    def value(self, observations: Tensor) -> Tensor:
        """(N,) for normalised observations (N, O)."""
        value: Tensor = self.critic(observations).squeeze(-1)
        return value


def log_density(actions: Tensor, mean: Tensor, log_noise: Tensor) -> Tensor:
    """Logarithm of the diagonal Gaussian's density, (N,)."""
    z = (actions - mean) / log_noise.exp()
    return (-0.5 * z.square() - log_noise - 0.5 * math.log(2 * math.pi)).sum(-1)


def divergence(mean_old: Tensor, log_old: Tensor, mean_new: Tensor, log_new: Tensor) -> Tensor:
    """KL(old ‖ new) of diagonal Gaussians, (N,): the paper's Eq. 6 before its mean over time steps."""
    ratio = (2 * (log_old - log_new)).exp()
    shift = ((mean_old - mean_new) / log_new.exp()).square()
    return 0.5 * (ratio + shift - 1 + 2 * (log_new - log_old)).sum(-1)


class Normalizer:
    """Running mean and variance of observations, merged batch by batch (Chan et al. 1979)."""

    def __init__(self, size: int) -> None:
        self.count = 0.0
        self.mean: NDArray[np.float64] = np.zeros(size)
        self.squares: NDArray[np.float64] = np.zeros(size)

    def update(self, batch: NDArray[np.floating]) -> None:
        """Merge a batch (N, O)."""
        rows = batch.astype(np.float64)
        mean, count = rows.mean(axis=0), float(len(rows))
        shift, total = mean - self.mean, self.count + count
        self.squares += ((rows - mean) ** 2).sum(axis=0) + shift**2 * self.count * count / total
        self.mean = self.mean + shift * count / total
        self.count = total

    @property
    def scale(self) -> NDArray[np.float64]:
        """Standard deviation, at least 1e-3 so that constant entries stay tame."""
        if self.count < 2:
            return np.ones_like(self.mean)
        return np.maximum(np.sqrt(self.squares / self.count), 1e-3)

    def apply(self, observations: NDArray[np.floating]) -> Tensor:
        """Normalised and clipped, float32, as the stored policy does it."""
        level = (observations - self.mean.astype(np.float32)) / self.scale.astype(np.float32)
        return torch.from_numpy(np.clip(level, -OBSERVATION_CLIP, OBSERVATION_CLIP).astype(np.float32))


def export(net: ActorCritic, normalizer: Normalizer) -> Policy:
    """The actor with its normaliser, for rollouts and for a file."""
    layers = tuple(
        (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy())
        for layer in net.actor
        if isinstance(layer, nn.Linear)
    )
    return Policy(layers, normalizer.mean.astype(np.float32), normalizer.scale.astype(np.float32))

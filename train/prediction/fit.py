"""Fit the networks of a predictor to the motions of a library."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.retarget.library.variants import SUBJECT as VARIANTS
from kinemimic.train.prediction.moments import (
    FUTURE,
    NOISY_PAST,
    PAST,
    changes,
    corrections,
    observed,
)
from kinemimic.train.prediction.noise import with_sensor_noise
from kinemimic.train.prediction.regression import Regression
from kinemimic.train.rollout.network import normalized
from kinemimic.train.sim.world import CONTROL_RATE

BATCH = 512
LEARNING_RATE = 1e-3  # Adam's at the start; it falls to 0 as a half cosine
# A recorded second weighs as much as this many variants: they have people's own irregularities.
RECORDED = 3.0
STILL = 0.03  # of the moments
NOW = max(PAST) + 1  # frames of a window up to the moment, and of a noisy one
NOISY_NOW = max(NOISY_PAST) + 1
_CHUNK = 8192


@dataclass(frozen=True)
class Hyperparameters:
    """hidden: units; ridge: of the linear map that training starts from; jitter: standard deviation of noise
    on the normalised observations, since live poses are less smooth than a library's."""

    hidden: tuple[int, int]
    epochs: int
    ridge: float
    jitter: float


PREDICTION = Hyperparameters((384, 192), 12, 1e-4, 0.02)
DENOISING = Hyperparameters((512, 256), 10, 1e-3, 0.0)


def usable(library: MotionLibrary, motions: NDArray[np.intp], now: int = NOW) -> NDArray[np.intp]:
    """Those of motions (M,) that are cyclic, or long enough for a moment with its past and future."""
    return motions[_room(library, motions, now) > 0.0]


def _room(library: MotionLibrary, motions: NDArray[np.intp], now: int) -> Array:
    """Seconds (M,) in which a motion has moments: all of a loop, else without their past and future."""
    entries = [library.entries[index] for index in motions]
    loops = [entry.frames / entry.rate for entry in entries]
    others = [(entry.frames - 1) / entry.rate - (now - 1 + FUTURE) / CONTROL_RATE for entry in entries]
    return np.where([entry.cyclic for entry in entries], loops, np.maximum(others, 0.0))


def windows(
    library: MotionLibrary,
    motions: NDArray[np.intp],
    count: int,
    random: np.random.Generator,
    now: int = NOW,
) -> Iterator[tuple[Array, Array]]:
    """Moments of these `usable` motions (M,), with what came before and FUTURE frames after them.

    In batches of hip centres (N, now + FUTURE, 3) and rotations (N, now + FUTURE, 20, 4); now: frames up to
    the moment.

    A moment of a recorded motion is drawn in proportion to its length; past and future lie in the motion.
    STILL of the moments stand still in their pose.
    """
    entries = [library.entries[index] for index in motions]
    seconds = _room(library, motions, now)
    first = np.array([0.0 if entry.cyclic else (now - 1) / CONTROL_RATE for entry in entries])
    recorded = np.array([entry.subject != VARIANTS for entry in entries])
    weights = np.where(recorded, RECORDED * seconds, 1.0)
    drawn = random.choice(len(motions), count, p=weights / weights.sum())
    times = first[drawn] + random.uniform(0.0, seconds[drawn])
    moving = random.random(count) >= STILL
    around = np.arange(1 - now, FUTURE + 1) / CONTROL_RATE * moving[:, None]
    for start in range(0, count, _CHUNK):
        rows = slice(start, start + _CHUNK)
        yield library.sample(motions[drawn[rows], None], times[rows, None] + around[rows])


def moments(root: Array, rotations: Array) -> tuple[Floats, Floats]:
    """What is observed (N, observations(PAST)) and what comes (N, FUTURE * CHANGES), of `windows`."""
    seen = observed(root[:, :NOW], rotations[:, :NOW], PAST)
    coming = changes(root[:, NOW:], rotations[:, NOW:], root[:, NOW - 1], rotations[:, NOW - 1])
    return seen.astype(np.float32), coming.reshape(len(coming), -1).astype(np.float32)


def noisy_moments(root: Array, rotations: Array, random: np.random.Generator) -> tuple[Floats, Floats]:
    """What is observed through noise (N, observations(NOISY_PAST)) and what restores the motion
    (N, (1 + FUTURE) * CHANGES), of `windows` with NOISY_NOW."""
    noisy_root, noisy = with_sensor_noise(root[:, :NOISY_NOW], rotations[:, :NOISY_NOW], random)
    seen = observed(noisy_root, noisy, NOISY_PAST)
    true = corrections(
        root[:, NOISY_NOW - 2 :], rotations[:, NOISY_NOW - 1 :], noisy_root[:, -1], noisy[:, -1]
    )
    return seen.astype(np.float32), true.reshape(len(true), -1).astype(np.float32)


def fit(
    seen: Floats,
    coming: Floats,
    how: Hyperparameters,
    seed: int,
    advance: Callable[[int], object] = lambda _: None,
) -> Regression:
    """A network (tanh units) beside a linear map that minimise the squared error of `coming`, each
    number in units of its standard deviation. advance: is told how many moments were used.

    Training starts from the linear map of least squares: most of the next few frames is linear.
    """
    torch.manual_seed(seed)
    mean, scale = seen.mean(axis=0), np.maximum(seen.std(axis=0), 1e-3)
    # What never changes, as an elbow's rotation about its long axis, is predicted as 0.
    size = np.maximum(coming.std(axis=0), 1e-3)
    x = torch.from_numpy(normalized(seen, mean, scale, Regression.limit))
    y = torch.from_numpy(coming / size)
    widths = (x.shape[1], *how.hidden, y.shape[1])
    layers = [torch.nn.Linear(*pair) for pair in pairwise(widths)]
    net = torch.nn.Sequential(layers[0], torch.nn.Tanh(), layers[1], torch.nn.Tanh(), layers[2])
    torch.nn.init.zeros_(layers[2].weight)
    penalty = how.ridge * len(x) * torch.eye(x.shape[1])
    linear = torch.nn.Parameter(torch.linalg.solve(x.T @ x + penalty, x.T @ y).T)
    optimizer = torch.optim.Adam([*net.parameters(), linear], LEARNING_RATE)
    steps = how.epochs * math.ceil(len(x) / BATCH)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(how.epochs):
        for rows in torch.split(torch.randperm(len(x)), BATCH):
            batch = x[rows]
            if how.jitter:
                batch = batch + how.jitter * torch.randn_like(batch)
            error = net(batch) + batch @ linear.T - y[rows]
            optimizer.zero_grad()
            error.square().mean().backward()
            optimizer.step()
            falling.step()
            advance(len(rows))
    weights = [(one.weight.detach().numpy(), one.bias.detach().numpy()) for one in layers]
    # The last layer's output in radians and metres.
    weight, bias = weights[-1]
    weights[-1] = (weight * size[:, None], bias * size)
    return Regression(tuple(weights), linear.detach().numpy() * size[:, None], mean, scale)

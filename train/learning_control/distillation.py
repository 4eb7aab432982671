"""Learn corrected actions by regression, so that a policy needs no table of corrections beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor, nn

from kinemimic.pipeline.arrays import Floats
from kinemimic.train.learning_control.corrections import (
    Corrections,
    corrected_step,
    put_back,
    steps_of_cycle,
)
from kinemimic.train.rollout.network import normalized
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch

CYCLES = 6  # that each humanoid walks for the regression
NOISE = 0.05  # standard deviation, in units of the action: it must also learn to act beside the cycle
EPOCHS, MINIBATCH, RATE = 10, 512, 3e-4
_LAST_RATE = 0.02  # share of the rate at the end


def distilled(policy: Policy, corrections: Corrections, batch: ImitationBatch, seed: int) -> Policy:
    """A policy of the same shape that acts as the policy with its corrections.

    batch: humanoids on the motion that the corrections are for.
    """
    random = np.random.default_rng(seed)
    count = batch.world.size
    batch.reset(np.arange(count), np.arange(count) / count)
    rows = []
    for _ in range(CYCLES * steps_of_cycle(batch.reference)):
        noise = NOISE * random.standard_normal((count, ACTIONS))
        rows.append(corrected_step(batch, policy, corrections, noise))
        put_back(batch, batch.fallen())
    observations, actions = (np.concatenate(column).astype(np.float32) for column in zip(*rows, strict=True))
    return fitted(policy, observations, actions, seed)


def fitted(
    policy: Policy, observations: Floats, actions: Floats, seed: int, minibatch: int = MINIBATCH
) -> Policy:
    """The policy, trained on to give the actions (N, 42) for raw observations (N, O)."""
    y = torch.from_numpy(actions)
    scale = torch.from_numpy(ACTION_SCALE.astype(np.float32))
    layers = [
        (nn.Parameter(torch.tensor(weight)), nn.Parameter(torch.tensor(bias)))
        for weight, bias in policy.layers
    ]
    optimizer = torch.optim.Adam([one for layer in layers for one in layer], RATE)
    steps = EPOCHS * max(1, len(y) // minibatch)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda k: max(_LAST_RATE, 1.0 - k / steps))
    random = torch.Generator().manual_seed(seed)
    with torch.enable_grad():
        for _ in range(EPOCHS):
            order = torch.randperm(len(y), generator=random)
            for first in range(0, len(y), minibatch):
                rows = order[first : first + minibatch]
                # Here, not all at once: a copy of them may be gigabytes.
                seen = normalized(observations[rows.numpy()], policy.mean, policy.scale, policy.limit)
                error = _forward(layers, torch.from_numpy(seen)) - y[rows]
                loss = (scale * error).square().sum(dim=1).mean()
                optimizer.zero_grad()
                torch.autograd.backward(loss)
                optimizer.step()
                schedule.step()
    learned = tuple((weight.detach().numpy(), bias.detach().numpy()) for weight, bias in layers)
    return replace(policy, layers=learned)


def _forward(layers: Sequence[tuple[Tensor, Tensor]], x: Tensor) -> Tensor:
    for weight, bias in layers[:-1]:
        x = torch.tanh(torch.addmm(bias, x, weight.t()))
    weight, bias = layers[-1]
    return torch.addmm(bias, x, weight.t())

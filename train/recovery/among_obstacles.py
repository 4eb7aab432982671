"""Humanoids that walk among obstacles, for lessons and their test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.train.recovery.pushes import Acting
from kinemimic.train.rollout.rollout import roll_out
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.domain_randomization import RandomizationSample
from kinemimic.train.task.env import ImitationBatch

_TEST_STEPS = 8 * CONTROL_RATE


def begin_among_obstacles(batch: ImitationBatch, random: np.random.Generator) -> Array:
    """Start every humanoid at any phase, with its own obstacles ahead; returns observations (N, O)."""
    count = batch.world.size
    seeds = random.integers(1, np.iinfo(np.uint64).max, count, dtype=np.uint64)
    calm = replace(RandomizationSample.nominal(count), clutter=seeds)
    batch.reset(np.arange(count), random.random(count), calm)
    return batch.observe()


def survived_among_obstacles(
    batch: ImitationBatch, policy: Acting, random: np.random.Generator
) -> NDArray[np.bool_]:
    """(N,) whether the policy walks among obstacles for 8 s without a fall."""
    begin_among_obstacles(batch, random)
    fallen_at = roll_out(batch, policy.act, _TEST_STEPS, lambda *_: None)
    return np.asarray(fallen_at >= _TEST_STEPS)

"""Lessons by which a tracker learns corrections: observations, and its actions with the corrections."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.learning_control.corrections import Corrections, corrected_step
from kinemimic.train.learning_control.distillation import NOISE
from kinemimic.train.reference.reference_library import FollowedReference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.tracker.sampler import TrackerSampler

ENVIRONMENTS = 256


def collect_lessons(
    tables: Path,
    corrections: Array,
    weights: Array,
    policy: Policy,
    env: EnvConfig,
    engine: str,
    steps: int,
    seed: int,
    proceed: Callable[[int], object],
) -> tuple[Floats, Floats]:
    """Observations (N, O) and actions (N, 42) of `steps` control steps of ENVIRONMENTS humanoids.

    The humanoids act with the corrections and with noise, and start with the domain randomization of a
    training, so that the tracker also learns to act beside its reference.

    tables: folder of the tables of M motions; corrections: (M, P, 42), zeros for a motion without any;
    weights: (M,) probabilities of the motions; env: of the training; proceed: called with the samples.
    """
    seeds = np.random.SeedSequence(seed).spawn(ENVIRONMENTS + 1)
    random = np.random.default_rng(seeds[-1])
    sampler = TrackerSampler(tables, env, seeds[:-1], engine)
    sampler.set_weights(weights)
    batch, everyone = sampler.batch, np.arange(ENVIRONMENTS)
    reference = batch.reference
    assert isinstance(reference, FollowedReference)  # noqa: S101 (narrows the type)
    sampler.restart(everyone, 1.0)
    observations, actions = [], []
    for _ in range(steps):
        of_each = Corrections(corrections[reference.motions])
        seen, done = corrected_step(
            batch, policy, of_each, NOISE * random.standard_normal((len(everyone), ACTIONS))
        )
        observations.append(seen.astype(np.float32))
        actions.append(done.astype(np.float32))
        ended = batch.terminated() | (batch.ages >= env.steps)
        ended |= ~np.asarray(reference.cyclic) & (batch.phases >= 1.0)
        if ended.any():
            sampler.restart(np.flatnonzero(ended), 1.0)
        proceed(len(everyone))
    batch.world.close()
    return np.concatenate(observations), np.concatenate(actions)

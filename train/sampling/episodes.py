"""The beginning of episodes: random start phase, domain randomization and events of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sampling.push_levels import PushLevels
from kinemimic.train.task.domain_randomization import RandomizationSample, draw
from kinemimic.train.task.env import ImitationBatch

WORD = (1 << 64) - 1  # the largest of 64 bits


def begin_episodes(
    batch: ImitationBatch,
    indices: NDArray[np.intp],
    randoms: Sequence[np.random.Generator],
    strength: float,
    phases: Array | None = None,
    displaced: NDArray[np.bool_] | None = None,
    push_levels: PushLevels | None = None,
) -> None:
    """Begin new episodes in the environments (N,) of a batch.

    randoms: of these environments, one each; none affects another environment; strength: 0 to 1, of the
    domain randomization; phases: (N,) start phases, drawn if None; displaced: (N,) whether an episode may
    start beside its reference, all if None; push_levels: of all environments, for pushes that adapt.
    """
    config = batch.config
    if phases is None:
        phases = np.array([start_phase(config, random) for random in randoms])
    drawn = [draw(config.domain_randomization, strength, random) for random in randoms]
    seeds = None
    if config.scenario is not None:
        seeds = np.array([random.integers(WORD, dtype=np.uint64) for random in randoms])
    sample = RandomizationSample.concatenated(drawn)
    if displaced is not None:
        sample = replace(sample, displacement=sample.displacement * displaced[:, None])
    if push_levels is not None:
        travel = batch.reference.of(indices).poses(phases).root_linear[:, :2]
        sample = push_levels.applied(sample, indices, travel, config.domain_randomization.push[1])
    batch.reset(indices, phases, sample, seeds)


def start_phase(config: EnvConfig, random: np.random.Generator) -> float:
    """Phase at which an episode begins."""
    if not config.start_anywhere:
        return 0.0
    return random.random() if config.scenario is None else float(config.scenario.phase.draw(random)[0])

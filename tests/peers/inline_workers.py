"""Training samplers without processes: they run one after the other in this process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.sampling.pool import OpenPool, OpenSampler, answer
from kinemimic.train.sampling.workers import Workers


class InlinePool:
    def __init__(
        self, open_sampler: OpenSampler, seeds: Sequence[list[np.random.SeedSequence]], engine: str
    ) -> None:
        self._samplers = [open_sampler(own, engine) for own in seeds]

    def ask(self, request: str, shared: tuple[Any, ...], shares: Sequence[tuple[Any, ...]]) -> list[Any]:
        return [
            answer(sampler, request, (*shared, *share))
            for sampler, share in zip(self._samplers, shares, strict=True)
        ]

    def end(self) -> None:
        pass


class InlineWorkers(Workers):
    def __init__(
        self,
        motion: Motion,
        config: EnvConfig,
        environments: int,
        seed: int,
        count: int,
        engine: str,
        open_pool: OpenPool = InlinePool,
    ) -> None:
        super().__init__(motion, config, environments, seed, count, engine, InlinePool)

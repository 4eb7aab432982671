"""Training workers without processes: their samplers run one after the other in this process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig
from kinemimic.train.rollout.sampler import Sampler
from kinemimic.train.rollout.workers import Workers, answer


class InlineWorkers(Workers):
    def __init__(
        self, motion: Motion, config: EnvConfig, environments: int, seed: int, count: int, engine: str
    ) -> None:
        self.seconds = {}
        self._count = count
        self._workers = []
        seeds = np.random.SeedSequence(seed).spawn(environments)
        self._samplers = [Sampler(motion, config, seeds[k::count], engine) for k in range(count)]

    def _ask(self, request: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        return [
            answer(sampler, request, given) for sampler, given in zip(self._samplers, arguments, strict=True)
        ]

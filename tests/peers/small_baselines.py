"""Settings of baselines whose trainings take a second."""

from __future__ import annotations

from dataclasses import replace

from msgspec import structs

from kinemimic.train.config.baseline_config import OffPolicy, StablePpo
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS

# Short episodes, so that many end by time and by falls.
ENV = replace(PRESETS["default"].env, episode=11)


ROUND = 4 * 16
BUDGET = 6 * ROUND


def small(name: str) -> TrainConfig:
    # With rewards that change all along.
    scales = {"pose": ((0, 8.0), (BUDGET, 64.0))}
    config = replace(
        PRESETS[name], env=ENV, num_envs=4, horizon=16, hidden=(32, 16), scales=scales, budget=BUDGET
    )
    if isinstance(config.baseline, OffPolicy):
        # Its memory is full after four rounds and a half.
        return replace(
            config, baseline=structs.replace(config.baseline, batch=16, warm_up=ROUND, buffer=4 * 72)
        )
    if isinstance(config.baseline, StablePpo):
        return replace(config, baseline=structs.replace(config.baseline, batch=32))
    return config

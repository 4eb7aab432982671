"""Settings of trainings that take a second."""

from __future__ import annotations

from dataclasses import replace

from kinemimic.train.config.presets import PRESETS

SMALL = replace(PRESETS["default"], num_envs=4, horizon=16, minibatch=32, epochs=2, hidden=(32, 16))
ROUND = SMALL.batch  # samples

"""Policies trained among obstacles, which correct nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import observation_size


def config_among_obstacles(**task: Any) -> TrainConfig:
    """Of a small policy; task: what differs in its environment."""
    small = replace(PRESETS["default"], hidden=(4,))
    env = {"scenario": find_scenario("several-obstacles"), **task}
    return replace(small, env=replace(small.env, **env))


def write_teacher(
    path: Path, motion: Motion, *, leans: float = 0.0, samples: int = 7, config: TrainConfig | None = None
) -> Path:
    """A policy whose actions are all `leans`, at `path` (.safetensors), with its record beside it."""
    config = config or config_among_obstacles()
    size = observation_size(config.env)
    layers = (
        (np.zeros((4, size), np.float32), np.zeros(4, np.float32)),
        (np.zeros((ACTIONS, 4), np.float32), np.full(ACTIONS, leans, np.float32)),
    )
    record = {
        "preset": config.preset, "samples": samples, "seed": 0, "engine": "native",
        "config": config.to_json(), "mirrored": True, "simulated": False, "finished": True,
        "provenance": {"inputs": {"motion": motion.identity}},
    }  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    Policy(layers, np.zeros(size, np.float32), np.ones(size, np.float32)).save(path, record)
    return path

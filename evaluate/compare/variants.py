"""Variants of a comparison: presets, an ablation of `default`, and a search around each baseline.

An ablation variant changes one setting of `default`. A search variant changes one or two settings of a
baseline's preset: those that an expert would try first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from msgspec import structs

from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS

# Fields of TrainConfig to change; under "env" of its EnvConfig, under "baseline" of its baseline settings.
Changes = Mapping[str, Any]

ABLATION: dict[str, Changes] = {
    "no-residual": {"env": {"residual": False}},
    "no-velocity-ff": {"env": {"velocity_feedforward": False}},
    "no-torque-ff": {"env": {"torque_feedforward": False}},
    "no-mirror": {"env": {"mirror": False}},
    "start-at-0": {"env": {"start_anywhere": False}},
    # The paper's rule instead of the adapted rate, with the target of the preset `paper`.
    "kl-penalty": {"kl_penalty": True, "adapt_rate": False, "kl_target": 0.01},
    "no-clip": {"clip": None},
    "small-net": {"hidden": (128, 64)},
    "large-net": {"hidden": (1024, 512)},
    "preview-1-4-12": {"env": {"preview": (1, 4, 12)}},
    "discount-0.99": {"discount": 0.99},
}

SEARCH: dict[str, dict[str, Changes]] = {
    "ddpg": {
        "actor-3e-5": {"baseline": {"actor_rate": 3e-5}},
        "actor-1e-5": {"baseline": {"actor_rate": 1e-5}},
        "critic-3e-4": {"baseline": {"critic_rate": 3e-4}},
        "tau-0.001": {"baseline": {"tau": 0.001}},
        "tau-0.02": {"baseline": {"tau": 0.02}},
        "updates-0.5": {"baseline": {"updates_per_sample": 0.5}},
        "batch-1024": {"baseline": {"batch": 1024, "updates_per_sample": 0.03125}},
        "noise-0.08": {"action_std": ((0, 0.08), (400_000, 0.04), (1_000_000, 0.02))},
        "every-8-steps": {"baseline": {"train_every": 8}},
        "tanh": {"baseline": {"activation": "tanh"}},
    },
    "td3": {
        "actor-3e-5": {"baseline": {"actor_rate": 3e-5}},
        "actor-3e-4": {"baseline": {"actor_rate": 3e-4}},
        "critic-3e-4": {"baseline": {"critic_rate": 3e-4}},
        "tau-0.001": {"baseline": {"tau": 0.001}},
        "tau-0.02": {"baseline": {"tau": 0.02}},
        "updates-0.5": {"baseline": {"updates_per_sample": 0.5}},
        "batch-1024": {"baseline": {"batch": 1024, "updates_per_sample": 0.03125}},
        "noise-0.08": {"action_std": ((0, 0.08), (400_000, 0.04), (1_000_000, 0.02))},
        "target-noise-0.1": {"baseline": {"target_noise": 0.1}},
        "every-8-steps": {"baseline": {"train_every": 8}},
    },
    "sac": {
        "actor-1e-4": {"baseline": {"actor_rate": 1e-4}},
        "critic-1e-3": {"baseline": {"critic_rate": 1e-3}},
        "tau-0.02": {"baseline": {"tau": 0.02}},
        "updates-0.5": {"baseline": {"updates_per_sample": 0.5}},
        "batch-1024": {"baseline": {"batch": 1024, "updates_per_sample": 0.03125}},
        "entropy-0.001": {"baseline": {"entropy": 0.001}},
        "entropy-0.1": {"baseline": {"entropy": 0.1}},
        "target--2": {"baseline": {"target": -2.0}},
        "target-0": {"baseline": {"target": 0.0}},
        "every-8-steps": {"baseline": {"train_every": 8}},
    },
    "a2c": {
        "actor-1e-4": {"baseline": {"actor_rate": 1e-4}},
        "actor-1e-5": {"baseline": {"actor_rate": 1e-5}},
        "critic-3e-4": {"baseline": {"critic_rate": 3e-4}},
        "steps-8": {"baseline": {"n_steps": 8}},
        "steps-32": {"baseline": {"n_steps": 32}},
        "envs-64": {"num_envs": 64, "horizon": 64},
        "rms-prop": {"baseline": {"use_rms_prop": True}},
        "raw-advantage": {"baseline": {"normalize_advantage": False}},
        "learn-noise": {"learn_action_std": True},
        "relu": {"baseline": {"activation": "relu"}},
    },
    "sb3-ppo": {
        "actor-2e-5": {"baseline": {"actor_rate": 2e-5}},
        "actor-1e-4": {"baseline": {"actor_rate": 1e-4}},
        "critic-3e-4": {"baseline": {"critic_rate": 3e-4}},
        "clip-0.1": {"baseline": {"clip": 0.1}},
        "epochs-16": {"baseline": {"epochs": 16}},
        "batch-2048": {"baseline": {"batch": 2048}},
        "grad-norm-0.5": {"baseline": {"max_grad_norm": 0.5}},
        "learn-noise": {"learn_action_std": True},
        "tanh": {"baseline": {"activation": "tanh"}},
    },
}


def ablation() -> dict[str, TrainConfig]:
    """`default` and its ABLATION variants; `preset` is set to the variant's name."""
    base = PRESETS["default"]
    return {"default": base, **{name: _changed(base, changes, name) for name, changes in ABLATION.items()}}


def search(baseline: str) -> dict[str, TrainConfig]:
    """A baseline's preset and its SEARCH variants, named BASELINE-VARIANT; `preset` is set to that name."""
    base = PRESETS[baseline]
    names = {f"{baseline}-{name}": changes for name, changes in SEARCH[baseline].items()}
    return {baseline: base, **{name: _changed(base, changes, name) for name, changes in names.items()}}


def _changed(base: TrainConfig, changes: Changes, name: str) -> TrainConfig:
    env = replace(base.env, **changes.get("env", {}))
    baseline = structs.replace(base.baseline, **changes.get("baseline", {})) if base.baseline else None
    return replace(base, **{**changes, "env": env, "baseline": baseline}, preset=name)

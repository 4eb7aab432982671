"""The variants of a study: presets as they are, and an ablation, one change each against `default`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kinemimic.train.config import PRESETS, TrainConfig

# What is changed of TrainConfig; below "env", of its EnvConfig.
ABLATION: dict[str, dict[str, Any]] = {
    "no-residual": {"env": {"residual": False}},
    "no-velocity-ff": {"env": {"velocity_feedforward": False}},
    "no-torque-ff": {"env": {"torque_feedforward": False}},
    "no-mirror": {"env": {"mirror": False}},
    "start-at-0": {"env": {"start_anywhere": False}},
    # The paper's rule in place of the adapted rate, with the target of the preset `paper`.
    "kl-penalty": {"kl_penalty": True, "adapt_rate": False, "kl_target": 0.01},
    "no-clip": {"clip": None},
    "small-net": {"hidden": (128, 64)},
    "large-net": {"hidden": (1024, 512)},
    "preview-1-4-12": {"env": {"preview": (1, 4, 12)}},
    "discount-0.99": {"discount": 0.99},
}


def ablation() -> dict[str, TrainConfig]:
    """`default`, and `default` with each change of ABLATION, which its `preset` then names."""
    base = PRESETS["default"]
    changed = {}
    for name, changes in ABLATION.items():
        env = replace(base.env, **changes.get("env", {}))
        changed[name] = replace(base, **{**changes, "env": env}, preset=name)
    return {"default": base, **changed}

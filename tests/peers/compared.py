"""A folder as `compare` leaves it, made without training."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from kinemimic.pipeline.store import write_text
from kinemimic.retarget.export_json import motion_from_json, motion_to_json
from kinemimic.retarget.motion import Motion
from kinemimic.train.config import PRESETS
from peers.constant import constant

BUDGET = 131_072


def write_comparison(
    folder: Path, motions: Mapping[str, Motion], *, returns: Sequence[float], variants: Sequence[str]
) -> Path:
    """A seed for each of `returns`; seed k's policy corrects every joint by k hundredths."""
    cells, curves, tasks = [], [], {}
    for task in ("walk", "run", "walk@several-obstacles"):
        write_text(folder / task / "motion.json", motion_to_json(motions[task.partition("@")[0]]))
        tasks[task] = {"identity": motion_from_json(folder / task / "motion.json").identity}
        for variant in variants:
            for seed, value in enumerate(returns):
                config = replace(PRESETS[variant], seed=seed)
                policy = replace(constant(0.01 * seed), activation=config.activation, bound=config.bound)
                record = {"config": config.to_json(), "mirrored": False, "samples": BUDGET}
                record |= {"provenance": {"inputs": {"motion": tasks[task]["identity"]}}}
                path = folder / task / variant / f"seed{seed}" / f"policy-{BUDGET}.safetensors"
                policy.save(path, record)
                cells.append({
                    "task": task, "variant": variant, "seed": seed, "budget": BUDGET, "return": value,
                    "converged_samples": 65_536, "frames": 600, "samples": BUDGET, "seconds": 60.0,
                })  # fmt: skip
            rows = [
                {"samples": n, "mean": mean, "low": 0.9 * mean, "high": 1.1 * mean, "n": len(returns)}
                for n, mean in ((65_536, 0.2), (BUDGET, 0.1))
            ]
            curves.append({"task": task, "variant": variant, "reward": rows, "critic_loss": rows})
    content = {"schema": 1, "tasks": tasks, "summary": [], "curves": curves, "cells": cells, "failed": {}}
    write_text(folder / "compare.json", json.dumps(content))
    return folder

"""A folder as `compare` leaves it, made without training."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kinemimic.evaluate.compare.task import scenario_identity
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.scenario.scenario_file import find_scenario
from peers.constant import constant

BUDGET = 131_072
KEPT = 65_536  # after which the best trial was


def write_comparison(
    folder: Path,
    motions: Mapping[str, Motion],
    *,
    returns: Sequence[float],
    variants: Sequence[str],
    on: Sequence[str] = ("walk", "run", "walk@several-obstacles"),
) -> Path:
    """A seed for each of `returns`; seed k's policy corrects every joint by k hundredths."""
    cells: list[dict[str, Any]] = []
    curves: list[dict[str, Any]] = []
    tasks: dict[str, dict[str, Any]] = {}
    for task in on:
        write_text(folder / task / "motion.json", motion_to_json(motions[task.partition("@")[0]]))
        named = task.partition("@")[2]
        tasks[task] = {
            "identity": read_motion_json(folder / task / "motion.json").identity,
            "scenario_identity": scenario_identity(find_scenario(named)) if named else None,
        }
        for variant in variants:
            for seed, value in enumerate(returns):
                config = replace(PRESETS[variant], seed=seed)
                policy = replace(constant(0.01 * seed), activation=config.activation, bound=config.bound)
                record = {"config": config.to_json(), "mirrored": False, "samples": BUDGET}
                record |= {"provenance": {"inputs": {"motion": tasks[task]["identity"]}}}
                record |= {"best": {"samples": KEPT}}
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
    settings = {
        "variants": {name: PRESETS[name].to_json() for name in variants},
        "budgets": {name: [BUDGET] for name in variants},
        "seeds": len(returns),
        "engine": "native",
    }
    inputs = {name: about["identity"] for name, about in tasks.items()}
    made = {"inputs": inputs, "config": settings, "versions": {"torch": "2"}}
    content = {
        "schema": 1, "tasks": tasks, "provenance": made,
        "summary": [], "curves": curves, "cells": cells, "failed": {},
    }  # fmt: skip
    write_text(folder / "compare.json", json.dumps(content))
    return folder

"""A folder of policies as datasets/policies is, of tiny ones that never correct anything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kinemimic.evaluate.policies.shipped import SCORES, motion_summary
from kinemimic.pipeline.files.store import file_hash, write_json, write_text
from kinemimic.retarget.formats.motion_json import MOTION, motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.presets import preset
from kinemimic.train.rollout.policy import POLICY
from peers.constant import constant

RECIPES = """
schema = 2
[[policy]]
name = "walk"
description = "a made-up walk"
preset = "default"
budget = 5
seed = 3
[[policy]]
name = "run"
description = "a run"
stock = "run"
preset = "default"
budget = 5
seed = 3
[[policy]]
name = "kinect_walk"
description = "a recorded walk"
recording = "kinect1_bernstein_skl/r2.skl"
preset = "default"
budget = 5
seed = 3
"""


def write_run(folder: Path, motion: Motion, *, seed: int = 3, budget: int = 5, bias: float = 0.0) -> Path:
    """A run folder after `evaluate`, but for its playback."""
    write_text(folder / MOTION, motion_to_json(motion))
    identity = read_motion_json(folder / MOTION).identity
    idle = constant(bias)
    config = preset("default", seed=seed, budget=budget).to_json()
    record = {"preset": "default", "engine": "native", "samples": budget, "seconds": 1.0, "seed": seed}
    made_by = {"inputs": {"motion": identity}}
    idle.save(
        folder / POLICY,
        record
        | {"config": config, "provenance": made_by, "imitates": motion_summary(motion), "mirrored": True},
    )
    scores: dict[str, Any] = {
        # From phase 0 it does worse than in the median: a list must show the latter.
        "survival": {"frames": 90, "frames_median": 600.0, "of": 600, "phases": 12, "phases_of": 13},
        "fit": {
            "knee": {"r2": 0.5},
            "hip": {"r2": 0.4},
            "phases": {
                joint: {"r2": {"median": r2}, "r2_upright": {"median": r2}, "rmse_deg": {"median": 2.0}}
                for joint, r2 in (("knee", 0.987), ("hip", 0.976))
            },
        },
        "root": {
            "speed_ratio": 0.6,
            "reference_advance_m": 18.0,
            "phases": {"speed_ratio": {"median": 0.99}, "path_error_m": {"median": 0.1}},
        },
        "train": {"samples": budget, "seed": seed},
        "provenance": {"inputs": {"motion": identity, "policy": file_hash(folder / POLICY)}},
    }
    write_json(folder / SCORES, scores)
    return folder

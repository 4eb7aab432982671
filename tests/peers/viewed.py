"""A run folder to be viewed: a motion, a rollout of three seconds, and scores."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

FRAMES = 90
FIT = {"r2": {"median": 0.96}, "r2_upright": {"median": 0.96}, "rmse_deg": {"median": 3.0}}
SCORES = {
    "survival": {"frames": 90, "frames_median": 90.0, "of": 90, "phases": 3, "phases_of": 3},
    "fit": {"knee": {"r2": 0.96125}, "hip": {}, "phases": {"knee": FIT, "hip": FIT}},
    "root": {"phases": {"speed_ratio": None, "path_error_m": None}, "reference_advance_m": 3.0},
    "train": {},
}


def fill(run: Path, walk: Motion, trajectory: Trajectory) -> Path:
    run.mkdir(exist_ok=True)
    (run / "motion.json").write_text(motion_to_json(walk))
    identity = read_motion_json(run / "motion.json").identity
    replace(trajectory, motion=identity).save(run / "trajectory.npz")
    return run


def write_scores(run: Path) -> None:
    """scores.json of the motion beside it."""
    inputs = {"motion": read_motion_json(run / "motion.json").identity, "policy": ""}
    (run / "scores.json").write_text(json.dumps(SCORES | {"provenance": {"inputs": inputs}}))


def loaded(run: Path) -> Trajectory:
    return Trajectory.load(run / "trajectory.npz", read_motion_json(run / "motion.json"))

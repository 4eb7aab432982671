"""Recordings as files: a good one, and a damaged one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from samples.motion import walk

from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.writers.skl import write_skl


def write_walk(path: Path, frames: int = 150) -> Path:
    """A `.skl` of the known walk."""
    motion = walk(frames)
    path.parent.mkdir(parents=True, exist_ok=True)
    states = np.full(motion.joints.shape[:2], TRACKED, dtype=np.uint8)
    times = np.round(1000.0 * motion.times).astype(np.int64) + 5000
    write_skl(path, times, motion.joints, states, np.array([0.0, 1.0, 0.0, 0.9]))
    return path


def write_damaged(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("HIERARCHY\nROOT hips\n{\n")
    return path

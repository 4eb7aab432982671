"""Captures of a known walk, as files of a real format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.motion import walk

from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.writers.skl import write_skl

Writer = Callable[..., Path]


@pytest.fixture
def walking(tmp_path: Path) -> Writer:
    """Writes a `.skl` of the known walk: 150 frames, about four strides."""

    def write(name: str = "walk.skl", frames: int = 150) -> Path:
        motion = walk(frames)
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_skl(
            path,
            np.round(1000.0 * motion.times).astype(np.int64) + 5000,
            motion.joints,
            np.full(motion.joints.shape[:2], TRACKED, dtype=np.uint8),
            np.array([0.0, 1.0, 0.0, 0.9]),
        )
        return path

    return write

"""A capture to be exported, and the exported files by motion and format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from samples.motion import rigid_walk, seen_clip

from kinemimic.pipeline.kinematics.clip import Clip

FRAMES = 90


def captured() -> Clip:
    """Two passes of 30 and 60 frames, seen by a sensor at uneven times."""
    shown = rigid_walk(FRAMES, 30.0)
    steps = np.tile([0.032, 0.033, 0.035], FRAMES // 3)
    return replace(
        seen_clip(shown.joints, 50.0 + np.cumsum(steps)),
        passes=np.repeat([0, 1], [30, 60]).astype(np.int32),
        provenance={"source": "walk.skl", "simulated": True},
    )


def of(files: list[dict[str, object]], what: str, form: str) -> Path:
    return next(Path(str(r["path"])) for r in files if (r["what"], r["format"]) == (what, form))

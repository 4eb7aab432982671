"""What earlier stages write beside a motion, of which a report shows sections."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kinemimic.pipeline.files.store import write_json

GIMBAL: dict[str, Any] = {
    "frames": 50,
    "flag_within_deg": 5.0,
    "flip_beyond_deg": 45.0,
    "joints": [
        {
            "joint": "RightArm",
            "order": "YZX",
            "lock_at_deg": [-90, 90],
            "nearest_deg": 0.25,
            "nearest_frame": 12,
            "flagged_frames": [[10, 14], [30, 30]],
            "flips": [12],
        }
    ],
}
ANKLE = {
    "tracked": 0.9,
    "inferred": 0.08,
    "missing": 0.02,
    "filled": 0.02,
    "bone_m": None,
    "bone_cv": None,
}
QUALITY: dict[str, Any] = {
    "schema": 2,
    "source": "walk.bvh",
    "format": "BVH",
    "frames": 50,
    "frames_in_passes": 48,
    "complete_frames": 40,
    "clock": {"rate_hz": 30.0, "step_ms": 33.3, "jitter_ms": 1.5, "longest_step_ms": 40.0},
    "passes": [
        {
            "pass": 0,
            "first_frame": 0,
            "last_frame": 47,
            "start": 0.0,
            "end": 1.6,
            "complete_frames": 40,
        }
    ],
    "passes_discarded": 0,
    "sidecar_files": {},
    "simulated": False,
    "units": {"length": "cm", "rule": "given"},
    "defects": [],
    "events": [],
    "processing": [],
    "notes": ["a <note>"],
    "joints": {"ankle_left": ANKLE},
}
GAIT: dict[str, Any] = {
    "kind": "walk",
    "cyclic": True,
    "period_s": 1.2,
    "strides_used": 7.3,
    "range_deg": {f"{joint}_{side}": [1.0, 60.0] for joint in ("knee", "hip") for side in ("left", "right")},
    "balance": {"outside_before_m": 0.172, "outside_m": 0.049, "displacement_m": 0.036},
    "warnings": ["short"],
}


def write_sections(run: Path) -> None:
    """gimbal.json, quality.json and gait.json in a run folder."""
    for name, content in (("gimbal", GIMBAL), ("quality", QUALITY), ("gait", GAIT)):
        write_json(run / f"{name}.json", content)

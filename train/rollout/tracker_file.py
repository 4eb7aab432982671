"""Trackers by name or folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.train.rollout.policy import POLICY, Policy, is_tracker

TRACKERS = DATASETS / "policies"


def tracker_path(name: str, shipped: Path = TRACKERS) -> Path:
    """policy.safetensors of a shipped tracker, or of a run folder; KinemimicError if there is none."""
    for folder in (shipped / name, Path(name)):
        if (path := folder / POLICY).is_file():
            return path
    raise KinemimicError(f"expected a tracker (tracker), or a run folder with one, found {name!r}")


def load_tracker(path: Path) -> tuple[Policy, dict[str, Any]]:
    """Policy and record; KinemimicError for the policy of one motion."""
    policy, record = Policy.load(path)
    if not is_tracker(record):
        raise KinemimicError(
            f"{path}: expected a tracker, which performs any motion, found a policy of one motion"
        )
    return policy, record

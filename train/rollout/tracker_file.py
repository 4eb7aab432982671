"""Trackers by name or folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.train.rollout.policy import POLICY, Policy, is_tracker, read_record

TRACKERS = DATASETS / "policies"


def tracker_path(name: str, shipped: Path = TRACKERS) -> Path:
    """policy.safetensors of a shipped tracker, or of a run folder; KinemimicError if there is none."""
    for folder in (shipped / name, Path(name)):
        if (path := folder / POLICY).is_file():
            return path
    raise KinemimicError(f"expected a tracker ({_known(shipped)}), or a run folder with one, found {name!r}")


def load_tracker(path: Path) -> tuple[Policy, dict[str, Any]]:
    """Policy and record; KinemimicError for the policy of one motion."""
    policy, record = Policy.load(path)
    if not is_tracker(record):
        shipped = path.is_relative_to(TRACKERS)
        raise KinemimicError(
            f"{path.parent.name if shipped else path}: expected a tracker, which performs any motion "
            f"({_known(TRACKERS)}, or a run folder with one), found a policy of one motion"
        )
    return policy, record


def _of_any_motion(record: Mapping[str, Any]) -> bool:
    """Whether a policy was trained on a library; one that was trained further on a motion has its inputs."""
    return is_tracker(record) and "motion" not in record["provenance"].get("inputs", {})


def _known(shipped: Path) -> str:
    """The names of the trackers in a folder."""
    names = [
        path.parent.name
        for path in sorted(shipped.glob(f"*/{POLICY}"))
        if _of_any_motion(read_record(path.with_suffix(".json")))
    ]
    return ", ".join(names) or "none ships with this version"

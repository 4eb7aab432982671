"""The row of a capture: its description, its outcome, and the numbers that its stages wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from kinemimic.evaluate.batch.task import CaptureTask, Row
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.inspect.file_report import REFUSED, without_path

ACCEPTED, FAILED, GATE = "accepted", "failed", "gate"


def empty_row(task: CaptureTask, status: str, reason: str) -> Row:
    """The row of a capture without results: all keys, with these values."""
    for place in (task.capture, task.folder):
        reason = without_path(place, reason)
    return {
        "file": str(task.capture),
        "folder": str(task.folder),
        "name": task.name,
        "sha256": None,
        "sidecar_files": [],
        "format": None,
        "sensor": None,
        "simulated": None,
        "subject": None,
        "licence": None,
        "frames": None,
        "rate_hz": None,
        "passes": None,
        "complete": None,
        "defects": [],
        "status": status,
        "stage": None,
        "kind": None,
        "cyclic": None,
        "strides_used": None,
        "strides_found": None,
        "period_s": None,
        "speed_m_s": None,
        "path": None,
        "path_disagreement": None,
        "findings": [],
        "reason": reason or None,
        "verdict": None,
        "upright": None,
        "knee_r2": None,
        "hip_r2": None,
        "knee_rmse_deg": None,
        "hip_rmse_deg": None,
        "mpjpe_mm": None,
        "unperformed": None,
        "seconds": None,
    }


def capture_columns(folder: Path) -> Row:
    """What `ingest` says about the capture; empty before it has run.

    subject, licence: of NAME.provenance.json beside the capture, if it says so.
    """
    clip = folder / "clip.parquet"
    if not clip.exists():
        return {}
    facts = pq.read_schema(clip).metadata
    quality = read_json(folder / "quality.json")
    note = json.loads(facts[b"kinemimic"])["provenance"]
    return {
        "format": facts[b"kinemimic.format"].decode(),
        "sensor": facts[b"kinemimic.sensor"].decode(),
        "simulated": json.loads(facts[b"kinemimic.simulated"]),
        "subject": _word(note.get("subject")),
        "licence": _word(note.get("licence", note.get("license"))),
        "frames": quality["frames"],
        "rate_hz": quality["clock"]["rate_hz"],
        "passes": len(quality["passes"]),
        "complete": round(quality["complete_frames"] / max(quality["frames"], 1), 4),
        "defects": sorted({f"{one['rule']} ({one['action']})" for one in quality["defects"]}),
    }


def motion_columns(gait: Mapping[str, Any]) -> Row:
    """What gait.json says: the motion, and whether `train` accepts it."""
    refusals = [finding["message"] for finding in gait["gate"] if finding["severity"] == "refuse"]
    path = gait.get("path") or {}
    return {
        "status": REFUSED if refusals else ACCEPTED,
        "reason": "; ".join(refusals) or None,
        "stage": GATE if refusals else None,
        "kind": gait["kind"],
        "cyclic": gait["cyclic"],
        "strides_used": gait.get("strides_used", gait.get("strides")),
        "strides_found": gait.get("strides_found"),
        "period_s": gait.get("period_s"),
        "speed_m_s": gait.get("speed_m_s"),
        "path": path.get("source"),
        "path_disagreement": path.get("disagreement"),
        "findings": [text for text in gait["warnings"] if text not in refusals],
    }


def score_columns(scores: Mapping[str, Any]) -> Row:
    """What scores.json says, in the median over the start phases.

    upright: share of the frames before a fall; R² of knee and hip gives no credit after a fall.
    """
    from kinemimic.evaluate.scoring.metrics.verdict import verdict  # noqa: PLC0415 (import cost)

    fit, survival = scores["fit"]["phases"], scores["survival"]
    columns: Row = {
        "verdict": verdict(scores).level,
        "upright": round(survival["frames_median"] / survival["of"], 4),
        "mpjpe_mm": _median((scores["tracking"]["phases"]["all"] or {}).get("mpjpe_g_mm")),
    }
    for joint in ("knee", "hip"):
        columns[f"{joint}_r2"] = _median(fit[joint]["r2_upright"])
        columns[f"{joint}_rmse_deg"] = _median(fit[joint]["rmse_deg"])
    return columns


def _median(spread: Mapping[str, Any] | None) -> Any:
    return None if spread is None else spread["median"]


def _word(value: Any) -> str | None:
    return value.strip()[:200] or None if isinstance(value, str) else None

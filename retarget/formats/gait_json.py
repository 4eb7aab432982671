"""gait.json as other stages read it, regardless of the version of kinemimic that wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.files.validation.fields import checked
from kinemimic.pipeline.files.validation.schema import unchanged, upgraded
from kinemimic.retarget.formats.gait_schema import Gait
from kinemimic.retarget.formats.same_motion import require_same_motion
from kinemimic.retarget.humanoid.motion import Motion

GAIT = "gait.json"
GAIT_SCHEMA = 3
_RENAMED_IN_2 = {
    "passes": {"strides_followed": "strides_timed_individually", "ankles_m": "ankle_amplitude_m"},
    "ground": {"shift_m": "height_shift_m"},
    "gate": {"text": "message"},
}


def read_gait_json(path: Path, motion: Motion | None = None) -> dict[str, Any]:
    """The report of `retarget` in today's schema.

    KinemimicError if the file holds other JSON, or is the report on another motion than this one.
    """
    document = read_json(path)
    advice = "run `retarget` again"
    try:
        report = upgraded(
            dict(document),
            path,
            kind="a gait report",
            schema=GAIT_SCHEMA,
            advice=advice,
            upgrades={0: unchanged, 1: _from_1, 2: _from_2},
        )
    except (AttributeError, TypeError, ValueError):
        raise KinemimicError(f"{path}: expected a report of `retarget`, found other JSON; {advice}") from None
    report = checked(report, Gait, path, advice=advice)
    if motion is not None:
        require_same_motion(path, report.get("motion"), motion, stage="retarget")
    return report


def report_of_run(run: Path, motion: Motion | None = None) -> dict[str, Any] | None:
    """The report in a run folder, as `read_gait_json` reads it; None if the folder has none, since its motion
    was not retargeted there."""
    path = run / GAIT
    return read_gait_json(path, motion) if path.exists() else None


def _from_1(document: Mapping[str, Any]) -> dict[str, Any]:
    """Schema 2 renamed keys."""
    report = _renamed(document, {"believed": "reliability"})
    for key, names in _RENAMED_IN_2.items():
        if key in report:
            rows = report[key]
            report[key] = (
                [_renamed(row, names) for row in rows] if isinstance(rows, list) else _renamed(rows, names)
            )
    return report


def _from_2(document: Mapping[str, Any]) -> dict[str, Any]:
    """Schema 3 lists bouts and strides where schema 2 listed passes."""
    return {
        key: value
        for key, value in _renamed(document, {"strides": "strides_used"}).items()
        if key != "passes"
    }


def _renamed(row: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    return {names.get(key, key): value for key, value in row.items()}

"""The report of `kinemimic inspect` on one capture file, as JSON values."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.errors import KinemimicError, NotACaptureError
from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.files.sidecars import note_path, truth_path
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.filters.options import FILTERS
from kinemimic.pipeline.inspect.measures import (
    available_nodes,
    joint_quality,
    leg_angle_ranges,
    recorded_angles,
    segment_lengths,
    stature,
)
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.nodes import shows_feet
from kinemimic.pipeline.kinematics.orientation.rest_pose import recorded_knees
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.locomotion.bouts import find_bouts
from kinemimic.pipeline.locomotion.segments import Segment, find_segments
from kinemimic.pipeline.locomotion.summary import gait_summary
from kinemimic.pipeline.quality.check import CheckedCapture, check_capture, planned_steps
from kinemimic.pipeline.quality.low_rate import low_rate_note
from kinemimic.pipeline.readers.recognise import read

USABLE, FLAGGED, REFUSED, OTHER, SIDECAR = "usable", "flagged", "refused", "other", "sidecar"


@dataclass(frozen=True)
class InspectedFile:
    """The report on a file; its clip and check results if the file could be read."""

    report: dict[str, Any]
    recorded: Clip | None = None
    checked: CheckedCapture | None = None


def file_report(path: Path, *, unit: str | None = None, rate: float | None = None) -> dict[str, Any]:
    """The report on one file; it has the same keys for every file, None if a value is unknown.

    unit, rate: as in `recognise.read`. In the report, status: "usable", "flagged" (usable, with
    defects to judge), "refused", "other" (not a capture) or "sidecar" (read with a capture); reason: why the
    file is refused or not a capture.
    """
    return inspect_file(path, unit=unit, rate=rate).report


def inspect_file(path: Path, *, unit: str | None = None, rate: float | None = None) -> InspectedFile:
    """The report with the clips that it was made from."""
    try:
        recorded = read(path, unit=unit, rate=rate)
    except NotACaptureError as error:
        return InspectedFile(unread_report(path, OTHER, str(error)))
    except KinemimicError as error:
        return InspectedFile(unread_report(path, REFUSED, str(error)))
    except MemoryError:
        found = f"{path}: expected a capture that fits into memory, found a larger one"
        return InspectedFile(unread_report(path, REFUSED, found))
    checked = check_capture(recorded)
    return InspectedFile(_report(path, recorded, checked), recorded, checked)


def unread_report(path: Path, status: str, reason: str) -> dict[str, Any]:
    """The report on a file that could not be read: all keys, with only these values."""
    return {**_EMPTY, "file": str(path), "status": status, "reason": without_path(path, reason)}


_EMPTY: dict[str, Any] = {
    "file": "",
    "status": REFUSED,
    "reason": None,
    "read": False,
    "format": None,
    "sensor": None,
    "simulated": False,
    "sha256": None,
    "sidecar_files": [],
    "units": None,
    "frames": 0,
    "frames_in_passes": 0,
    "rate_hz": None,
    "clock_jitter_ms": None,
    "duration_s": None,
    "passes": [],
    "passes_discarded": 0,
    "labels": [],
    "bones_m": None,
    "stature_m": None,
    "angles": None,
    "gait": None,
    "segments": [],
    "recorded_angles": {},
    "joints": {},
    "defects": [],
    "notes": [],
    "planned_steps": [],
}


def _report(path: Path, recorded: Clip, checked: CheckedCapture) -> dict[str, Any]:
    clip, refused = checked.clip, checked.refused
    reading, inside = recorded.provenance["reading"], clip.passes >= 0
    nodes, states, nodes_error = available_nodes(clip)
    lengths = segment_lengths(nodes[inside])
    flagged = any(defect.action == "flagged" for defect in checked.defects)
    beside, simulated = _sidecar_files(path)
    # Gait and segments as every later stage finds them: after the cleaning.
    smooth, _ = clean(clip, FILTERS[0])
    smooth_nodes, smooth_states, _ = available_nodes(smooth)
    bouts = find_bouts(clip.times, clip.passes, smooth_nodes, toes=shows_feet(smooth_states))
    steps = np.diff(clip.times)[inside[1:] & (clip.passes[1:] == clip.passes[:-1])]
    step = median(steps)
    return _EMPTY | {
        "file": str(path),
        "status": REFUSED if refused else FLAGGED if flagged else USABLE,
        "reason": refused.text if refused else None,
        "read": True,
        "format": recorded.provenance["format"],
        "sensor": recorded.provenance["sensor"],
        "simulated": recorded.simulated or simulated,
        "sha256": recorded.provenance["sha256"],
        "sidecar_files": sorted({*recorded.provenance.get("sidecar_files", {}), *beside}),
        "units": {"length": reading["units"], "rule": reading["units_rule"]},
        "frames": len(recorded.times),
        "frames_in_passes": int(inside.sum()),
        "rate_hz": rounded(1.0 / step, 3),
        "clock_jitter_ms": rounded(1e3 * np.std(steps), 3) if len(steps) else None,
        "duration_s": rounded(recorded.times[-1] - recorded.times[0], 3),
        "passes": [_pass(clip, number) for number in range(checked.acquisition.count)],
        "passes_discarded": checked.acquisition.discarded,
        "labels": [_label(label) for label in clip.labels],
        "bones_m": lengths,
        "stature_m": stature(lengths),
        "angles": leg_angle_ranges(
            nodes[inside],
            states[inside],
            clip.times[inside],
            {name: knee[inside] for name, knee in recorded_knees(clip).items()},
        ),
        "gait": gait_summary(bouts),
        "segments": [_segment(one) for one in find_segments(smooth, smooth_nodes, bouts)],
        "recorded_angles": recorded_angles(clip, nodes, inside),
        "joints": joint_quality(clip, inside),
        "defects": [defect.to_json() for defect in checked.defects],
        "notes": [
            *reading["notes"],
            *([nodes_error] if nodes_error else []),
            *filter(None, [low_rate_note(1.0 / step)]),
        ],
        "planned_steps": planned_steps(checked),
    }


def _pass(clip: Clip, number: int) -> dict[str, Any]:
    frames = np.flatnonzero(clip.passes == number)
    return {
        "pass": number,
        "frames": len(frames),
        "start_s": rounded(clip.times[frames[0]], 4),
        "end_s": rounded(clip.times[frames[-1]], 4),
    }


def _segment(segment: Segment) -> dict[str, Any]:
    return {
        "name": segment.name,
        "kind": segment.kind,
        "start_s": rounded(segment.start, 3),
        "end_s": rounded(segment.end, 3),
        "strides": rounded(segment.bout.cycles, 1) if segment.bout else None,
    }


def _label(label: Label) -> dict[str, Any]:
    return {"name": label.name, "start_s": rounded(label.start, 4), "end_s": rounded(label.end, 4)}


def _sidecar_files(path: Path) -> tuple[list[str], bool]:
    """Names of the provenance and truth files of a capture, and whether they mark it as simulated."""
    note, truth = note_path(path), truth_path(path)
    simulated = truth.is_file()
    if note.is_file() and not simulated:
        try:
            content = json.loads(note.read_text(encoding="utf-8"))
        except (ValueError, OSError, RecursionError):
            content = None
        simulated = isinstance(content, dict) and bool(content.get("simulated"))
    return [one.name for one in (note, truth) if one.is_file()], simulated


def without_path(path: Path, reason: str) -> str:
    """The text of an error without the leading path, which the report names already."""
    return reason.removeprefix(str(path)).removeprefix(":").removeprefix(",").strip()

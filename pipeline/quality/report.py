"""quality.json: the visibility of each joint, the steadiness of bones and clock, and the repairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.filters.clean import Cleaning
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.joint_statistics import joint_statistics, share
from kinemimic.pipeline.quality.low_rate import low_rate_note
from kinemimic.pipeline.quality.passes import Acquisition
from kinemimic.pipeline.quality.rules.defect import RULES, Defect
from kinemimic.pipeline.quality.stored import QUALITY_SCHEMA


def quality_report(
    raw: Clip, acquisition: Acquisition, cleaning: Cleaning, defects: Sequence[Defect]
) -> dict[str, Any]:
    """The quality report as JSON values; shares are of the frames inside passes, lengths in metres."""
    inside = acquisition.passes >= 0
    reading, clock = raw.provenance["reading"], _clock(raw.times, acquisition.passes)
    joints = joint_statistics(raw, inside)
    for joint, name in enumerate(raw.skeleton.names):
        joints[name]["filled"] = share(cleaning.filled[inside, joint])
    return {
        "schema": QUALITY_SCHEMA,
        "source": raw.provenance["source"],
        "format": raw.provenance["format"],
        "sidecar_files": dict(raw.provenance.get("sidecar_files", {})),
        "simulated": raw.simulated,
        "units": {"length": reading["units"], "rule": reading["units_rule"]},
        "frames": len(raw.times),
        "frames_in_passes": int(inside.sum()),
        "complete_frames": int(acquisition.complete[inside].sum()),
        "defects": [defect.to_json() for defect in defects],
        "clock": clock,
        "passes": [_pass(raw, acquisition, number) for number in range(acquisition.count)],
        "passes_discarded": acquisition.discarded,
        "events": [
            {"frame": e.frame, "time": round(e.time, 4), "state": str(e.state), "reason": e.reason}
            for e in acquisition.events
        ],
        "joints": joints,
        "notes": [*reading["notes"], *filter(None, [low_rate_note(clock["rate_hz"])])],
        "processing": list(cleaning.done),
    }


def _clock(times: Array, passes: NDArray[np.int32]) -> dict[str, float]:
    """Frame rate and spread of the time steps between frames of the same pass."""
    within = (passes[1:] == passes[:-1]) & (passes[1:] >= 0)
    steps = np.diff(times)[within]
    median = float(np.median(steps))
    return {
        "rate_hz": round(1.0 / median, 3),
        "step_ms": round(1e3 * median, 3),
        "jitter_ms": round(1e3 * float(np.std(steps)), 3),
        "longest_step_ms": round(1e3 * float(steps.max()), 3),
    }


def _pass(raw: Clip, acquisition: Acquisition, number: int) -> dict[str, Any]:
    frames = np.flatnonzero(acquisition.passes == number)
    first, last = int(frames[0]), int(frames[-1])
    return {
        "pass": number,
        "first_frame": first,
        "last_frame": last,
        "start": round(float(raw.times[first]), 4),
        "end": round(float(raw.times[last]), 4),
        "complete_frames": int(acquisition.complete[frames].sum()),
    }


def quality_table(report: dict[str, Any]) -> RenderableType:
    """The report for a terminal: a summary, and the joints that are nodes of the 20-node skeleton."""
    clock, passes = report["clock"], report["passes"]
    seconds = sum(one["end"] - one["start"] for one in passes)
    lines = [
        f"{report['source']}: {report['format']}{', SIMULATED' if report['simulated'] else ''}, "
        f"unit {report['units']['length']}",
        f"{report['frames']} frames at {clock['rate_hz']:.1f} Hz (jitter {clock['jitter_ms']:.1f} ms, "
        f"longest step {clock['longest_step_ms']:.0f} ms), {report['complete_frames']} of "
        f"{report['frames_in_passes']} in passes complete",
        f"{plural(len(passes), 'pass', 'passes')}, {seconds:.1f} s; "
        f"{report['passes_discarded']} too short to use",
        *report["notes"],
        *_defect_lines(report["defects"]),
        *report["processing"],
    ]
    grid = Table("joint", header_style="bold", box=None, pad_edge=False)
    for column in ("tracked %", "inferred %", "missing %", "filled %", "bone m", "CV %"):
        grid.add_column(column, justify="right")
    names = tuple(report["joints"])
    shown = sorted(joints_by_name(names).values())
    for name in (names[joint] for joint in shown):
        joint = report["joints"][name]
        shares = [f"{100 * joint[key]:.1f}" for key in ("tracked", "inferred", "missing", "filled")]
        bone = ["-", "-"]
        if joint["bone_m"] is not None:
            bone = [f"{joint['bone_m']:.3f}", f"{100 * joint['bone_cv']:.1f}"]
        grid.add_row(name, *shares, *bone)
    return Group(*(Text(line, no_wrap=True, overflow="ignore") for line in lines), grid)


def _defect_lines(defects: Sequence[dict[str, Any]]) -> list[str]:
    """One line per defect: action, rule and description in columns."""
    if not defects:
        return ["no defects"]
    width = max(len(RULES[one["rule"]]) for one in defects)
    return [f"defects: {len(defects)}"] + [
        f"  {one['action']:<8}  {RULES[one['rule']]:<{width}}  {one['text']}" for one in defects
    ]

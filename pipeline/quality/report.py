"""How good a capture is: what was seen of each joint, how steady bones and clock are, what was done."""

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
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED
from kinemimic.pipeline.quality.passes import Acquisition
from kinemimic.pipeline.quality.rules.defect import RULES, Defect

QUALITY_SCHEMA = 1


def quality_report(
    raw: Clip, acquisition: Acquisition, cleaning: Cleaning, defects: Sequence[Defect]
) -> dict[str, Any]:
    """The quality report as JSON values; shares are of the frames inside passes, lengths in metres."""
    inside = acquisition.passes >= 0
    reading = raw.provenance["reading"]
    return {
        "schema": QUALITY_SCHEMA,
        "source": raw.provenance["source"],
        "format": raw.provenance["format"],
        "companions": dict(raw.provenance.get("companions", {})),
        "simulated": raw.simulated,
        "units": {"length": reading["units"], "rule": reading["units_rule"]},
        "frames": len(raw.times),
        "frames_in_passes": int(inside.sum()),
        "complete_frames": int(acquisition.complete[inside].sum()),
        "defects": [defect.to_json() for defect in defects],
        "clock": _clock(raw.times, acquisition.passes),
        "passes": [_pass(raw, acquisition, number) for number in range(acquisition.count)],
        "passes_discarded": acquisition.discarded,
        "events": [
            {"frame": e.frame, "time": round(e.time, 4), "state": str(e.state), "reason": e.reason}
            for e in acquisition.events
        ],
        "joints": _joints(raw, inside, cleaning),
        "notes": list(reading["notes"]),
        "done": list(cleaning.done),
    }


def _clock(times: Array, passes: NDArray[np.int32]) -> dict[str, float]:
    """Rate and spread of the steps between frames of one pass."""
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


def _joints(raw: Clip, inside: NDArray[np.bool_], cleaning: Cleaning) -> dict[str, dict[str, float | None]]:
    """Per joint the share of frames in each state and filled, and its bone's median length and spread.

    bone_m: to the parent; bone_cv: standard deviation over mean, of the frames as recorded; None for a root
    and for a bone that was never seen or has no length.
    """
    report: dict[str, dict[str, float | None]] = {}
    for joint, name in enumerate(raw.skeleton.names):
        states, parent = raw.states[inside, joint], raw.skeleton.parents[joint]
        shares = {
            "tracked": np.mean(states == TRACKED),
            "inferred": np.mean(states == INFERRED),
            "lost": np.mean(states == MISSING),
            "filled": np.mean(cleaning.filled[inside, joint]),
        }
        report[name] = {key: round(float(share), 4) for key, share in shares.items()}
        length = spread = None
        if parent >= 0:
            bone = np.linalg.norm(raw.positions[inside, joint] - raw.positions[inside, parent], axis=-1)
            bone = bone[np.isfinite(bone)]
            if len(bone) and np.median(bone) > 1e-6:
                length = round(float(np.median(bone)), 4)
                spread = round(float(np.std(bone) / np.mean(bone)), 4)
        report[name] |= {"bone_m": length, "bone_cv": spread}
    return report


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
        f"{len(passes)} pass{'es' if len(passes) != 1 else ''}, {seconds:.1f} s; "
        f"{report['passes_discarded']} too short to use",
        *report["notes"],
        *_defect_lines(report["defects"]),
        *report["done"],
    ]
    grid = Table("joint", header_style="bold", box=None, pad_edge=False)
    for column in ("tracked %", "inferred %", "lost %", "filled %", "bone m", "spread %"):
        grid.add_column(column, justify="right")
    names = tuple(report["joints"])
    shown = sorted(joints_of_nodes(names).values())
    for name in (names[joint] for joint in shown):
        joint = report["joints"][name]
        shares = [f"{100 * joint[key]:.1f}" for key in ("tracked", "inferred", "lost", "filled")]
        bone = ["-", "-"]
        if joint["bone_m"] is not None:
            bone = [f"{joint['bone_m']:.3f}", f"{100 * joint['bone_cv']:.1f}"]
        grid.add_row(name, *shares, *bone)
    return Group(*(Text(line, no_wrap=True, overflow="ignore") for line in lines), grid)


def _defect_lines(defects: Sequence[dict[str, Any]]) -> list[str]:
    """A block: a line per defect, what was done with it in a column of its own."""
    if not defects:
        return ["no defects"]
    width = max(len(RULES[one["rule"]]) for one in defects)
    return [f"defects: {len(defects)}"] + [
        f"  {one['action']:<8}  {RULES[one['rule']]:<{width}}  {one['text']}" for one in defects
    ]

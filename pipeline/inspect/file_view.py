"""The report on one file, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.pipeline.cli.terminal import grid, heading, key_value_table, number, percent
from kinemimic.pipeline.inspect.file_report import FLAGGED, OTHER, REFUSED
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.quality.rules.defect import RULES

Report = dict[str, Any]


def file_view(report: Report) -> RenderableType:
    """The full report; only the reason for a file that could not be read."""
    if not report["read"]:
        return Group(*_verdict(report))
    parts: list[RenderableType] = [_summary(report)]
    if report["passes"]:
        parts += [heading("Joints"), _joints(report)]
    if report["defects"]:
        parts += [heading("Defects"), _defects(report)]
    todo = key_value_table()
    for line in report["planned_steps"]:
        todo.add_row("-", line)
    parts += [heading("What ingest will do"), todo]
    return Group(*parts, Text(), *_verdict(report))


def _summary(report: Report) -> Table:
    table = key_value_table()
    marks = [f"{report['format']} ({report['sensor']})" if report["sensor"] else str(report["format"])]
    if report["simulated"]:
        marks.append("SIMULATED")
    table.add_row("file", report["file"])
    table.add_row("format", ", ".join(marks))
    if report["sidecar_files"]:
        table.add_row("read with", ", ".join(report["sidecar_files"]))
    table.add_row("unit", f"{report['units']['length']}: {report['units']['rule']}")
    table.add_row("frames", _frames(report))
    if report["labels"]:
        table.add_row("labels", _labels(report))
    if report["passes"]:
        table.add_row("body", "\n".join(_body(report)))
        for joint in ("knee", "hip"):
            table.add_row(joint, _range(report, joint))
        table.add_row("gait", _gait(report["gait"]))
        table.add_row("segments", _segments(report))
    for name, recorded in report["recorded_angles"].items():
        table.add_row(f"recorded {name.replace('_', ' ')}", _recorded_angle(recorded))
    for note in report["notes"]:
        table.add_row("note", note)
    return table


def _frames(report: Report) -> str:
    passes = report["passes"]
    plural = "" if len(passes) == 1 else "es"
    short = f"; {report['passes_discarded']} too short" if report["passes_discarded"] else ""
    return (
        f"{report['frames']} in {number(report['duration_s'], 2, ' s')}, {number(report['rate_hz'], 1)} Hz, "
        f"jitter {number(report['clock_jitter_ms'], 1)} ms; "
        f"{len(passes)} pass{plural} of {report['frames_in_passes']} frames{short}"
    )


def _labels(report: Report) -> str:
    spans = [f"{one['name']} {one['start_s']:.2f} to {one['end_s']:.2f} s" for one in report["labels"]]
    return ", ".join(spans)


def _body(report: Report) -> Iterator[str]:
    for name, bone in report["bones_m"].items():
        sides = ", ".join(f"{side} {number(bone[side], 3)}" for side in SIDES if side in bone)
        yield (
            f"{name.replace('_', ' '):<10} {number(bone['median'], 3, ' m')}"
            + (f" ({sides})" if sides else "")
            + f", CV {percent(bone['cv'])} %"
        )
    if report["stature_m"] is not None:
        yield f"{'stature':<10} about {report['stature_m']:.2f} m, from the leg length"


def _range(report: Report, joint: str) -> str:
    sides = [
        f"{side} {number(one['low_deg'], 0)} to {number(one['high_deg'], 0)}°"
        for side, one in report["angles"][joint].items()
    ]
    # Only in strides, both knees have the same peak.
    peak = report["angles"]["knee_peak_deg"] if joint == "knee" and report["gait"] else None
    by = report["angles"]["knee_peak_side"]
    which = "mean of both sides" if by == "both" else f"{by} side, better tracked"
    return ", ".join(sides) + ("" if peak is None else f"; peak {peak:.0f}° ({which})")


def _gait(gait: dict[str, Any] | None) -> str:
    if gait is None:
        return "none"
    speed = "on the spot" if gait["speed_m_s"] is None else f"{gait['speed_m_s']:.2f} m/s"
    source = " by the feet: the recorded path does not follow them" if gait["path"] == "feet" else ""
    return (
        f"{gait['strides_usable']:.1f} usable strides of {gait['strides']:.1f}, "
        f"period {gait['period_s']:.2f} s, {gait['cadence_steps_min']:.0f} steps/min, {speed}{source}"
    )


def _segments(report: Report) -> str:
    return ", ".join(
        f"{one['name']} {one['start_s']:.1f} to {one['end_s']:.1f} s" for one in report["segments"]
    )


def _recorded_angle(angle: dict[str, Any]) -> str:
    if "r" not in angle:
        return f"{angle['frames']} frames"
    return (
        f"compared with ours: r {number(angle['r'], 3)}, median difference "
        f"{number(angle['difference_deg'], 1, '°')}, {angle['frames']} frames"
    )


def _joints(report: Report) -> Table:
    table = grid("joint", "tracked %", "inferred %", "missing %", "bone m", "CV %", "jitter mm")
    names = tuple(report["joints"])
    shown = sorted(set(joints_by_name(names).values())) or range(len(names))
    for name in (names[joint] for joint in shown):
        one = report["joints"][name]
        shares = [percent(one[state]) for state in ("tracked", "inferred", "missing")]
        bone = [number(one["bone_m"], 3), percent(one["bone_cv"])]
        table.add_row(name, *shares, *bone, number(one["jitter_mm"], 1))
    if len(shown) < len(names):
        table.caption = f"{len(names) - len(shown)} more joints in --json"
        table.caption_justify = "left"
    return table


def _defects(report: Report) -> Table:
    table = key_value_table()
    table.columns[1].no_wrap = True
    table.add_column(overflow="fold")
    for defect in report["defects"]:
        table.add_row(RULES[defect["rule"]], defect["action"], defect["text"])
    return table


def _verdict(report: Report) -> Iterator[RenderableType]:
    if report["status"] == REFUSED:
        yield Text(
            f"refused: {report['file'] + ': ' if not report['read'] else ''}{report['reason']}", "bold"
        )
    elif report["status"] == OTHER:
        yield Text(f"not a capture: {report['file']}: {report['reason']}", "bold")
    elif report["status"] == FLAGGED:
        rules = [RULES[one["rule"]] for one in report["defects"] if one["action"] == "flagged"]
        yield Text(f"usable with flags: {', '.join(rules)}", "bold")
    else:
        yield Text("usable", "bold")

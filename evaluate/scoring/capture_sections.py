"""The report's sections about where the reference came from: the capture, its Euler angles, the gait in it.

They are read from the JSON files of the stages before; a file that is not there leaves its section out.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from kinemimic.pipeline.cli.html import number, table

_SHOWN_FRAMES = 3
_GAIT: tuple[tuple[str, str, str, int], ...] = (
    ("period_s", "length of a cycle", "s", 3),
    ("cadence_steps_per_min", "cadence", "steps/min", 0),
    ("speed_m_s", "speed on the body", "m/s", 2),
    ("speed_capture_m_s", "speed captured", "m/s", 2),
    ("stride_m", "stride", "m", 2),
    ("strides", "strides pooled", "", 1),
    ("asymmetry_deg", "difference of the sides", "°", 1),
    ("noise_deg", "noise of the capture", "°", 1),
    ("duration_s", "duration", "s", 2),
)


def quality_section(quality: Mapping[str, Any]) -> str:
    """What the sensor saw of each joint, from quality.json."""
    rows = [
        [
            escape(name.replace("_", " ")),
            *(number(100 * joint[key], 1) for key in ("tracked", "inferred", "lost", "filled")),
            number(joint["bone_m"], 3),
            number(None if joint["bone_cv"] is None else 100 * joint["bone_cv"], 1),
        ]
        for name, joint in quality["joints"].items()
        # End sites of a BVH and joints that a capture does not have say nothing.
        if not name.lower().endswith("end")
    ]
    clock = quality["clock"]
    counted = ("frames", "complete_frames", "frames_in_passes")
    frames, complete, within = (escape(str(quality[key])) for key in counted)
    notes = [*quality.get("notes", ()), *quality.get("done", ())]
    return (
        f"<h2>The capture</h2><p>{escape(str(quality['source']))} ({escape(str(quality['format']))}): "
        f"{frames} frames at {clock['rate_hz']:.1f} Hz (jitter {clock['jitter_ms']:.1f} ms, "
        f"longest step {clock['longest_step_ms']:.0f} ms), {len(quality['passes'])} pass(es); "
        f"{complete} of {within} frames within passes show every "
        "joint.</p>"
        + (f"<ul>{''.join(f'<li>{escape(str(note))}</li>' for note in notes)}</ul>" if notes else "")
        + table(
            ["joint", "tracked %", "inferred %", "lost %", "filled %", "bone m", "spread %"],
            rows,
            "How much of each joint the sensor saw, as shares of the frames within passes; the length of the "
            "bone to the joint's parent, and how far that length strays (standard deviation over mean).",
        )
    )


def gimbal_section(gimbal: Mapping[str, Any]) -> str:
    """Which joints come near gimbal lock or flip, from gimbal.json."""
    joints = sorted(gimbal["joints"], key=lambda joint: float(joint["nearest_deg"]))
    title = "<h2>Gimbal lock</h2>"
    if not joints:
        return title + "<p>The capture holds positions: there are no Euler angles, and nothing can lock.</p>"
    marked = [joint for joint in joints if joint["flagged_frames"] or joint["flips"]]
    shown = marked + [joint for joint in joints if joint not in marked][:3]
    rows = [
        [
            escape(joint["joint"]),
            escape(joint["order"]),
            " and ".join(number(angle, 0) for angle in joint["lock_at_deg"]),
            number(joint["nearest_deg"], 2),
            _some(
                [f"{first}–{last}" if last > first else f"{first}" for first, last in joint["flagged_frames"]]
            ),
            _some([str(frame) for frame in joint["flips"]]),
        ]
        for joint in shown
    ]
    return title + table(
        ["joint", "order", "locks at °", "nearest °", "frames flagged", "flips at frames"],
        rows,
        f"{len(marked)} of {len(joints)} joints come within {gimbal['flag_within_deg']:g}° of lock or flip "
        f"in {escape(str(gimbal['frames']))} frames; the nearest others follow. The quaternions stay right "
        "there: what is lost at lock is only the split between the first and the third angle.",
    )


def gait_section(gait: Mapping[str, Any]) -> str:
    """What the reference is, from gait.json."""
    rows = [
        [label, number(gait[key], digits), unit]
        for key, label, unit, digits in _GAIT
        if gait.get(key) is not None
    ]
    for name, (low, high) in gait.get("range_deg", {}).items():
        rows.append(
            [f"range, {escape(name.replace('_', ' '))}", f"{number(low, 1)} to {number(high, 1)}", "°"]
        )
    loop = "repeated as a loop" if gait.get("cyclic") else "performed once, as recorded"
    warnings = "".join(f"<li>{escape(str(text))}</li>" for text in gait.get("warnings", ()))
    return (
        f"<h2>The reference</h2><p>A {escape(str(gait['kind']))}, {loop}.{_believed(gait)}</p>"
        + (f'<ul class="warnings">{warnings}</ul>' if warnings else "")
        + table(
            ["measure", "value", "unit"], rows, "The motion that the policy is asked to perform, on the body."
        )
    )


def _believed(gait: Mapping[str, Any]) -> str:
    """Which parts were measured and which replaced: hip angles are relative to that pelvis."""
    parts = {
        part: gait["reliability"][part]
        for part in ("pelvis", "torso", "feet")
        if part in gait.get("reliability", {})
    }
    neutral = [part for part, measured in parts.items() if not measured]
    if not parts:
        return ""
    if not neutral:
        return " Pelvis, torso and feet are as measured."
    return f" Not repeatable enough to be believed, and neutral instead: {', '.join(neutral)}."


def _some(items: list[str]) -> str:
    if not items:
        return "–"
    more = f" and {len(items) - _SHOWN_FRAMES} more" if len(items) > _SHOWN_FRAMES else ""
    return escape(", ".join(items[:_SHOWN_FRAMES])) + more

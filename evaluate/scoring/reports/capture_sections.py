"""The report's sections on the origin of the reference: the capture, its Euler angles and its gait."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kinemimic.pipeline.cli.html import number
from kinemimic.retarget.table import off_the_soles

Json = Mapping[str, Any]
_SHOWN_FRAMES = 3
_SHOWN_JOINTS = 3  # without gimbal lock or flips
_GAIT: tuple[tuple[str, str, str, int], ...] = (
    ("period_s", "gait cycle", "s", 3),
    ("cadence_steps_per_min", "cadence", "steps/min", 0),
    ("speed_m_s", "speed, humanoid", "m/s", 2),
    ("speed_capture_m_s", "speed, captured", "m/s", 2),
    ("stride_m", "stride length", "m", 2),
    ("strides_used", "strides pooled", "", 1),
    ("asymmetry_deg", "difference between sides", "°", 1),
    ("noise_deg", "noise of the capture", "°", 1),
    ("duration_s", "duration", "s", 2),
)


def capture_values(quality: Json | None, gimbal: Json | None, gait: Json | None) -> dict[str, Any]:
    """Values for `capture_sections.html` from the JSON files of that name; None where there is no file."""
    flagged = _flagged(gimbal) if gimbal else []
    return {
        "quality": quality,
        "gimbal": gimbal,
        "gimbal_flagged": len(flagged),
        "gait": gait,
        "reliability": _reliability(gait) if gait else "",
        "tables": {
            "quality": _quality_rows(quality) if quality else [],
            "gimbal": _gimbal_rows(gimbal, flagged) if gimbal else [],
            "gait": _gait_rows(gait) if gait else [],
        },
    }


def _quality_rows(quality: Json) -> list[list[str]]:
    return [
        [
            name.replace("_", " "),
            *(number(100 * joint[key], 1) for key in ("tracked", "inferred", "missing", "filled")),
            number(joint["bone_m"], 3),
            number(None if joint["bone_cv"] is None else 100 * joint["bone_cv"], 1),
        ]
        for name, joint in quality["joints"].items()
        # End sites of a BVH file, and joints that the capture lacks, carry no information.
        if not name.lower().endswith("end")
    ]


def _flagged(gimbal: Json) -> list[Json]:
    """Joints that come near gimbal lock or flip, nearest first."""
    return [joint for joint in _nearest_first(gimbal) if joint["flagged_frames"] or joint["flips"]]


def _nearest_first(gimbal: Json) -> list[Json]:
    return sorted(gimbal["joints"], key=lambda joint: float(joint["nearest_deg"]))


def _gimbal_rows(gimbal: Json, flagged: list[Json]) -> list[list[str]]:
    others = [joint for joint in _nearest_first(gimbal) if joint not in flagged]
    return [
        [
            joint["joint"],
            joint["order"],
            " and ".join(number(angle, 0) for angle in joint["lock_at_deg"]),
            number(joint["nearest_deg"], 2),
            _first(
                [f"{first}–{last}" if last > first else f"{first}" for first, last in joint["flagged_frames"]]
            ),
            _first([str(frame) for frame in joint["flips"]]),
        ]
        for joint in flagged + others[:_SHOWN_JOINTS]
    ]


def _gait_rows(gait: Json) -> list[list[str]]:
    ranges = [
        [f"range, {name.replace('_', ' ')}", f"{number(low, 1)} to {number(high, 1)}", "°"]
        for name, (low, high) in gait.get("range_deg", {}).items()
    ]
    return [
        [label, number(gait[key], digits), unit]
        for key, label, unit, digits in _GAIT
        if gait.get(key) is not None
    ] + [*_balance_rows(gait), *ranges]


def _balance_rows(gait: Json) -> list[list[str]]:
    """How far the motion was displaced for its balance, which the scores do not count as an error."""
    found = gait.get("balance")
    if found is None:
        return []
    before, after, most = (1e3 * found[name] for name in ("outside_before_m", "outside_m", "displacement_m"))
    return [
        [
            f"balanced: zero-moment point {off_the_soles(gait)}",
            f"{number(before, 0)} → {number(after, 0)}",
            "mm",
        ],
        ["balanced: root displaced by up to", number(most, 0), "mm"],
    ]


def _reliability(gait: Json) -> str:
    """Which segments were measured and which are neutral; hip angles are relative to that pelvis."""
    measured = gait.get("reliability", {})
    parts = [part for part in ("pelvis", "torso", "feet") if part in measured]
    neutral = [part for part in parts if not measured[part]]
    if not parts:
        return ""
    if not neutral:
        return " Pelvis, torso and feet are as measured."
    return f" Not repeatable enough, and therefore neutral: {', '.join(neutral)}."


def _first(items: list[str]) -> str:
    if not items:
        return "–"
    more = f" and {len(items) - _SHOWN_FRAMES} more" if len(items) > _SHOWN_FRAMES else ""
    return ", ".join(items[:_SHOWN_FRAMES]) + more

"""Warnings about a loop that does not show how the person walked; `train` does not refuse it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kinemimic.pipeline.kinematics.skeleton import SIDES

# Least R² of a loop's knee against the pooled strides, by `SensorReliability.precise`. Real walks reach 0.83
# (optical; half of them 0.99) and 0.33 (depth sensors, whose knee is off by many degrees; half of them 0.67).
MIN_KNEE_R2 = {True: 0.8, False: 0.3}


def knee_warnings(report: Mapping[str, Any]) -> list[str]:
    """One sentence for the knees of a loop that most strides do not follow, from the value of gait.json."""
    least = MIN_KNEE_R2[report["reliability"]["precise"]]
    scores = {side: report["r2_loop_against_capture"].get(f"knee_{side}") for side in SIDES}
    low = [f"{side} {value:.2f}" for side, value in scores.items() if value is not None and value < least]
    if not low:
        return []
    return [
        f"the strides differ in the knee: R² of the loop against them {', '.join(low)} (limit {least:g}); "
        "they may include standing, turns or another gait: choose a part of the walk with --segment"
    ]


def climb_warnings(report: Mapping[str, Any]) -> list[str]:
    """What the level loop leaves out of a walk up or down, from its gait.json."""
    climb = report["climb"]
    if not climb["certain"]:
        return []
    verb = "climbs" if climb["stride_m"] > 0.0 else "descends"
    return [
        f"levelled: the {report['kind']} {verb} {abs(climb['stride_m']):.2f} m per stride "
        f"({abs(climb['angle_deg']):.1f}°)"
    ]

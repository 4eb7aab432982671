"""Warnings about a motion that does not show how the person moved; `train` does not refuse it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.feet.balance import LARGEST_LEAN

# Least R² of a loop's knee against the pooled strides, by `SensorReliability.precise`. Real walks reach 0.83
# (optical; half of them 0.99) and 0.33 (depth sensors, whose knee is off by many degrees; half of them 0.67).
MIN_KNEE_R2 = {True: 0.8, False: 0.3}
WIDTH_DIFFERENCE = 0.005  # m between the ankles
HELD_FEET = 0.04  # m by which the nodes may come away from the recording when the feet are held


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


def side_warnings(report: Mapping[str, Any]) -> list[str]:
    """That one side of a loop is the other's mirror image, because none of its strides could be used."""
    if not report["symmetric"]:
        return []
    used = [row for row in report["bouts"] if row["used"]]
    legs = {side: sum(row[f"{side}_legs_used"] for row in used) for side in SIDES}
    unused = [side for side in SIDES if not legs[side]]
    if len(unused) != 1:
        return []
    return [
        f"no stride of the {unused[0]} leg could be used: it is the mirror image of the other one, and shows "
        "nothing about a difference between the sides; retarget --no-loop keeps it as recorded"
    ]


def width_warnings(report: Mapping[str, Any]) -> list[str]:
    """That a walk's feet are nearer together or farther apart than in the capture, from its gait.json."""
    was, now = (report.get(f"stance_width_{name}m") for name in ("", "body_"))
    if was is None or now is None or abs(was - now) < WIDTH_DIFFERENCE:
        return []
    wider = "its soles would pass through each other"
    narrower = "only an optical recording shows reliably that they are farther apart"
    return [
        f"the body's ankles are {100 * now:.0f} cm apart, the capture's {100 * was:.0f} (scaled to the "
        f"body): {wider if now > was else narrower}"
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


def lean_warnings(lean: float) -> list[str]:
    """That the recorded body was turned upright by `lean` rad, if it was."""
    if not lean:
        return []
    if lean > LARGEST_LEAN - 1e-6:
        return [
            f"the recorded body leans in standing by more than {np.degrees(LARGEST_LEAN):.0f}°, which no "
            "tilt of the sensor explains, and was turned upright by no more: a person who sits, or holds on "
            "to something, cannot be imitated without it"
        ]
    return [
        f"the recorded body leans in standing by {np.degrees(lean):.0f}° more than it could without falling: "
        "it was turned upright by this angle"
    ]


def held_feet_warnings(report: Mapping[str, Any]) -> list[str]:
    """What it costs to hold the feet where they stand, from the gait.json of an excerpt as recorded."""
    before, after = (report[part]["node_error_m"] for part in ("closed_form", "measures"))
    if before is None or after is None or after - before < HELD_FEET:
        return []
    return [
        f"with its feet held where they stand, the motion is {1e3 * after:.0f} mm from the recording on "
        f"average, without {1e3 * before:.0f} mm: feet that slide or step are taken to stand; compare both "
        "in `kinemimic view`"
    ]

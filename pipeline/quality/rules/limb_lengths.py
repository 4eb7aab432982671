"""Detects limb lengths that no human has (refused) and bones whose length changes over the clip (flagged).

The bounds describe tracked skeletons, not anatomy: a Kinect v1 puts the hip joint too high (thigh up to 1.4
times the shank), a Kinect v2 too low (leg down to 1.2 times the trunk), and model-fitted skeletons have a
trunk a third too short. A smaller body may be a child, but then it has a child's proportions; a sensor that
took a machine for legs does not show them. A skeleton whose bones keep their lengths was not tracked frame by
frame, but fitted to a person, or made: its proportions are its maker's.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import between, length, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.quality.rules.defect import Defect

# Range of the median lengths in metres, from toddlers to giants.
LENGTH_RANGES: dict[str, tuple[float, float]] = {
    "thigh": (0.20, 0.65),
    "shank": (0.18, 0.60),
    "upper arm": (0.10, 0.50),
    "forearm": (0.08, 0.45),
    "trunk": (0.15, 0.80),
}
_BONES: dict[str, tuple[str, str]] = {
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "upper arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
}
# Thigh plus shank of a six-year-old in metres; a smaller body must meet the bounds below.
CHILD_LEG = 0.60
CHILD_THIGH_TO_SHANK = (0.75, 1.40)
CHILD_LEG_TO_TRUNK = (1.00, 2.15)
CHILD_SPREAD = 0.12
# Spread of a leg bone's length up to which a skeleton is rigid: rounding, no measurement.
RIGID_SPREAD = 1e-3
# Limits of a bone's relative length: robust spread, and change from the first to the last fifth of the clip.
# A Kinect v1 walk has spreads of 0.06 to 0.12 and, as limbs turn relative to the sensor, trends of 0.15.
MAX_SPREAD = 0.15
MAX_TREND = 0.20


def detect(clip: Clip) -> list[Defect]:
    """The defects "impossible_limbs" (refused) and "bone_drift" (flagged), over the frames inside passes."""
    points = nodes_of(clip)[clip.passes >= 0]
    if not len(points):
        return []
    bones = {
        f"{side} {bone}": length(points, f"{start}_{side}", f"{end}_{side}")
        for bone, (start, end) in _BONES.items()
        for side in SIDES
    }
    return _impossible(points, bones) + _drifting(bones)


def _impossible(points: Array, bones: dict[str, Array]) -> list[Defect]:
    trunk = median(np.linalg.norm(between(points, "hips", "shoulders"), axis=-1))
    medians = {name: median(values) for name, values in bones.items()} | {"trunk": trunk}
    wrong = [
        f"{name} {value:.2f} m"
        for name, value in medians.items()
        if not np.isnan(value) and not _within(value, LENGTH_RANGES[name.split(" ", 1)[-1]])
    ]
    thigh, shank = (0.5 * (medians[f"left {bone}"] + medians[f"right {bone}"]) for bone in ("thigh", "shank"))
    leg = thigh + shank
    spread = max(_spread(bones[f"{side} {bone}"]) for side in SIDES for bone in ("thigh", "shank"))
    intro = ""
    if not wrong and leg < CHILD_LEG and spread > RIGID_SPREAD:
        if not _within(thigh / shank, CHILD_THIGH_TO_SHANK):
            wrong.append(f"thigh {thigh / shank:.2f} times the shank")
        if not np.isnan(trunk) and not _within(leg / trunk, CHILD_LEG_TO_TRUNK):
            wrong.append(f"leg {leg / trunk:.2f} times the trunk")
        # On its own, this only indicates a noisy sensor.
        if wrong and spread > CHILD_SPREAD:
            wrong.append(f"length of a leg bone varies by {100 * spread:.0f} %")
        intro = f"thigh {thigh:.2f} m and shank {shank:.2f} m, as in a small child, but "
    if not wrong:
        return []
    text = (
        f"impossible limb lengths: {intro}{', '.join(wrong)}: no body has them, so the sensor tracked "
        "something else (furniture, a treadmill), or columns or joint names are mixed up"
    )
    return [Defect("impossible_limbs", len(wrong), "measures", "refused", text)]


def _drifting(bones: dict[str, Array]) -> list[Defect]:
    drifting: list[tuple[float, str]] = []
    for name, values in bones.items():
        finite = values[np.isfinite(values)]
        if len(finite) < 10 or np.median(finite) == 0.0:
            continue
        fifth = max(len(finite) // 5, 1)
        usual, spread = float(np.median(finite)), _spread(finite)
        trend = float(np.median(finite[-fifth:]) - np.median(finite[:fifth])) / usual
        if spread > MAX_SPREAD or abs(trend) > MAX_TREND:
            drifting.append(
                (
                    max(spread / MAX_SPREAD, abs(trend) / MAX_TREND),
                    f"{name} ±{100 * spread:.0f} %, {100 * trend:+.0f} % over the clip",
                )
            )
    if not drifting:
        return []
    drifting.sort(reverse=True)
    text = "; ".join(text for _, text in drifting[:3])
    more = f"; and {len(drifting) - 3} more" if len(drifting) > 3 else ""
    return [Defect("bone_drift", len(drifting), "bones", "flagged", f"bone lengths change: {text}{more}")]


def _spread(values: Array) -> float:
    """Half the width of the middle 68 % over the median: a robust coefficient of variation."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0
    low, middle, high = np.percentile(finite, [16.0, 50.0, 84.0])
    return float(0.5 * (high - low) / middle) if middle > 0 else 0.0


def _within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]

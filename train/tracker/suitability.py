"""Which motions the trackers have learned, found in the motion itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion

# m: a knee, an elbow, a hand or the head below it is on the ground, or on its way there.
LOW = 0.15
LOWEST_HIP = 0.55  # of its height in standing, of a gait
LOWEST_SQUAT = 0.35  # the same of a motion on the spot: deeper is sitting
LARGEST_LEAN = np.radians(60.0)  # of the pelvis
SLOWEST_WALK = 0.3  # m/s
CLIMB = 0.25  # m, of the hip between start and end
# Radians of a path that climbs by more than CLIMB in the capture. People walk up a ramp almost as on level
# ground; paths steeper than one in eight, the steepest ramps that are built for walking, are stairs.
STEEP = np.arctan(1.0 / 8.0)
_PARTS = [*(f"{part}_{side}" for part in ("knee", "elbow", "wrist") for side in SIDES), "head"]


def without_strides(motion: Motion, report: Mapping[str, Any] | None = None) -> bool:
    """Whether a motion is an exercise or a gesture instead of a gait.

    report: its gait.json, if there is one, which lists the strides; without it, a motion that does not repeat
    and advances more slowly than anyone walks has none.
    """
    if report is not None and "kind" in report:
        return bool(report["kind"] == "motion")
    way = float(np.linalg.norm((motion.root[-1] - motion.root[0])[:2]))
    return not motion.cyclic and way < SLOWEST_WALK * motion.duration


def unsuitable(motion: Motion, report: Mapping[str, Any] | None = None) -> str | None:
    """What shows that a motion does not stay on its feet, on level ground; None if nothing does.

    No tracker has learned others.

    report: its gait.json, if there is one, which knows whether a loop's capture climbed.
    """
    if found := (report or {}).get("climb"):
        angle, rise = found.get("angle_deg") or 0.0, found.get("total_m") or 0.0
        if found.get("certain") and abs(rise) > CLIMB and abs(angle) > np.degrees(STEEP):
            return f"a walk that climbs or descends {abs(rise):.2f} m in the capture, at {abs(angle):.0f}°"
    positions, frames = motion.kinematics()
    for part in _PARTS:
        height = positions[:, NODE_INDEX[part], 2]
        if height.min() < LOW:
            where = int(np.argmin(height))
            name = part.replace("_", " ")
            return f"the {name} at {height[where]:.2f} m above the ground after {_seconds(motion, where)}"
    hip = positions[:, 0, 2]
    lowest = LOWEST_SQUAT if without_strides(motion, report) else LOWEST_HIP
    if hip.min() < lowest * STANDING_HEIGHT:
        where = int(np.argmin(hip))
        return f"the hips at {hip[where]:.2f} m above the ground after {_seconds(motion, where)}"
    up = rotate(frames[:, 0], np.broadcast_to([0.0, 0.0, 1.0], (len(frames), 3)))[:, 2]
    if up.min() < np.cos(LARGEST_LEAN):
        where = int(np.argmin(up))
        lean = np.degrees(np.arccos(np.clip(up[where], -1.0, 1.0)))
        return f"the pelvis leaning by {lean:.0f}° after {_seconds(motion, where)}"
    if (climb := abs(float(hip[-1] - hip[0]))) > CLIMB:
        return f"hips that rise or fall by {climb:.2f} m"
    return None


def _seconds(motion: Motion, frame: int) -> str:
    return f"{frame / motion.rate:.1f} s"

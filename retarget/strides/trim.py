"""Selection of the frames of a pass that show a walking person.

Bad edges are cut, bad frames within are flagged.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.angles import hip_flexion, knee_flexion
from kinemimic.pipeline.kinematics.rotations import from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

LEG_NODES: tuple[str, ...] = tuple(
    f"{joint}_{side}" for side in ("left", "right") for joint in ("hip", "knee", "ankle")
)
# Degrees; a walking knee peaks at 50 to 75, a running one at 90 to 125.
KNEE_LIMIT = {"walk": 85.0, "run": 140.0}
HIP_LIMITS = {"walk": (-50.0, 60.0), "run": (-60.0, 90.0)}
RUN_SPEED = 2.2  # m/s: above it an adult runs
MAX_BONE_DEVIATION = 0.30  # of a leg bone from its median length; beyond it, a tracking error
MIN_SPEED_SHARE = 0.60  # of the pass' median speed; below it the person starts, turns or stops


def leg_bones(positions: Array) -> Array:
    """Lengths (T, 4) in metres: left thigh, left shank, right thigh, right shank."""
    ends = [
        (f"{a}_{side}", f"{b}_{side}")
        for side in ("left", "right")
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]
    return np.stack(
        [np.linalg.norm(positions[:, N[b]] - positions[:, N[a]], axis=-1) for a, b in ends], axis=-1
    )


def forward_speed(times: Array, positions: Array, heading: float, span: float = 0.3) -> Array:
    """Speed (T,) of the middle of the hips along the heading, averaged over `span` seconds."""
    middle = positions[:, [N["hip_left"], N["hip_right"]], :2].mean(axis=1)
    along = middle @ np.array([np.cos(heading), np.sin(heading)])
    early, late = np.maximum(times - span / 2, times[0]), np.minimum(times + span / 2, times[-1])
    return np.asarray((np.interp(late, times, along) - np.interp(early, times, along)) / (late - early))


def bad_frames(times: Array, positions: Array, heading: float, bones: Array) -> Mask:
    """True (T,) where a leg is missing or in an impossible pose, or the person hardly advances.

    positions: (T, 20, 3); heading: radians; bones: (4,) usual lengths as `leg_bones` gives them.
    """
    legs = positions[:, [N[name] for name in LEG_NODES]]
    bad: Mask = np.asarray(~np.isfinite(legs).all(axis=(1, 2)))
    seen = np.flatnonzero(~bad)
    if len(seen) < 2:
        return np.ones(len(times), dtype=bool)
    p, t = positions[seen], times[seen]
    speed = forward_speed(t, p, heading)
    usual = float(np.median(speed))
    gait = "run" if usual > RUN_SPEED else "walk"
    wrong = np.abs(leg_bones(p) / bones - 1.0).max(axis=-1) > MAX_BONE_DEVIATION
    # A person who walks in place does not advance.
    if usual > 0.3:
        wrong |= speed < MIN_SPEED_SHARE * usual
    frame = from_axis_angle("Z", heading)
    lateral = np.array([-np.sin(heading), np.cos(heading), 0.0])
    for side in ("left", "right"):
        hip, knee, ankle = (p[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        wrong |= np.abs(np.degrees(knee_flexion(hip, knee, ankle, lateral))) > KNEE_LIMIT[gait]
        thigh = np.degrees(hip_flexion(np.broadcast_to(frame, (len(p), 4)), hip, knee))
        wrong |= (thigh < HIP_LIMITS[gait][0]) | (thigh > HIP_LIMITS[gait][1])
    bad[seen] = wrong
    return bad


def best_window(bad: Mask, price: float = 3.0) -> slice:
    """The run of frames with the most good ones, each bad one counting as minus `price` good ones."""
    score = np.where(bad, -price, 1.0)
    total = np.concatenate([[0.0], np.cumsum(score)])
    lowest = np.minimum.accumulate(total)
    end = int(np.argmax(total - lowest))
    start = int(np.argmin(total[: end + 1]))
    return slice(start, end)

"""Lengths and angles of the legs, and legs that no walker has: missing, stretched, or bent too far."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.angles import hip_flexion, knee_flexion
from kinemimic.pipeline.kinematics.rotations import from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES

# Degrees; a walking knee peaks at 50 to 75, a running one at 90 to 125.
KNEE_LIMIT = {"walk": 85.0, "run": 140.0}
HIP_LIMITS = {"walk": (-50.0, 60.0), "run": (-60.0, 90.0)}
# Where the bones keep their length, a pose is not a tracking error: the joints' own ranges, as for a walker
# in a crouch.
PRECISE_KNEE_LIMIT, PRECISE_HIP_LIMITS = 150.0, (-60.0, 135.0)
MAX_BONE_SPREAD = 0.025  # spread of a leg bone over its length; below it, the recording is precise
MAX_BONE_DEVIATION = 0.30  # of a leg bone from its median length; beyond it, a tracking error


def leg_bones(positions: Array) -> Array:
    """Lengths (T, 4) in metres: left thigh, left shank, right thigh, right shank."""
    ends = [(f"{a}_{side}", f"{b}_{side}") for side in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))]
    return np.stack(
        [np.linalg.norm(positions[:, N[b]] - positions[:, N[a]], axis=-1) for a, b in ends], axis=-1
    )


def is_precise(positions: Array) -> bool:
    """Whether the leg bones of positions (T, 20, 3) keep their length, as in an optical recording."""
    lengths = leg_bones(positions)
    if not np.isfinite(lengths).any(axis=0).all():
        return False
    return bool((np.nanstd(lengths, axis=0) < MAX_BONE_SPREAD * np.nanmean(lengths, axis=0)).all())


def leg_angles(positions: Array) -> Array:
    """Angles (T, 2, 2) in radians of both legs: between thigh and shank, and of the thigh forward from
    vertical.

    positions: (T, 20, 3) with X ahead and Z up.
    """
    out = []
    for side in SIDES:
        hip, knee, ankle = (positions[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        thigh, shank = knee - hip, ankle - knee
        across = np.linalg.norm(np.cross(thigh, shank), axis=-1)
        bend = np.arctan2(across, np.sum(thigh * shank, axis=-1))
        out.append(np.stack([bend, np.arctan2(thigh[:, 0], -thigh[:, 2])], axis=1))
    return np.stack(out, axis=1)


def impossible_legs(positions: Array, bones: Array, *, running: bool, precise: bool = False) -> Mask:
    """Frames (T, 2) in which the left or right leg is missing or in a pose that no walker takes.

    positions: (T, 20, 3) along +X with Z up; bones: (4,) usual lengths as `leg_bones` gives them; precise:
    whether the recording is accurate to a centimetre, so that only what no joint does is an error.
    """
    gait = "run" if running else "walk"
    most_bent = PRECISE_KNEE_LIMIT if precise else KNEE_LIMIT[gait]
    low, high = PRECISE_HIP_LIMITS if precise else HIP_LIMITS[gait]
    ahead = np.broadcast_to(from_axis_angle("Z", 0.0), (len(positions), 4))
    lateral = np.array([0.0, 1.0, 0.0])
    stretched = np.abs(leg_bones(positions) / bones - 1.0) > MAX_BONE_DEVIATION
    wrong = []
    for k, side in enumerate(SIDES):
        hip, knee, ankle = (positions[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        seen = (
            np.isfinite(hip).all(axis=-1) & np.isfinite(knee).all(axis=-1) & np.isfinite(ankle).all(axis=-1)
        )
        bend = np.abs(np.degrees(knee_flexion(hip, knee, ankle, lateral)))
        thigh = np.degrees(hip_flexion(ahead, hip, knee))
        bad = (bend > most_bent) | (thigh < low) | (thigh > high)
        wrong.append(~seen | bad | stretched[:, 2 * k : 2 * k + 2].any(axis=1))
    return np.stack(wrong, axis=1)

"""Clinical joint angles: flexion positive, 0 standing upright, in radians."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_two_axes, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

# The four curves that every score is about.
ANGLES: tuple[str, ...] = ("knee_left", "knee_right", "hip_left", "hip_right")
# Square metres; a child's pelvis spans a hundred square centimetres.
_FLAT = 1e-8
# Radians that a knee bends to the front at most; optical captures of the healthy show up to 11 degrees.
HYPEREXTENSION = np.radians(15.0)


def knee_flexion(hip: Array, knee: Array, ankle: Array, lateral: Array) -> Array:
    """Angle from the thigh's to the shank's direction (...,); negative in hyperextension.

    hip, knee, ankle: (..., 3) positions; lateral: (..., 3) axis from the right to the left hip, which only
    gives the sign (the shank turned backward is positive).
    """
    thigh, shank = knee - hip, ankle - knee
    normal = np.cross(thigh, shank)
    angle = np.arctan2(np.linalg.norm(normal, axis=-1), np.sum(thigh * shank, axis=-1))
    return np.asarray(np.where(np.sum(normal * lateral, axis=-1) < 0, -angle, angle))


def anatomical(knee: Array) -> Array:
    """Knee flexion (T,) in radians, frames in the sequence of time, as a knee can have it; NaN stays.

    No knee bends to the front by more than HYPEREXTENSION, and none gets there but through straight. A run of
    negative frames that goes further, or begins or ends with such a leap, has its sign from the noise of a
    sensor that sees the hips on nearly one spot, or the knee beside the leg: its size is the flexion's.
    """
    front = knee < 0
    run = np.where(front, np.cumsum(front & ~np.concatenate([[False], front[:-1]])), 0)
    wrong = np.zeros(int(run.max(initial=0)) + 1, dtype=bool)
    leaps = np.abs(np.diff(knee)) > HYPEREXTENSION
    for frames in (run[knee < -HYPEREXTENSION], run[1:][leaps], run[:-1][leaps]):
        wrong[frames] = True
    return np.where(front & wrong[run], -knee, knee)


def pelvis_frame(hip_left: Array, hip_right: Array, hip_center: Array, spine: Array) -> Array:
    """World frames (..., 4) of the pelvis from both hips and the spine: Y to the left hip, Z up the trunk."""
    return from_two_axes(hip_left - hip_right, spine - hip_center, "YZ")


def hip_flexion(pelvis: Array, hip: Array, knee: Array) -> Array:
    """Angle of the thigh in the pelvis' sagittal plane, forward positive; pelvis: (..., 4) world frames."""
    thigh = rotate(conjugate(pelvis), knee - hip)
    return np.arctan2(thigh[..., 0], -thigh[..., 2])


def leg_angles(positions: Array, pelvis: Array | None = None) -> dict[str, Array]:
    """The curves of ANGLES in radians from positions (T, 20, 3) of the 20 nodes, in the sequence of time.

    Without `pelvis` (T, 4) its frame is taken from both hips and the spine, which a Kinect sees badly: the
    hip's angle suffers, the knee's keeps its size, and its sign where that is possible (`anatomical`).
    Frames with a missing joint, or with the pelvis in one point, give NaN.
    """
    p = positions
    curves: dict[str, Array] = {}
    lateral = p[:, N["hip_left"]] - p[:, N["hip_right"]]
    trunk = p[:, N["spine"]] - p[:, N["hip_center"]]
    # A pelvis without a width, or with its spine along it, has no frame; NaN compares false.
    seen = np.linalg.norm(np.cross(lateral, trunk), axis=-1) > _FLAT
    frame = np.full((len(p), 4), np.nan)
    if pelvis is not None:
        frame = pelvis
        lateral = rotate(pelvis, np.broadcast_to([0.0, 1.0, 0.0], lateral.shape))
    elif seen.any():
        frame[seen] = pelvis_frame(
            p[seen, N["hip_left"]], p[seen, N["hip_right"]], p[seen, N["hip_center"]], p[seen, N["spine"]]
        )
    for side in ("left", "right"):
        hip, knee, ankle = (p[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        curves[f"knee_{side}"] = anatomical(knee_flexion(hip, knee, ankle, lateral))
        curves[f"hip_{side}"] = hip_flexion(frame, hip, knee)
    return {name: curves[name] for name in ANGLES}

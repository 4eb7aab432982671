"""Clinical joint angles: flexion positive, 0 standing upright, in radians."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_two_axes, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

# The four curves that are scored.
ANGLES: tuple[str, ...] = ("knee_left", "knee_right", "hip_left", "hip_right")
# Square metres; a child's pelvis spans 0.01.
_FLAT = 1e-8
# Largest hyperextension of a knee, radians; optical captures of healthy subjects show up to 11 degrees.
HYPEREXTENSION = np.radians(15.0)


def knee_flexion(hip: Array, knee: Array, ankle: Array, lateral: Array) -> Array:
    """Angle (...,) between thigh and shank in radians; negative in hyperextension.

    hip, knee, ankle: (..., 3) positions; lateral: (..., 3) axis from the right to the left hip, which gives
    only the sign (positive with the shank backward).
    """
    thigh, shank = knee - hip, ankle - knee
    normal = np.cross(thigh, shank)
    angle = np.arctan2(np.linalg.norm(normal, axis=-1), np.sum(thigh * shank, axis=-1))
    return np.asarray(np.where(np.sum(normal * lateral, axis=-1) < 0, -angle, angle))


def anatomical_knee(knee: Array) -> Array:
    """Knee flexion (T,) in radians, consecutive frames, with anatomically impossible signs corrected.

    A knee hyperextends by at most HYPEREXTENSION, and only by passing through straight. In a run of negative
    frames that goes further, or begins or ends with such a jump, the sign is noise of a sensor that sees the
    hips at nearly one point, or the knee beside the leg; the magnitude is the flexion. NaN stays.
    """
    front = knee < 0
    run = np.where(front, np.cumsum(front & ~np.concatenate([[False], front[:-1]])), 0)
    wrong = np.zeros(int(run.max(initial=0)) + 1, dtype=bool)
    leaps = np.abs(np.diff(knee)) > HYPEREXTENSION
    for frames in (run[knee < -HYPEREXTENSION], run[1:][leaps], run[:-1][leaps]):
        wrong[frames] = True
    return np.where(front & wrong[run], -knee, knee)


def pelvis_frame(hip_left: Array, hip_right: Array, hip_center: Array, spine: Array) -> Array:
    """World frames (..., 4) of the pelvis: Y from the right to the left hip, Z up the trunk."""
    return from_two_axes(hip_left - hip_right, spine - hip_center, "YZ")


def hip_flexion(pelvis: Array, hip: Array, knee: Array) -> Array:
    """Angle (...,) of the thigh in the pelvis' sagittal plane, forward positive; pelvis: (..., 4) frames."""
    thigh = rotate(conjugate(pelvis), knee - hip)
    return np.arctan2(thigh[..., 0], -thigh[..., 2])


def leg_angles(positions: Array, pelvis: Array | None = None) -> dict[str, Array]:
    """The curves (T,) of ANGLES in radians from positions (T, 20, 3) of the 20 nodes, consecutive frames.

    Without `pelvis` (T, 4), its world frame is taken from both hips and the spine, which a Kinect sees badly:
    the hip angle suffers; the knee angle keeps its magnitude, and `anatomical_knee` corrects its sign where
    it can. Frames with a missing joint, or with all of the pelvis at one point, give NaN.
    """
    p = positions
    curves: dict[str, Array] = {}
    lateral = p[:, N["hip_left"]] - p[:, N["hip_right"]]
    trunk = p[:, N["spine"]] - p[:, N["hip_center"]]
    # A pelvis without width, or with the spine along the hip line, has no frame; NaN compares false.
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
        curves[f"knee_{side}"] = anatomical_knee(knee_flexion(hip, knee, ankle, lateral))
        curves[f"hip_{side}"] = hip_flexion(frame, hip, knee)
    return {name: curves[name] for name in ANGLES}

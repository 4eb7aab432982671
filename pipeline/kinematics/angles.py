"""Clinical joint angles: flexion positive, 0 standing upright, in radians."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, from_two_axes, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES

# The four curves that are scored.
ANGLES: tuple[str, ...] = ("knee_left", "knee_right", "hip_left", "hip_right")
# Square metres; a child's pelvis spans 0.01.
_FLAT = 1e-8
# Largest hyperextension of a knee that a noisy sensor is believed, radians; optical captures of healthy
# subjects show up to 11 degrees. A sensor without noise is believed more, as in genu recurvatum.
HYPEREXTENSION, RECURVATUM = np.radians(15.0), np.radians(35.0)
# Knee speed above which a sign that changes is noise, radians a second: 15 degrees between the frames of a
# Kinect, which has 30 a second. A sensor without noise is believed the speed of a sprinter's knee.
LEAP_SPEED, STEADY_LEAP_SPEED = np.radians(450.0), np.radians(1200.0)
_KINECT_RATE = 30.0
# Spread (half the middle 68 % over the median) of the hips' distance and of the leg bones, above which a
# sensor is noisy: optical captures show up to 0.2 and 3 %, Kinects 2 to 30 and 4 to 16 %. Only a leg that
# moves shows it: range of the knee (5th to 95th percentile).
STEADY_HIPS, STEADY_BONE, MOVING_KNEE = 0.01, 0.035, np.radians(20.0)


def knee_flexion(hip: Array, knee: Array, ankle: Array, lateral: Array) -> Array:
    """Angle (...,) between thigh and shank in radians; negative in hyperextension.

    hip, knee, ankle: (..., 3) positions; lateral: (..., 3) axis from the right to the left hip, which gives
    only the sign (positive with the shank backward).
    """
    thigh, shank = knee - hip, ankle - knee
    normal = np.cross(thigh, shank)
    angle = np.arctan2(np.linalg.norm(normal, axis=-1), np.sum(thigh * shank, axis=-1))
    return np.asarray(np.where(np.sum(normal * lateral, axis=-1) < 0, -angle, angle))


def steady_leg(hips: Array, thigh: Array, shank: Array) -> bool:
    """Whether the distances between hips, hip and knee, knee and ankle, (T, 3) each, are those of one body
    while its knee moves: then the sign of the knee is not noise."""
    limits = ((hips, STEADY_HIPS), (thigh, STEADY_BONE), (shank, STEADY_BONE))
    lengths = [np.linalg.norm(vectors, axis=-1) for vectors, _ in limits]
    seen = np.isfinite(np.sum(lengths, axis=0)) & (np.min(lengths, axis=0) > 0.0)
    if seen.sum() < 4:
        return False
    for length, (_, limit) in zip(lengths, limits, strict=True):
        low, middle, high = np.percentile(length[seen], [16.0, 50.0, 84.0])
        if 0.5 * (high - low) > limit * middle:
            return False
    with np.errstate(invalid="ignore", over="ignore"):  # a damaged file may hold any number
        cosine = np.sum(thigh[seen] * shank[seen], axis=-1) / lengths[1][seen] / lengths[2][seen]
    bend = np.arccos(np.clip(cosine, -1.0, 1.0))
    return bool(np.ptp(np.percentile(bend, [5.0, 95.0])) > MOVING_KNEE)


def anatomical_knee(knee: Array, times: Array | None = None, *, steady: bool = False) -> Array:
    """Knee flexion (T,) in radians, consecutive frames, with anatomically impossible signs corrected.

    A knee hyperextends by at most HYPEREXTENSION (RECURVATUM if the leg is `steady_leg`), and only by passing
    through straight. In a run of negative frames that goes further, or begins or ends with a jump, the sign
    is noise of a sensor that sees the hips at nearly one point, or the knee beside the leg; the magnitude is
    the flexion. A jump is more than HYPEREXTENSION, and faster than LEAP_SPEED (STEADY_LEAP_SPEED). times:
    (T,) seconds of the frames, without which they are those of a Kinect. NaN stays.
    `quality/rules/knee_sign.py` reports both cases.
    """
    limit = RECURVATUM if steady else HYPEREXTENSION
    step = 1.0 / _KINECT_RATE if times is None else np.diff(times)
    jump = np.fmax(HYPEREXTENSION, step * (STEADY_LEAP_SPEED if steady else LEAP_SPEED))
    front = knee < 0
    run = np.where(front, np.cumsum(front & ~np.concatenate([[False], front[:-1]])), 0)
    wrong = np.zeros(int(run.max(initial=0)) + 1, dtype=bool)
    leaps = np.abs(np.diff(knee)) > jump
    for frames in (run[knee < -limit], run[1:][leaps], run[:-1][leaps]):
        wrong[frames] = True
    return np.where(front & wrong[run], -knee, knee)


def pelvis_frame(hip_left: Array, hip_right: Array, hip_center: Array, spine: Array) -> Array:
    """World frames (..., 4) of the pelvis: Y from the right to the left hip, Z up the trunk."""
    return from_two_axes(hip_left - hip_right, spine - hip_center, "YZ")


def hip_flexion(pelvis: Array, hip: Array, knee: Array) -> Array:
    """Angle (...,) of the thigh in the pelvis' sagittal plane, forward positive; pelvis: (..., 4) frames."""
    thigh = rotate(conjugate(pelvis), knee - hip)
    return np.arctan2(thigh[..., 0], -thigh[..., 2])


def leg_angles(
    positions: Array,
    pelvis: Array | None = None,
    *,
    times: Array | None = None,
    knees: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """The curves (T,) of ANGLES in radians from positions (T, 20, 3) of the 20 nodes, consecutive frames.

    Without `pelvis` (T, 4), its world frame is taken from both hips and the spine, which a Kinect sees badly:
    the hip angle suffers; the knee angle keeps its magnitude, and `anatomical_knee` corrects its sign where
    it can, by the times (T,) in seconds. Frames with a missing joint, or with all of the pelvis at one point,
    give NaN. knees: flexion (T,) by name where it is known from rotations (`rest_pose.recorded_knees`).
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
    for side in SIDES:
        hip, knee, ankle = (p[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        steady = steady_leg(p[:, N["hip_left"]] - p[:, N["hip_right"]], knee - hip, ankle - knee)
        name = f"knee_{side}"
        flexion = knees[name] if knees else knee_flexion(hip, knee, ankle, lateral)
        curves[name] = anatomical_knee(flexion, times, steady=steady)
        curves[f"hip_{side}"] = hip_flexion(frame, hip, knee)
    return {name: curves[name] for name in ANGLES}

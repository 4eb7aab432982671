"""Body measurements of a capture: bone lengths, joint angles, noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask, States
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.body_points import length, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import recorded_knees
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES, TRACKED
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.quality.joint_statistics import joint_statistics

# The ends of each segment, per side, or once for the trunk.
SEGMENTS: dict[str, tuple[str, str]] = {
    "thigh": ("hip_{}", "knee_{}"),
    "shank": ("knee_{}", "ankle_{}"),
    "upper_arm": ("shoulder_{}", "elbow_{}"),
    "forearm": ("elbow_{}", "wrist_{}"),
    "trunk": ("hip_center", "shoulder_center"),
}
# Thigh plus shank as a share of the stature: 0.245 + 0.246 (Drillis and Contini 1966; Winter 2009, fig. 4.1).
LEG_TO_STATURE = 0.491
# Percentile of peaks and ranges: ignores single outlier frames.
TAIL = 5.0
# Time steps within this share of the median step count as even, for the noise estimate.
STEP_TOLERANCE = 0.5


def available_nodes(clip: Clip) -> tuple[Array, States, str | None]:
    """Positions (T, 20, 3) and states (T, 20) of the available nodes, and an error message or None.

    If the full set cannot be computed (half a body, impossible lengths), only the joints found by name are
    given, the others are NaN, and the message says why.
    """
    try:
        return *to_nodes(clip), None
    except KinemimicError as error:
        positions = nodes_of(clip)
        states = np.zeros(positions.shape[:2], dtype=np.uint8)
        for node, joint in joints_by_name(clip.skeleton.names).items():
            states[:, NODE_INDEX[node]] = clip.states[:, joint]
        return positions, states, str(error)


def segment_lengths(nodes: Array) -> dict[str, dict[str, float | None]]:
    """Per segment: length of the left, the right and the median in metres, and coefficient of variation.

    nodes: (T, 20, 3). The median pools both sides; cv (standard deviation over mean) is the larger one.
    """
    report: dict[str, dict[str, float | None]] = {}
    for segment, (start, end) in SEGMENTS.items():
        sides = SIDES if "{}" in start else ("",)
        lengths = {side: length(nodes, start.format(side), end.format(side)) for side in sides}
        seen = {side: values[np.isfinite(values)] for side, values in lengths.items()}
        both = np.concatenate(list(seen.values()))
        variations = [float(np.std(s) / np.mean(s)) for s in seen.values() if len(s) and np.mean(s) > 0]
        report[segment] = {
            **({side: rounded(median(values), 4) for side, values in seen.items()} if sides != ("",) else {}),
            "median": rounded(median(both), 4),
            "cv": rounded(max(variations), 4) if variations else None,
        }
    return report


def stature(lengths: dict[str, dict[str, float | None]]) -> float | None:
    """Estimated stature in metres from `segment_lengths`: thigh plus shank over LEG_TO_STATURE."""
    thigh, shank = lengths["thigh"]["median"], lengths["shank"]["median"]
    return None if thigh is None or shank is None else rounded((thigh + shank) / LEG_TO_STATURE, 3)


def leg_angle_ranges(
    nodes: Array, states: States, times: Array | None = None, knees: Mapping[str, Array] | None = None
) -> dict[str, Any]:
    """Ranges of knee and hip angles per side (percentiles TAIL and 100 - TAIL, degrees), and the knee's peak.

    nodes: (T, 20, 3), states: (T, 20), times, knees: as for `leg_angles`, of frames inside passes. The peak
    is taken from the better-tracked side: the side whose hip, knee and ankle are tracked in more frames, then
    the side whose thigh and shank vary less. If both are equal (rigid bones of a model), it is the mean of
    the two sides.
    """
    curves = {name: np.degrees(curve) for name, curve in leg_angles(nodes, times=times, knees=knees).items()}
    report: dict[str, Any] = {"knee": {}, "hip": {}}
    for name in ANGLES:
        joint, side = name.rsplit("_", 1)
        seen = curves[name][np.isfinite(curves[name])]
        low, high = np.percentile(seen, [TAIL, 100.0 - TAIL]) if len(seen) else (np.nan, np.nan)
        report[joint][side] = {"low_deg": rounded(low, 2), "high_deg": rounded(high, 2)}
    peaks = [report["knee"][side]["high_deg"] for side in SIDES]
    merits = [_tracking_quality(nodes, states, side) for side in SIDES]
    report["knee_peak_side"], report["knee_peak_deg"] = None, None
    if None in peaks:
        only = [(side, peak) for side, peak in zip(SIDES, peaks, strict=True) if peak is not None]
        if only:
            report["knee_peak_side"], report["knee_peak_deg"] = only[0]
    elif merits[0] == merits[1]:
        report["knee_peak_side"], report["knee_peak_deg"] = "both", rounded(sum(peaks) / 2.0, 2)
    else:
        better = int(merits[1] > merits[0])
        report["knee_peak_side"], report["knee_peak_deg"] = SIDES[better], peaks[better]
    return report


def recorded_angles(clip: Clip, nodes: Array, inside: Mask) -> dict[str, dict[str, Any]]:
    """The angles in the file, by name; those of ANGLES compared with ours: r, median difference in degrees.

    nodes: (T, 20, 3) and inside: (T,) of the clip. The difference is recorded minus computed.
    """
    ours = leg_angles(nodes, times=clip.times, knees=recorded_knees(clip))
    report: dict[str, dict[str, Any]] = {}
    for name, curve in sorted((clip.angles or {}).items()):
        one: dict[str, Any] = {"frames": int(np.isfinite(curve[inside]).sum())}
        if name in ours:
            both = inside & np.isfinite(curve) & np.isfinite(ours[name])
            theirs, mine = np.degrees(curve[both]), np.degrees(ours[name][both])
            varied = both.sum() > 2 and np.ptp(theirs) > 1e-9 and np.ptp(mine) > 1e-9
            one["r"] = rounded(np.corrcoef(theirs, mine)[0, 1], 4) if varied else None
            one["difference_deg"] = rounded(median(theirs - mine), 2)
        report[name] = one
    return report


def joint_quality(clip: Clip, inside: Mask) -> dict[str, dict[str, float | None]]:
    """`joint_statistics` of the frames `inside` (T,), and jitter_mm (see `jitter`), by joint name."""
    report = joint_statistics(clip, inside)
    for joint, noise in zip(report.values(), jitter(clip, inside), strict=True):
        joint["jitter_mm"] = rounded(1e3 * noise, 2)
    return report


def jitter(clip: Clip, inside: Mask) -> Array:
    """White noise (J,) in metres of each joint's position, over all three axes; NaN if unknown.

    The third difference of evenly spaced samples contains hardly any motion, and 20 times the variance of the
    noise (1, 3, 3, 1 squared and summed). Its median excludes spikes and fast movements; 1.4826 converts the
    median to a standard deviation.
    """
    result = np.full(clip.positions.shape[1], np.nan)
    steps = np.diff(clip.times)
    within = (clip.passes[1:] == clip.passes[:-1]) & inside[1:] & inside[:-1]
    if within.sum() < 3:
        return result
    even = within & (np.abs(steps / np.median(steps[within]) - 1.0) < STEP_TOLERANCE)
    window = even[2:] & even[1:-1] & even[:-2]
    third = np.abs(np.diff(clip.positions, n=3, axis=0)[window])
    for joint in range(third.shape[1]):
        values = third[:, joint][np.isfinite(third[:, joint]).all(axis=-1)]
        if len(values):
            result[joint] = np.linalg.norm(1.4826 * np.median(values, axis=0)) / np.sqrt(20.0)
    return result


def _tracking_quality(nodes: Array, states: States, side: str) -> tuple[float, float]:
    """Larger is better: share of tracked leg joints, and minus the variation of the leg's bones."""
    leg = [NODE_INDEX[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle")]
    variation = 0.0
    for start, end in (SEGMENTS["thigh"], SEGMENTS["shank"]):
        bone = length(nodes, start.format(side), end.format(side))
        bone = bone[np.isfinite(bone)]
        variation += float(np.std(bone) / np.mean(bone)) if len(bone) and np.mean(bone) > 0 else 1.0
    return round(_share(states[:, leg] == TRACKED), 2), -round(variation, 4)


def _share(mask: Mask) -> float:
    return float(np.mean(mask)) if mask.size else float("nan")

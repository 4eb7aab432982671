"""What a capture says of the body in it: lengths, angles, noise, as plain numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask, States
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes, to_nodes
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, NODES, TRACKED

# Each bone's ends, per side, or once for the trunk.
SEGMENTS: dict[str, tuple[str, str]] = {
    "thigh": ("hip_{}", "knee_{}"),
    "shank": ("knee_{}", "ankle_{}"),
    "upper_arm": ("shoulder_{}", "elbow_{}"),
    "forearm": ("elbow_{}", "wrist_{}"),
    "trunk": ("hip_center", "shoulder_center"),
}
SIDES: tuple[str, str] = ("left", "right")
# Thigh plus shank as a share of the stature: 0.245 + 0.246 (Drillis and Contini 1966; Winter 2009, fig. 4.1).
LEG_OF_STATURE = 0.491
# Peaks and ranges leave out this share of the frames at either end: single wild frames are no peak.
TAIL = 5.0
# Steps of the clock within this share of the usual one count as even, for the noise.
EVEN = 0.5


def nodes_of(clip: Clip) -> tuple[Array, States, str | None]:
    """Positions (T, 20, 3) and states (T, 20) of the 20 nodes as far as they can be had, and what is wrong.

    Where the whole set cannot be had (half a body, lengths that are no human's), the joints that are found
    by name stand alone, the others NaN, and the third value says why.
    """
    try:
        return *to_nodes(clip), None
    except KinemimicError as error:
        positions = np.full((len(clip.times), len(NODES), 3), np.nan)
        states = np.zeros(positions.shape[:2], dtype=np.uint8)
        for node, joint in joints_of_nodes(clip.skeleton.names).items():
            positions[:, NODE_INDEX[node]] = clip.positions[:, joint]
            states[:, NODE_INDEX[node]] = clip.states[:, joint]
        return positions, states, str(error)


def bones(nodes: Array) -> dict[str, dict[str, float | None]]:
    """Per segment left, right and median length in metres, and spread (standard deviation over mean).

    nodes: (T, 20, 3). The median is of both sides' frames together; the spread is the larger one.
    """
    report: dict[str, dict[str, float | None]] = {}
    for segment, (start, end) in SEGMENTS.items():
        sides = SIDES if "{}" in start else ("",)
        lengths = {side: _length(nodes, start.format(side), end.format(side)) for side in sides}
        seen = {side: length[np.isfinite(length)] for side, length in lengths.items()}
        both = np.concatenate(list(seen.values()))
        spreads = [float(np.std(s) / np.mean(s)) for s in seen.values() if len(s) and np.mean(s) > 0]
        report[segment] = {
            **({side: rounded(median(length), 4) for side, length in seen.items()} if sides != ("",) else {}),
            "median": rounded(median(both), 4),
            "spread": rounded(max(spreads), 4) if spreads else None,
        }
    return report


def stature(lengths: dict[str, dict[str, float | None]]) -> float | None:
    """An estimate in metres from `bones`: legs over LEG_OF_STATURE."""
    thigh, shank = lengths["thigh"]["median"], lengths["shank"]["median"]
    return None if thigh is None or shank is None else rounded((thigh + shank) / LEG_OF_STATURE, 3)


def legs(nodes: Array, states: States) -> dict[str, Any]:
    """Knee and hip per side as the TAIL and 100 - TAIL percentiles in degrees, and the knee's peak.

    nodes: (T, 20, 3), states: (T, 20), frames inside passes. The peak is that of the better-tracked side: the
    one whose hip, knee and ankle are tracked in more frames, and among equals the one whose thigh and shank
    vary less; where that too is equal (a model's rigid bones), the mean of both sides.
    """
    curves = {name: np.degrees(curve) for name, curve in leg_angles(nodes).items()}
    report: dict[str, Any] = {"knee": {}, "hip": {}}
    for name in ANGLES:
        joint, side = name.rsplit("_", 1)
        seen = curves[name][np.isfinite(curves[name])]
        low, high = np.percentile(seen, [TAIL, 100.0 - TAIL]) if len(seen) else (np.nan, np.nan)
        report[joint][side] = {"low_deg": rounded(low, 2), "high_deg": rounded(high, 2)}
    peaks = [report["knee"][side]["high_deg"] for side in SIDES]
    merits = [_merit(nodes, states, side) for side in SIDES]
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
    """The recorder's own curves, by name; those of ANGLES against ours: r, median difference in degrees.

    nodes: (T, 20, 3) and inside: (T,) of the clip. The difference is the recorder's minus ours.
    """
    ours = leg_angles(nodes)
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


def joints(clip: Clip, inside: Mask) -> dict[str, dict[str, float | None]]:
    """Joint by joint the shares of frames in passes in each state, the bone to its parent, and its jitter.

    bone_m, bone_spread: median length in metres, standard deviation over mean; None for a root and for a bone
    of no length. jitter_mm: see `jitter`.
    """
    noise = jitter(clip, inside)
    report: dict[str, dict[str, float | None]] = {}
    for joint, name in enumerate(clip.skeleton.names):
        states, parent = clip.states[inside, joint], clip.skeleton.parents[joint]
        length = spread = None
        if parent >= 0:
            bone = np.linalg.norm(clip.positions[inside, joint] - clip.positions[inside, parent], axis=-1)
            bone = bone[np.isfinite(bone)]
            if len(bone) and np.median(bone) > 1e-6:
                length, spread = rounded(median(bone), 4), rounded(np.std(bone) / np.mean(bone), 4)
        report[name] = {
            "tracked": rounded(_share(states == TRACKED), 4),
            "inferred": rounded(_share(states == INFERRED), 4),
            "lost": rounded(_share(states == MISSING), 4),
            "bone_m": length,
            "bone_spread": spread,
            "jitter_mm": rounded(1e3 * noise[joint], 2),
        }
    return report


def jitter(clip: Clip, inside: Mask) -> Array:
    """White noise (J,) in metres of each joint's position, all three axes together; NaN where unknown.

    The third difference of evenly spaced samples hardly holds any motion, and 20 times the noise's variance
    (1, 3, 3, 1 squared and summed); its median keeps spikes and fast moments out, 1.4826 makes it a standard
    deviation.
    """
    result = np.full(clip.positions.shape[1], np.nan)
    steps = np.diff(clip.times)
    within = (clip.passes[1:] == clip.passes[:-1]) & inside[1:] & inside[:-1]
    if within.sum() < 3:
        return result
    even = within & (np.abs(steps / np.median(steps[within]) - 1.0) < EVEN)
    window = even[2:] & even[1:-1] & even[:-2]
    third = np.abs(np.diff(clip.positions, n=3, axis=0)[window])
    for joint in range(third.shape[1]):
        values = third[:, joint][np.isfinite(third[:, joint]).all(axis=-1)]
        if len(values):
            result[joint] = np.linalg.norm(1.4826 * np.median(values, axis=0)) / np.sqrt(20.0)
    return result


def median(values: Array) -> float:
    """The median, NaN of nothing."""
    return float(np.median(values)) if len(values) else float("nan")


def _length(nodes: Array, start: str, end: str) -> Array:
    return np.asarray(np.linalg.norm(nodes[:, NODE_INDEX[end]] - nodes[:, NODE_INDEX[start]], axis=-1))


def _merit(nodes: Array, states: States, side: str) -> tuple[float, float]:
    """Larger is better: share of tracked leg joints, and minus the spread of the leg's bones."""
    leg = [NODE_INDEX[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle")]
    spread = 0.0
    for start, end in (SEGMENTS["thigh"], SEGMENTS["shank"]):
        length = _length(nodes, start.format(side), end.format(side))
        length = length[np.isfinite(length)]
        spread += float(np.std(length) / np.mean(length)) if len(length) and np.mean(length) > 0 else 1.0
    return round(_share(states[:, leg] == TRACKED), 2), -round(spread, 4)


def _share(mask: Mask) -> float:
    return float(np.mean(mask)) if mask.size else float("nan")

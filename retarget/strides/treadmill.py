"""Treadmills: the belt's speed from the feet in contact, and the walk converted to overground walking.

A person on a treadmill stays in place. A foot flat on the belt moves backward with it, lower than in its
forward swing and alike in every stride. If both feet show this, the belt's travel is added to the person's
position. Foot-flat phases and their speeds are measured as in the gait report (`gait.events`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.events import FootEvents, detect_foot_events
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.harmonic import walking_direction

MIN_FRAMES = 8  # frames
MIN_STROKES = 1  # foot-flat phases of each foot
MIN_DURATION = 2.0  # s of a pass: a single swing of the legs is not a walk
MIN_SPEED = 0.3  # m/s of the belt
MAX_SPREAD = 0.3  # median deviation of the strokes' speeds from their running median, over the median speed
MAX_TRAVEL = 0.15  # of the belt's travel, by which the person may move
MEDIAN_STROKES = 9  # strokes of both feet in the running median of the belt's speed


def add_belt_travel(clip: Clip) -> tuple[Clip, dict[int, float]]:
    """The clip on the 20 nodes with the belt's travel added to every pass on a treadmill, and the belt's mean
    speed in m/s by pass number.
    """
    positions = clip.positions.copy()
    speeds: dict[int, float] = {}
    for number in np.unique(clip.passes[clip.passes >= 0]):
        rows = np.flatnonzero(clip.passes == number)
        belt_travel = _belt_travel(clip.times[rows], clip.positions[rows])
        if belt_travel is not None:
            heading, travel = belt_travel
            positions[rows] += travel[:, None, None] * np.array([np.cos(heading), np.sin(heading), 0.0])
            speeds[int(number)] = float(travel[-1] / np.ptp(clip.times[rows]))
    return (replace(clip, positions=positions) if speeds else clip), speeds


def _belt_travel(times: Array, positions: Array) -> tuple[float, Array] | None:
    """Heading in radians and the belt's travel (T,) in metres; None if nobody walks on a treadmill."""
    hips = positions[:, [N["hip_left"], N["hip_right"]], :2]
    if np.ptp(times) < MIN_DURATION or np.isfinite(hips).all(axis=(1, 2)).sum() < MIN_FRAMES:
        return None
    heading, on_path = walking_direction(positions)
    along = np.array([np.cos(heading), np.sin(heading)])
    feet = detect_foot_events(times, positions)
    if on_path or feet is None or not all(_is_carried(feet, k) for k in range(2)):
        return None
    stroke_times, strokes = np.concatenate(feet.belt_contacts, axis=1)
    order = np.argsort(stroke_times)
    stroke_times, strokes = stroke_times[order], strokes[order]
    smoothed = median_filter(strokes, size=min(MEDIAN_STROKES, len(strokes)), mode="nearest")
    usual_speed = float(np.median(smoothed))
    if usual_speed < MIN_SPEED or np.median(np.abs(strokes - smoothed)) > MAX_SPREAD * usual_speed:
        return None
    speed_at = np.interp(times, stroke_times, smoothed)
    travel = np.concatenate([[0.0], np.cumsum(0.5 * (speed_at[1:] + speed_at[:-1]) * np.diff(times))])
    middle = hips.mean(axis=1) @ along
    if np.ptp(middle[np.isfinite(middle)]) > MAX_TRAVEL * travel[-1]:
        return None
    return heading, travel


def _is_carried(feet: FootEvents, foot: int) -> bool:
    """Whether a foot moves backward often enough and lower than forward."""
    speed = np.gradient(np.einsum("tc,tc->t", feet.ankles[:, foot, :2] - feet.pelvis[:, :2], feet.forward))
    back, ahead = np.maximum(-speed, 0.0), np.maximum(speed, 0.0)
    height = feet.ankles[:, foot, 2]
    return feet.belt_contacts[foot].shape[1] >= MIN_STROKES and bool(
        back @ height / back.sum() < ahead @ height / ahead.sum()
    )

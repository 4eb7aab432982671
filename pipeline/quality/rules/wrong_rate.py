"""A gait too fast or too slow for a human: the clock, not the walker, is wrong.

Strides of 0.45 to 2.5 s are all human, so that a rate wrong by a factor of two mostly shows otherwise: ankles
part as fast as a sprinter's, on knees that bend as a walker's. How wrong the rate is does not follow from
either. So this is flagged, never repaired.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import bend, between, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.quality.rules.defect import Defect

# A sprinter's stride takes 0.45 s; a patient's slowest walk hardly more than 2.
HUMAN = (0.45, 2.5)
# Knees that swing by this much, strides alike to this degree, and legs that take turns make a gait.
SWING = np.radians(35.0)
ALIKE = 0.6
IN_TURN = 0.3
STRIDES = 2.2
# Horizontal m/s below which ankles part for nine tenths of the time: brisk walks 5.0, runs 4.3 to 6.8. Only
# who bends the knees by more than this (95th percentile) runs: runs 94 to 130 degrees, walks to 77.
PARTING = 5.4
RUNNING_KNEES = np.radians(85.0)
PARTING_SPAN = 0.1  # s


def detect(clip: Clip) -> list[Defect]:
    """Flagged if the longest pass is a steady gait with a stride that no human has, or sprints on a walker's
    knees."""
    spans = [
        span for number in range(int(clip.passes.max(initial=-1)) + 1) for span in runs(clip.passes == number)
    ]
    if not spans:
        return []
    span = max(spans, key=lambda one: float(clip.times[one.stop - 1] - clip.times[one.start]))
    points, rate = nodes_of(clip)[span], clip.rate
    period = stride_duration(points, clip.times[span])
    if period is not None and not HUMAN[0] <= period <= HUMAN[1]:
        text = (
            f"at {rate:.4g} Hz a stride takes {period:.2f} s, outside of {HUMAN[0]:g} to {HUMAN[1]:g} s: "
            f"a usual stride of 1.1 s would mean {rate * period / 1.1:.3g} Hz"
        )
        return [Defect("wrong_rate", len(clip.times), "frames", "flagged", text)]
    speed, usual = ankle_speed(points, clip.times[span]), _usual_bend(points)
    if speed < PARTING or usual > RUNNING_KNEES:
        return []
    text = (
        f"at {rate:.4g} Hz the ankles part at {speed:.1f} m/s, a sprinter's speed, on knees that bend "
        f"{np.degrees(usual):.0f}°, a walker's: fewer frames a second were recorded than that"
    )
    return [Defect("wrong_rate", len(clip.times), "frames", "flagged", text)]


def ankle_speed(points: Array, times: Array) -> float:
    """Horizontal speed, m/s, below which the ankles part for nine tenths of the time; 0 if nobody knows."""
    reach = max(1, round(0.5 * PARTING_SPAN / float(np.median(np.diff(times)))))
    if len(times) <= 2 * reach:
        return 0.0
    apart = between(points, "ankle_left", "ankle_right")[:, :2]
    speed = np.linalg.norm(apart[2 * reach :] - apart[: -2 * reach], axis=1)
    speed = speed / (times[2 * reach :] - times[: -2 * reach])
    there = speed[np.isfinite(speed)]
    return float(np.percentile(there, 90.0)) if len(there) else 0.0


def _usual_bend(points: Array) -> float:
    bends = np.concatenate([bend(points, side) for side in ("left", "right")])
    there = bends[np.isfinite(bends)]
    return float(np.percentile(there, 95.0)) if len(there) else 0.0


def stride_duration(points: Array, times: Array) -> float | None:
    """Seconds of a stride, from the difference of the knees' angles; None without a gait.

    points: (T, 20, 3) of the nodes; times: (T,).
    """
    knees = np.stack([bend(points, "left"), bend(points, "right")], axis=1)
    whole = np.isfinite(knees).all(axis=1)
    if whole.sum() < 12 or whole.mean() < 0.8:
        return None
    even = np.linspace(times[0], times[-1], len(times))
    left, right = (np.interp(even, times[whole], knees[whole, side]) for side in (0, 1))
    if min(np.ptp(np.percentile(curve, [5.0, 95.0])) for curve in (left, right)) < SWING:
        return None
    if np.corrcoef(left, right)[0, 1] > IN_TURN:
        return None
    wave = left - right - np.mean(left - right)
    size = 1 << (2 * len(wave) - 1).bit_length()
    power = np.abs(np.fft.rfft(wave, size)) ** 2
    likeness = np.fft.irfft(power, size)[: len(wave)]
    # Of two stretches that overlap less there is less to multiply.
    likeness = likeness / likeness[0] * len(wave) / np.arange(len(wave), 0, -1)
    last = int(len(wave) / STRIDES)
    below = np.flatnonzero(likeness[:last] < 0.0)
    if not len(below):
        return None
    # The highest of the peaks that follow the first trough is a stride or several: the first nearly as high.
    rest = likeness[below[0] : last]
    peaks = np.flatnonzero((rest[1:-1] >= rest[:-2]) & (rest[1:-1] > rest[2:])) + 1
    high = peaks[rest[peaks] > max(ALIKE, 0.9 * float(rest[peaks].max(initial=0.0)))]
    return None if not len(high) else float((below[0] + high[0]) * (even[1] - even[0]))

"""Detects a frame rate that makes the gait too fast or too slow for a human. Flagged only.

Human strides last 0.45 to 2.5 s, so the stride alone rarely reveals a rate that is wrong by a factor of two.
The second test is the speed of the ankles relative to each other: as fast as a sprinter's, on knees that bend
like a walker's. A swinging foot is two and a half to three times as fast as the walker, so brisk walkers
(2 m/s) and race walkers reach that speed too. But people lengthen their steps as they quicken them, and a
recording that plays too fast has short, quick ones. A slow walk at twice its rate looks like a brisk one:
that cannot be known. Neither test reveals the true rate.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.body_points import bend, between, length, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.quality.rules.defect import Defect

# Seconds. A sprinter's stride takes 0.45 s; the slowest walk of a patient hardly more than 2 s.
HUMAN_STRIDE = (0.45, 2.5)
# A gait: range of the knee angle, autocorrelation at the stride, greatest correlation of left and right knee,
# and number of strides in the pass.
MIN_KNEE_RANGE = np.radians(35.0)
MIN_AUTOCORRELATION = 0.6
MAX_SIDE_CORRELATION = 0.3
MIN_STRIDES = 2.2
# Share by which strides as counted may differ from the one after which the knees repeat; and of the standard
# deviation of their difference, by which a knee is the more bent one.
MAX_COUNT_ERROR = 0.3
MIN_SIDE_LEAD = 0.5
# 90th percentile of the horizontal speed between the ankles, m/s: brisk walks 5.0, runs 4.3 to 6.8. Only
# runners bend the knees by more than this (95th percentile): runs 94 to 130 degrees, walks up to 77.
MAX_WALKING_ANKLE_SPEED = 5.4
RUNNING_KNEES = np.radians(85.0)
ANKLE_SPEED_WINDOW = 0.1  # s
# Faster than the ankles of a walk at 2.3 m/s: too fast even if the steps are not known.
MAX_BRISK_ANKLE_SPEED = 6.5
# Steps per second times sqrt(leg / g), and step over leg per such cadence (see assumed_rate.py). 21 walks of
# the CMU library up to 1.8 m/s: 0.36 to 0.64 and 1.3 to 2.6; at twice their rate, 0.88 to 1.3 and 0.64 to
# 1.23, but for two slow ones. Race walkers: 200 steps/min of 1.1 m on a leg of 0.88 m are 1.0 and 1.25.
QUICK_CADENCE, MIN_QUICK_WALK_RATIO = 0.85, 1.15


def detect(clip: Clip) -> list[Defect]:
    """The defect "wrong_rate", flagged, from the gait in the longest pass."""
    spans = [
        span for number in range(int(clip.passes.max(initial=-1)) + 1) for span in runs(clip.passes == number)
    ]
    if not spans:
        return []
    span = max(spans, key=lambda one: float(clip.times[one.stop - 1] - clip.times[one.start]))
    points, rate = nodes_of(clip)[span], clip.rate
    period = stride_duration(points, clip.times[span])
    counted = None if period is None else mean_stride(points, clip.times[span])
    if period is not None and counted is not None and abs(counted / period - 1.0) > MAX_COUNT_ERROR:
        # Of a gait that changes, the knees may repeat after several strides, or after a part of one.
        period = None
    if period is not None and not HUMAN_STRIDE[0] <= period <= HUMAN_STRIDE[1]:
        text = (
            f"at {rate:.4g} Hz a stride takes {period:.2f} s, outside {HUMAN_STRIDE[0]:g} to "
            f"{HUMAN_STRIDE[1]:g} s; a typical stride of 1.1 s would mean {rate * period / 1.1:.3g} Hz; "
            "give the true rate as --rate"
        )
        return [Defect("wrong_rate", len(clip.times), "frames", "flagged", text)]
    speed, usual = ankle_speed(points, clip.times[span]), usual_bend(points)
    if speed < MAX_WALKING_ANKLE_SPEED or usual > RUNNING_KNEES:
        return []
    seen = (
        f"at {rate:.4g} Hz the ankles separate at {speed:.1f} m/s, as in a sprint, but the knees bend only "
        f"{np.degrees(usual):.0f}°, as in a walk"
    )
    if period is None:
        if speed < MAX_BRISK_ANKLE_SPEED:
            return []
        text = f"{seen}: the true frame rate may be lower; if it is, give it as --rate"
    else:
        step, leg = _step_and_leg(points)
        cadence = 2.0 / period * np.sqrt(leg / GRAVITY)
        if not (cadence > QUICK_CADENCE and step < MIN_QUICK_WALK_RATIO * cadence * leg):
            return []
        text = (
            f"{seen}, and steps are quick but short ({120.0 / period:.0f} per minute of {step:.2f} m): "
            "the true frame rate is lower; give it as --rate"
        )
    return [Defect("wrong_rate", len(clip.times), "frames", "flagged", text)]


def _step_and_leg(points: Array) -> tuple[float, float]:
    """Length of a step (95th percentile of the horizontal distance of the ankles) and of a leg, metres."""
    apart = np.linalg.norm(between(points, "ankle_left", "ankle_right")[:, :2], axis=1)
    leg = median(length(points, "hips", "knees") + length(points, "knees", "ankles"))
    return float(np.nanpercentile(apart, 95.0)), leg


def ankle_speed(points: Array, times: Array) -> float:
    """90th percentile of the horizontal speed between the ankles, m/s; 0 if unknown."""
    reach = max(1, round(0.5 * ANKLE_SPEED_WINDOW / float(np.median(np.diff(times)))))
    if len(times) <= 2 * reach:
        return 0.0
    apart = between(points, "ankle_left", "ankle_right")[:, :2]
    speed = np.linalg.norm(apart[2 * reach :] - apart[: -2 * reach], axis=1)
    speed = speed / (times[2 * reach :] - times[: -2 * reach])
    finite = speed[np.isfinite(speed)]
    return float(np.percentile(finite, 90.0)) if len(finite) else 0.0


def usual_bend(points: Array) -> float:
    """95th percentile of the bend of both knees in points (T, 20, 3), radians; 0 if unknown."""
    bends = np.concatenate([bend(points, side) for side in SIDES])
    finite = bends[np.isfinite(bends)]
    return float(np.percentile(finite, 95.0)) if len(finite) else 0.0


def stride_duration(points: Array, times: Array) -> float | None:
    """Duration of a stride in seconds; None without a gait.

    Autocorrelation of the difference between the knee angles. points: (T, 20, 3) of the nodes; times: (T,).
    """
    knees = np.stack([bend(points, "left"), bend(points, "right")], axis=1)
    whole = np.isfinite(knees).all(axis=1)
    if whole.sum() < 12 or whole.mean() < 0.8:
        return None
    even = np.linspace(times[0], times[-1], len(times))
    left, right = (np.interp(even, times[whole], knees[whole, side]) for side in (0, 1))
    if min(np.ptp(np.percentile(curve, [5.0, 95.0])) for curve in (left, right)) < MIN_KNEE_RANGE:
        return None
    if np.corrcoef(left, right)[0, 1] > MAX_SIDE_CORRELATION:
        return None
    period = repeats_after(left - right - np.mean(left - right))
    return None if period is None else float(period * (even[1] - even[0]))


def mean_stride(points: Array, times: Array) -> float | None:
    """Mean duration of the strides in seconds, by how often the other knee is the more bent one; None below
    one stride.

    Arguments as for `stride_duration`. A knee counts once it is more bent by a part of the usual difference,
    so that noise about zero counts as nothing.
    """
    wave = bend(points, "left") - bend(points, "right")
    known = np.isfinite(wave)
    wave, at = wave[known] - np.median(wave[known]), times[known]
    most = MIN_SIDE_LEAD * float(np.std(wave))
    led = np.flatnonzero(np.abs(wave) > most)
    changes = led[1:][np.diff(np.sign(wave[led])) != 0.0]
    if len(changes) < 3:
        return None
    return float(2.0 * (at[changes[-1]] - at[changes[0]]) / (len(changes) - 1))


def repeats_after(wave: Array) -> int | None:
    """Number of frames after which a wave (T,) of mean zero repeats, by its autocorrelation; None if it does
    not."""
    size = 1 << (2 * len(wave) - 1).bit_length()
    power = np.abs(np.fft.rfft(wave, size)) ** 2
    likeness = np.fft.irfft(power, size)[: len(wave)]
    # Unbiased: shorter overlaps sum fewer products.
    likeness = likeness / likeness[0] * len(wave) / np.arange(len(wave), 0, -1)
    last = int(len(wave) / MIN_STRIDES)
    below = np.flatnonzero(likeness[:last] < 0.0)
    if not len(below):
        return None
    # The highest peak after the first trough is one stride or several; the first nearly as high is one.
    rest = likeness[below[0] : last]
    peaks = np.flatnonzero((rest[1:-1] >= rest[:-2]) & (rest[1:-1] > rest[2:])) + 1
    high = peaks[rest[peaks] > max(MIN_AUTOCORRELATION, 0.9 * float(rest[peaks].max(initial=0.0)))]
    return int(below[0] + high[0]) if len(high) else None

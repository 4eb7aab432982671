"""Decides about a frame rate that a reader assumed, because no such sensor delivers the declared one.

The assumption is a repair only if it makes the gait a human's, and more so than the declared rate does.
Otherwise the user is asked for the rate: positions alone do not tell how fast a body moved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.body_points import between, length, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.wrong_rate import HUMAN_STRIDE, RUNNING_KNEES, repeats_after, usual_bend

# Steps per second times sqrt(leg / g). Adults walk at 0.45 (90 steps per minute) to 0.75 (150) and run at up
# to 1.1; children take quicker steps on shorter legs, with the same numbers.
MAX_WALKING_CADENCE, MAX_RUNNING_CADENCE = 0.75, 1.1
# Speed squared over (g leg): people walk below 0.5 and cannot above 1; treadmill walks reach 0.6.
MAX_WALKING_FROUDE = 0.6
# Step length over leg length, per dimensionless cadence. People keep this walk ratio at all speeds: 0.0064 m
# per step/min (Sekiya et al. 1996, J. Hum. Mov. Stud. 30, 241-257) is 1.45 on a leg of 0.88 m.
WALK_RATIO, WALK_RATIOS = 1.45, (0.8, 2.4)


@dataclass(frozen=True)
class StrideEstimate:
    """stride: seconds; step, leg: metres; knees: 95th percentile of their bend, radians."""

    stride: float
    step: float
    leg: float
    knees: float

    @property
    def cadence(self) -> float:
        """Steps per second, dimensionless."""
        return float(2.0 / self.stride * np.sqrt(self.leg / GRAVITY))

    @property
    def walk_ratio(self) -> float:
        return self.step / self.leg / self.cadence

    @property
    def human(self) -> bool:
        """Whether a person can move like this: a walk by cadence, speed and step, or a run by cadence and
        knees."""
        if not HUMAN_STRIDE[0] <= self.stride <= HUMAN_STRIDE[1]:
            return False
        froude = (2.0 * self.step / self.stride) ** 2 / (GRAVITY * self.leg)
        walks = self.cadence <= MAX_WALKING_CADENCE and froude <= MAX_WALKING_FROUDE
        runs = self.knees >= RUNNING_KNEES and self.cadence <= MAX_RUNNING_CADENCE
        return bool(walks and WALK_RATIOS[0] <= self.walk_ratio <= WALK_RATIOS[1]) or bool(runs)

    @property
    def strangeness(self) -> float:
        """Distance from the usual walk ratio, as a factor's logarithm."""
        return abs(float(np.log(self.walk_ratio / WALK_RATIO)))

    def at(self, factor: float) -> StrideEstimate:
        """The same poses with a clock that runs `factor` times as fast."""
        return replace(self, stride=self.stride / factor)


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip at the assumed or the declared rate, whichever is more human, and the defect "wrong_rate".

    It applies to clips whose reading has "assumed_rate": {"rate", "declared" (None if there is none),
    "sensor"}; others are returned as they are.
    """
    doubt: dict[str, Any] | None = clip.provenance.get("reading", {}).get("assumed_rate")
    if doubt is None:
        return clip, []
    rate, declared = doubt["rate"], doubt["declared"]
    stated = "no rate declared" if declared is None else f"declared {declared:g} Hz"
    found = f"{stated}; no {doubt['sensor']} delivers more than {rate:g}"
    count = len(clip.times)
    gait = gait_of(clip)
    if gait is None:
        text = f"{found}, which is assumed; no clear gait confirms it: give the true rate as --rate"
        return clip, [Defect("wrong_rate", count, "frames", "flagged", text)]
    shown = f"{gait.stride:.2f} s per stride, {120.0 / gait.stride:.0f} steps/min"
    other = gait if declared is None else gait.at(declared / rate)
    if gait.human and (declared is None or not other.human or gait.strangeness <= other.strangeness):
        return clip, [
            Defect("wrong_rate", count, "frames", "repaired", f"{found}: read at {rate:g} Hz ({shown})")
        ]
    shown += f", knees to {np.degrees(gait.knees):.0f}°, steps of {gait.step:.2f} m"
    if declared is not None and other.human:
        text = (
            f"{found}, but the gait is plausible at {declared:g} Hz ({120.0 / other.stride:.0f} steps/min) "
            f"rather than at {rate:g} Hz ({shown}): left at {declared:g} Hz; give the true rate as --rate"
        )
        times = clip.times[0] + (clip.times - clip.times[0]) * rate / declared
        return replace(clip, times=times), [Defect("wrong_rate", count, "frames", "flagged", text)]
    text = (
        f"{found}, which is assumed, but no human walks or runs like this at that rate ({shown}): "
        "give the true rate as --rate"
    )
    return clip, [Defect("wrong_rate", count, "frames", "flagged", text)]


def gait_of(clip: Clip) -> StrideEstimate | None:
    """The gait from the distance between the ankles, along the line on which they part; None if that does
    not repeat.

    The line is fixed: this is for walks in one direction, as on a treadmill.
    """
    points = nodes_of(clip)
    apart = between(points, "ankle_left", "ankle_right")[:, :2]
    seen = np.isfinite(apart).all(axis=1)
    leg = median(length(points, "hips", "knees") + length(points, "knees", "ankles"))
    if seen.sum() < 12 or seen.mean() < 0.8 or not leg > 0.0:
        return None
    line = np.linalg.eigh(np.cov(apart[seen].T))[1][:, -1]
    even = np.linspace(clip.times[0], clip.times[-1], len(clip.times))
    wave: Array = np.interp(even, clip.times[seen], apart[seen] @ line)
    period = repeats_after(wave - wave.mean())
    if period is None:
        return None
    step = 0.5 * float(np.ptp(np.percentile(wave, [5.0, 95.0])))
    return StrideEstimate(period * float(even[1] - even[0]), step, leg, usual_bend(points))

"""The rule for a bout: enough strides of alternating feet, over the ground or on the spot."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.locomotion.ground_path import GroundPath
from kinemimic.pipeline.locomotion.strides import MAX_PERIOD_DEVIATION, MIN_R2, Stride

# A bout: so many strides; or a part of a stride that advances so far (m), as of a runner who crosses the view
# of a sensor.
MIN_STRIDES, MIN_CROSSING, MIN_TRAVEL = 2.0, 0.75, 0.8
MIN_SHARE = 0.5  # of the pass, that a part of a stride takes
MIN_REACH_RATIO = 0.6  # of the ankles' movements about the hips, the smaller over the larger
MIN_SPEED = 0.3  # m/s; at lower speeds, the walker steps on the spot
MIN_STEP_AMPLITUDE = 0.12  # m: half the smallest stride of the ankles on the spot


def is_walk(
    strides: list[Stride], path: GroundPath, speed: float, share: float, reaches: list[float]
) -> bool:
    """Whether strides of alternating feet are a walk or a run, over the ground or on the spot.

    share: of the pass that they take; reaches: metres (rms) by which each ankle moves about the hips.
    """
    usual = float(np.median([stride.period for stride in strides if stride.walking]))
    alike = [abs(stride.period - usual) <= MAX_PERIOD_DEVIATION * usual for stride in strides]
    cycles = sum(
        stride.cycles
        for stride, same in zip(strides, alike, strict=True)
        if stride.walking or (stride.transition and stride.r2 >= MIN_R2 and same)
    )
    if path.source == "neither":
        return False
    if cycles >= MIN_STRIDES:
        amplitude = float(np.median([stride.amplitude for stride in strides if stride.walking]))
        return abs(speed) > MIN_SPEED or amplitude > MIN_STEP_AMPLITUDE
    travel = abs(speed) * (strides[-1].times[1] - strides[0].times[0])
    # One wave of the ankles may be a kick, in which one foot stands, or a few steps of a person who turns.
    both = min(reaches) > MIN_REACH_RATIO * max(reaches) and not any(one.transition for one in strides)
    return (
        cycles >= MIN_CROSSING
        and share > MIN_SHARE
        and abs(speed) > MIN_SPEED
        and travel > MIN_TRAVEL
        and (path.source == "recorded" or both)
    )

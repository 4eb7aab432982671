"""The rules for a bout: consecutive strides, enough of them, of alternating feet."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.locomotion.path.ground_path import GroundPath
from kinemimic.pipeline.locomotion.standing import INTO, OUT_OF
from kinemimic.pipeline.locomotion.stride_legs import MAX_PERIOD_DEVIATION
from kinemimic.pipeline.locomotion.strides import MIN_R2, Stride

# A bout has this many strides, or part of a stride that advances this far (m), as when a runner crosses the
# view of a sensor.
MIN_STRIDES, MIN_CROSSING, MIN_TRAVEL = 2.0, 0.75, 0.8
MIN_SHARE = 0.5  # of the pass, that a part of a stride takes
MIN_REACH_RATIO = 0.6  # of the ankles' movements about the hips, the smaller over the larger
MIN_SPEED = 0.3  # m/s; at lower speeds, the walker steps on the spot
MAX_HEADING_STEP = np.radians(60.0)  # between the strides on either side of a bad one
MIN_STEP_AMPLITUDE = 0.12  # m: half the smallest stride of the ankles on the spot


def consecutive_strides(strides: list[Stride], heading: Array, phase: Array) -> list[list[Stride]]:
    """Runs of strides of walking, with the half strides out of and into standing at their ends.

    A single bad stride between two that head the same way does not end a run; standing does. heading: (T,)
    radians, phase: (T,) cycles of the pass.
    """
    middle = [float(np.interp(0.5 * (one.start + one.end), phase, heading)) for one in strides]
    groups: list[list[Stride]] = []
    last: int | None = None
    for k, stride in enumerate(strides):
        if not stride.walking:
            continue
        between = [] if last is None else strides[last + 1 : k]
        turned = 0.0 if last is None else abs(middle[k] - middle[last])
        bridged = len(between) == 1 and not between[0].transition and turned < MAX_HEADING_STEP
        if last is not None and (not between or bridged):
            groups[-1] += [*between, stride]
        else:
            groups.append([*([strides[k - 1]] if k and strides[k - 1].transition == OUT_OF else []), stride])
        if k + 1 < len(strides) and strides[k + 1].transition == INTO:
            groups[-1].append(strides[k + 1])
        last = k
    return groups


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

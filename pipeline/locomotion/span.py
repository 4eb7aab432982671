"""Consecutive strides of a pass with their path over the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.locomotion.even_clock import MIN_FRAMES, RATE
from kinemimic.pipeline.locomotion.pass_gait import PassGait
from kinemimic.pipeline.locomotion.path.belt import velocity_over_belt
from kinemimic.pipeline.locomotion.path.ground_path import (
    MAX_ONE_FOOT,
    MAX_STRIDE_DISAGREEMENT,
    GroundPath,
    choose_path,
    disagreements,
    steady_velocity,
)
from kinemimic.pipeline.locomotion.path.heading import along_heading
from kinemimic.pipeline.locomotion.path.odometry import FootOdometry, foot_odometry
from kinemimic.pipeline.locomotion.phase.frames import frames_between
from kinemimic.pipeline.locomotion.strides import Stride, frames_of, judged_span

MARGIN = 0.15  # cycles
# Cycles (rms) by which strides may deviate from one period. The knee's peak in walking is so sharp that
# pooling frames 0.02 cycles off lowers it by 1 degree.
MAX_DRIFT = 0.02
MAX_SWAY = np.radians(4.0)  # rms; a heading that deviates less from an even turn follows the line


@dataclass(frozen=True)
class Span:
    """Consecutive strides of a pass, with their path over the ground.

    inside: (n,) indices into the pass; level: (n, 20, 3) metres, Z up; up: (n, 3); phase: (n,) cycles and
    heading: (n,) radians, evened; root: (n, 3) metres, the middle of the hips; apart: of `disagreements`;
    velocity: (n, 2) m/s, ahead and to the left; speed: m/s, mean ahead in the strides of walking; walking:
    (n,) whether in one of these.
    """

    gait: PassGait
    precise: bool
    strides: list[Stride]
    inside: NDArray[np.intp]
    level: Array
    up: Array
    phase: Array
    heading: Array
    root: Array
    feet: FootOdometry
    apart: Array
    path: GroundPath
    velocity: Array
    speed: float
    walking: Mask


def span_of(
    gait: PassGait,
    up: Array,
    level: Array,
    strides: list[Stride],
    *,
    between: tuple[float, float],
    precise: bool,
    toes: bool,
) -> Span | None:
    """The span of consecutive strides, None if it is too short.

    up: (T, 3) and level: (T, 20, 3) of the pass; between: phases at which the group of strides before it ends
    and the one after it begins, which keep their half of the strides' distance; precise, toes: as for
    `find_bouts`.
    """
    # A little more at either end shows the foot strike there as a turning point.
    first, last = strides[0].start, strides[-1].end
    edges = (max(first - MARGIN, 0.5 * (between[0] + first)), min(last + MARGIN, 0.5 * (last + between[1])))
    inside = np.arange(len(gait.phase))[frames_between(gait.phase, *edges)]
    if len(inside) < MIN_FRAMES:
        return None
    level, up = level[inside], up[inside]
    # The stride's own sway of the heading belongs to the pelvis, not to the path.
    phase, heading = _evened(gait.phase[inside], MAX_DRIFT), _evened(gait.heading[inside], MAX_SWAY)
    root = place(level, "hips")
    feet = foot_odometry(level, heading, phase, RATE, toes=precise and toes)
    apart = disagreements(root, feet, phase, _judged_spans(strides, phase), RATE)
    whole = np.array([one.cycles > 0.9 for one in strides])
    path = choose_path(root, feet, apart[whole] if whole.any() else apart, RATE, precise=precise)
    walking = frames_of(strides, phase)
    on_belt = None
    if path.source == "feet":
        on_belt = velocity_over_belt(level, feet, phase, RATE, precise=precise)
    if on_belt is not None:
        path = replace(path, velocity=on_belt)
    velocity = along_heading(np.column_stack([path.velocity, np.zeros(len(inside))]), heading)[:, :2]
    speed = float(np.mean(velocity[walking, 0]))
    if path.source == "feet" and on_belt is None:
        velocity[:, 0] = steady_velocity(velocity[:, 0], phase, speed)
    return Span(
        gait, precise, strides, inside, level, up, phase, heading, root, feet, apart, path, velocity, speed,
        walking,
    )  # fmt: skip


def _judged_spans(strides: list[Stride], phase: Array) -> Array:
    """First and last phase (K, 2) by which path and feet are compared in each stride."""
    steady = [one for one in strides if not one.transition]
    around = (
        steady[0].start if strides[0].transition else float(phase[0]),
        steady[-1].end if strides[-1].transition else float(phase[-1]),
    )
    return np.array(
        [
            (one.start, one.end) if one.transition else judged_span(one.start, one.end, around)
            for one in strides
        ]
    )


def agreeing_parts(span: Span) -> list[list[Stride]] | None:
    """The parts of an optical recording in which path and feet agree; None where they do throughout, and for
    other captures."""
    if not span.precise or span.path.source == "feet":
        return None
    # Steps to the side, or a walk forward that goes on backward.
    agree = (
        ~(span.apart[:, 0] > MAX_STRIDE_DISAGREEMENT)
        | (span.apart[:, 2] < MAX_ONE_FOOT)
        | np.array([bool(one.transition) for one in span.strides])
    )
    if agree.all():
        return None
    parts = [span.strides[part] for part in runs(agree)]
    return [part for part in parts if any(one.walking for one in part)]


def _evened(values: Array, tolerance: float) -> Array:
    """Values (T,) on an even clock, replaced by a straight line if they deviate from it by less (rms)."""
    at = np.arange(len(values), dtype=np.float64)
    line = np.asarray(np.polyval(np.polyfit(at, values, 1), at), dtype=np.float64)
    return line if float(np.std(values - line)) < tolerance else values

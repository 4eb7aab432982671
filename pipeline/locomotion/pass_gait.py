"""The gait of one pass on an even clock: headings, distance of the ankles, phase of the strides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.locomotion.even_clock import RATE, EvenPass, even_pass
from kinemimic.pipeline.locomotion.path.heading import ankle_distance, body_heading
from kinemimic.pipeline.locomotion.phase.stride_phase import gait_phase
from kinemimic.pipeline.locomotion.standing import Transition, on_phase, steady_frames, transitions
from kinemimic.pipeline.locomotion.strides import Stride, cut_strides


@dataclass(frozen=True)
class PassGait:
    """even: the pass; heading: (T,) radians; facing: (T,) radians between the heading and the front of the
    body; ankles: (T, 3) metres from the left to the right ankle; seen: (T,) whether both are; apart: (T,)
    metres of that along the heading, NaN where not seen; phase: (T,) cycles, integer where the left ankle is
    farthest ahead.
    """

    even: EvenPass
    heading: Array
    facing: Array
    ankles: Array
    seen: Mask
    apart: Array
    phase: Array

    def strides(self, transitions: Sequence[Transition] = (), *, precise: bool) -> list[Stride]:
        """The strides, with the half strides next to standing as strides of their own. precise: whether the
        capture shows the front of the body well enough to tell steps to the side."""
        facing = self.facing if precise else None
        return cut_strides(
            self.even.times, self.even.positions, self.heading, self.phase,
            facing=facing, transitions=transitions,
        )  # fmt: skip


def gait_of_pass(times: Array, positions: Array) -> PassGait | None:
    """The gait of a pass at times (T,) with positions (T, 20, 3); None if it is too short, never shows both
    legs, or has no phase."""
    even = even_pass(times, positions)
    if even is None:
        return None
    heading, facing = body_heading(even.positions, RATE)
    ankles, seen, apart = ankle_distance(even.positions, even.seen, heading)
    phase = gait_phase(even.times, apart)
    return None if phase is None else PassGait(even, heading, facing, ankles, seen, apart, phase)


def without_standing(gait: PassGait, *, precise: bool) -> tuple[PassGait, list[Stride]]:
    """The gait with a phase fitted to the walk alone, and its strides. precise: as for `PassGait.strides`."""
    strides = gait.strides(precise=precise)
    walking = [stride for stride in strides if stride.walking]
    if not walking:
        return gait, strides
    usual = {
        name: float(np.median([getattr(one, name) for one in walking])) for name in ("amplitude", "period")
    }
    halves = transitions(gait.ankles, gait.seen, gait.phase, **usual)
    if not halves:
        return gait, strides
    again = gait_phase(gait.even.times, gait.apart, steady=steady_frames(gait.phase, halves))
    if again is not None:
        gait, halves = replace(gait, phase=again), on_phase(halves, gait.phase, again)
    return gait, gait.strides(halves, precise=precise)

"""Detects legs that the sensor exchanged while one hid the other, and exchanges them back.

Seen from the side, one leg hides the other at every step, and a depth sensor that loses track names them anew
as they part. The ankles then meet without passing each other: the same foot seems to lead twice. Walking
feet alternate, so in a depth sensor's recording of a walk nearly every such meeting is an exchange. But in
kicks, lunges and steps to the other foot, one leg always leads (`ankle_meetings` tells), and a person who
turns around sets the same foot ahead twice, too. So legs that are on their own sides for a stride or more, as
the hips and shoulders show them, were not exchanged. `swapped_limbs` finds swaps of single frames, in which
the legs jump; here nothing jumps, because the legs are at one place.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.locomotion.even_clock import RATE, even_pass
from kinemimic.pipeline.locomotion.leg_pose import is_precise
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.ankle_meetings import steps
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.swap_sides import swap_sides

# s; over a whole stride, the knees' distance ahead averages out of their distance to the side, which hips
# seen obliquely would otherwise mix with it.
STRIDE = 1.0
_LEG = ("knee", "ankle", "foot")


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with exchanged legs put back, pass by pass."""
    positions = nodes_of(clip)
    if clip.euler is not None or is_precise(positions):
        return clip, []
    exchanged = np.zeros(len(clip.times), dtype=np.bool_)
    times = 0
    for number in np.unique(clip.passes[clip.passes >= 0]):
        rows = np.flatnonzero(clip.passes == number)
        found, count = _exchanged(clip.times[rows], positions[rows])
        exchanged[rows] = found
        times += count
    if not exchanged.any():
        return clip, []
    named = joints_by_name(clip.skeleton.names)
    joints = [named[f"{joint}_left"] for joint in _LEG if f"{joint}_left" in named]
    curves = [name for name in clip.angles or () if name.startswith(_LEG)]
    text = (
        f"the ankles met {plural(times, 'time')} without passing each other: the sensor exchanged the legs "
        "while one hid the other; exchanged back"
    )
    defect = Defect("swapped_sides", int(exchanged.sum()), "frames", "repaired", text, frame_runs(exchanged))
    return swap_sides(clip, exchanged, joints, curves), [defect]


def _exchanged(times: Array, positions: Array) -> tuple[Mask, int]:
    """Frames (T,) of one pass in which the legs are exchanged, and the number of meetings without a
    passing.
    """
    none = np.zeros(len(times), dtype=np.bool_)
    even = even_pass(times, positions)
    if even is None:
        return none, 0
    aside = _aside(even.positions)
    out = np.zeros(len(even.times), dtype=np.bool_)
    count = 0
    # Each stretch of steps has its own parity.
    stretches = steps(even.positions)
    bounds = [*(one.start for one in stretches), len(out)]
    for stretch, end in zip(stretches, bounds[1:], strict=True):
        changes = stretch.not_passing
        out[stretch.start : end] = _exchanged_parts(changes, stretch.start, end, aside)
        count += sum(bool(out[change] != out[change - 1]) for change in changes)
    after = np.searchsorted(even.times, times).clip(0, len(even.times) - 1)
    return out[after], count


def _aside(positions: Array) -> Array:
    """Metres (T,) by which the left knee is to the left of the right one, as hips and shoulders show it."""
    left = positions[:, N["hip_left"]] - positions[:, N["hip_right"]]
    left = left + np.nan_to_num(positions[:, N["shoulder_left"]] - positions[:, N["shoulder_right"]])
    knees = positions[:, N["knee_left"]] - positions[:, N["knee_right"]]
    return np.asarray(np.sum(knees[:, :2] * unit(left[:, :2]), axis=-1))


def _exchanged_parts(changes: list[int], start: int, end: int, aside: Array) -> Mask:
    """Exchanged samples of a stretch: every other part between changes, counted from the parts of at least a
    stride in which the knees, as they are named, are on their own sides; without any, as `_parity` says.
    """
    bounds = list(pairwise([start, *changes, end]))
    own = [
        k
        for k, (first, last) in enumerate(bounds)
        if last - first >= STRIDE * RATE and float(np.median(aside[first:last])) > 0.0
    ]
    if not own:
        return _parity(changes, start, end)
    out = np.zeros(end - start, dtype=np.bool_)
    for k, (first, last) in enumerate(bounds):
        # From the nearest such part before, or else from the first one after.
        anchor = max((one for one in own if one <= k), default=own[0])
        out[first - start : last - start] = (k - anchor) % 2 == 1
    return out


def _parity(changes: list[int], start: int, end: int) -> Mask:
    """Exchanged samples of a stretch: those after an odd number of changes, or the others if they are
    fewer: the names with fewer exchanged frames are kept.
    """
    marks = np.zeros(end - start, dtype=np.intp)
    for change in changes:
        marks[change - start] += 1
    odd = np.asarray(np.cumsum(marks) % 2 == 1)
    return ~odd if odd.mean() > 0.5 else odd

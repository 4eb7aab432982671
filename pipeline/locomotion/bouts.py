"""Bouts of walking and running in a capture: where they are, how good, and the walker in walking axes.

A walking bout is a run of consecutive strides (Kluge et al. 2021, PLoS ONE 16(8), e0256541). Everything is
found from the pose: a heading and an upright axis for each frame, a phase that follows the strides, and the
path over the ground. A bad stride is left out; it does not spoil the bout.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, normalize, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.locomotion.even_clock import RATE, EvenPass, even_pass
from kinemimic.pipeline.locomotion.ground import ground_height
from kinemimic.pipeline.locomotion.heading import along_heading, ankle_distance, body_heading
from kinemimic.pipeline.locomotion.leg_pose import impossible_legs, is_precise, leg_angles, leg_bones
from kinemimic.pipeline.locomotion.odometry import (
    MAX_ONE_FOOT,
    MAX_STRIDE_DISAGREEMENT,
    GroundPath,
    choose_path,
    disagreements,
    foot_odometry,
    is_running_pose,
    steady_velocity,
)
from kinemimic.pipeline.locomotion.standing import INTO, OUT_OF, on_phase, steady_frames, transitions
from kinemimic.pipeline.locomotion.stride_phase import gait_phase
from kinemimic.pipeline.locomotion.strides import (
    Stride,
    cut_strides,
    frames_of,
    judge_strides,
    judged_span,
)
from kinemimic.pipeline.locomotion.upright import levelling, upright_axis
from kinemimic.pipeline.locomotion.walk_rule import is_walk

MARGIN = 0.15  # cycles
# Cycles (rms) by which strides may deviate from one period. The knee's peak in walking is so sharp that
# pooling frames 0.02 cycles off lowers it by 1 degree.
MAX_DRIFT = 0.02
MAX_SWAY = np.radians(4.0)  # rms; a heading that deviates less from an even turn follows the line
MAX_HEADING_STEP = np.radians(60.0)  # between the strides on either side of a bad one


@dataclass(frozen=True)
class Bout:
    """A bout of walking or running.

    number: from 0 in the capture; pass_number: of the clip; frames: (n,) indices into the clip, consecutive
    in the pass; turn: (n, 4) rotations from the capture's axes to the walker's: X ahead, Y left, Z up, where
    the walker's path is straightened; heading: (n,) radians in the capture; tilt: (n,) radians by which up
    was corrected; positions: (n, 20, 3) metres in walking axes over the ground; phase: (n,) cycles, integer
    where the left ankle is farthest ahead; strides: judged, in order; path: where the speed comes from;
    speed: m/s, negative backward; period: seconds, median of the strides; running, backward: whether the
    walker runs, or steps backward; precise: whether the recording is accurate to a centimetre.
    """

    number: int
    pass_number: int
    frames: NDArray[np.intp]
    turn: Array
    heading: Array
    tilt: Array
    positions: Array
    phase: Array
    strides: tuple[Stride, ...]
    path: GroundPath
    speed: float
    period: float
    running: bool
    backward: bool
    precise: bool

    @property
    def cycles(self) -> float:
        """Number of strides, with parts of strides."""
        return sum(stride.cycles for stride in self.strides)

    @property
    def used_strides(self) -> float:
        """Number of strides of which at least one leg is good enough for a loop, with parts of strides."""
        return sum(stride.cycles for stride in self.strides if any(stride.used))

    @property
    def times(self) -> tuple[float, float]:
        """Seconds of the first and the last frame."""
        return self.strides[0].times[0], self.strides[-1].times[1]

    def leg_mask(self) -> NDArray[np.bool_]:
        """Frames (n, 2) in which the left and right leg are good enough for a loop."""
        out = np.zeros((len(self.frames), 2), dtype=np.bool_)
        for stride in self.strides:
            inside = (self.phase >= stride.start) & (self.phase <= stride.end)
            out[inside] |= np.array(stride.used)
        return out


def find_bouts(times: Array, passes: NDArray[np.int32], positions: Array) -> list[Bout]:
    """The bouts of a capture: times (T,), numbers of the passes (T,) as in `Clip`, positions (T, 20, 3) in
    metres.
    """
    lengths = leg_bones(positions)
    if not np.isfinite(lengths).any(axis=0).all():
        return []
    bones = np.nanmedian(lengths, axis=0)
    precise = is_precise(positions)
    found: list[Bout] = []
    for number in np.unique(passes[passes >= 0]).tolist():
        frames = np.flatnonzero(passes == number)
        for one in _bouts_of_pass(times[frames], positions[frames], bones, precise=precise):
            found.append(replace(one, pass_number=number, frames=frames[one.frames], number=len(found)))
    return found


def _bouts_of_pass(times: Array, positions: Array, bones: Array, *, precise: bool) -> list[Bout]:
    """The bouts of one pass, with indices into its frames: times (T,), positions (T, 20, 3)."""
    even = even_pass(times, positions)
    if even is None:
        return []
    heading, facing = body_heading(even.positions, RATE)
    ankles, seen, apart = ankle_distance(even.positions, even.seen, heading)
    phase = gait_phase(even.times, apart)
    if phase is None:
        return []
    cut = partial(cut_strides, even.times, even.positions, heading, facing=facing if precise else None)
    strides = cut(phase)
    if walking := [stride for stride in strides if stride.walking]:
        usual = {
            name: float(np.median([getattr(one, name) for one in walking]))
            for name in ("amplitude", "period")
        }
        if halves := transitions(ankles, seen, phase, **usual):
            again = gait_phase(even.times, apart, steady=steady_frames(phase, halves))
            if again is not None:
                phase, halves = again, on_phase(halves, phase, again)
            strides = cut(phase, transitions=halves)
    # An optical laboratory is level; a sensor may tilt.
    up = np.tile([0.0, 0.0, 1.0], (len(phase), 1))
    if not precise:
        up = upright_axis(even.positions, heading, phase, frames_of(strides, phase))
    level = rotate(levelling(up)[:, None], even.positions)
    ahead = along_heading(level - _middle(level)[:, None], heading)
    running = is_running_pose(ahead, phase, RATE)
    legs = [even.seen[:, [N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle")]].all(axis=1)
            for side in ("left", "right")]  # fmt: skip
    bad = impossible_legs(ahead, bones, running=running, precise=precise) | ~np.stack(legs, axis=1)
    strides = judge_strides(strides, phase, leg_angles(ahead), bad, compare=not precise)
    out = []
    groups = _groups(strides, heading, phase)
    while groups:
        found = _bout(times, positions, even, heading, phase, up, level, groups.pop(0), precise=precise)
        if isinstance(found, Bout):
            out.append(found)
        else:
            groups = found + groups
    return out


def _groups(strides: list[Stride], heading: Array, phase: Array) -> list[list[Stride]]:
    """Runs of strides of walking, with the half strides out of and into standing at their ends.

    A single bad stride between two that head the same way does not end a run.
    """
    middle = [float(np.interp(0.5 * (one.start + one.end), phase, heading)) for one in strides]
    groups: list[list[Stride]] = []
    last: int | None = None
    for k, stride in enumerate(strides):
        if not stride.walking:
            continue
        gap = 3 if last is None else k - last
        if last is not None and (gap == 1 or (gap == 2 and abs(middle[k] - middle[last]) < MAX_HEADING_STEP)):
            groups[-1] += strides[last + 1 : k + 1]
        else:
            groups.append([*([strides[k - 1]] if k and strides[k - 1].transition == OUT_OF else []), stride])
        if k + 1 < len(strides) and strides[k + 1].transition == INTO:
            groups[-1].append(strides[k + 1])
        last = k
    return groups


def _bout(
    times: Array,
    positions: Array,
    even: EvenPass,
    heading: Array,
    phase: Array,
    up: Array,
    level: Array,
    strides: list[Stride],
    *,
    precise: bool,
) -> Bout | list[list[Stride]]:
    """The bout of consecutive strides.

    No bout if they are too few, or no walk; then the parts of an optical recording in which path and feet
    agree are returned, which may be bouts.
    """
    # A little more at either end shows the foot strike there as a turning point.
    clock = slice(*np.searchsorted(phase, (strides[0].start - MARGIN, strides[-1].end + MARGIN)))
    inside = np.arange(len(phase))[clock]
    if len(inside) < 8:
        return []
    level, phase, up = level[inside], phase[inside], up[inside]
    # The stride's own sway of the heading belongs to the pelvis, not to the path.
    phase, heading = _evened(phase, MAX_DRIFT), _evened(heading[inside], MAX_SWAY)
    root = _middle(level)
    feet = foot_odometry(level, heading, phase, RATE, toes=precise)
    walking = frames_of(strides, phase)
    steady = [one for one in strides if not one.transition]
    around = (
        steady[0].start if strides[0].transition else float(phase[0]),
        steady[-1].end if strides[-1].transition else float(phase[-1]),
    )
    spans = np.array(
        [
            (one.start, one.end) if one.transition else judged_span(one.start, one.end, around)
            for one in strides
        ]
    )
    apart = disagreements(root, feet, phase, spans, RATE)
    whole = np.array([one.cycles > 0.9 for one in strides])
    path = choose_path(root, feet, apart[whole] if whole.any() else apart, RATE, precise=precise)
    if precise and path.source != "feet":
        # Steps to the side, or a walk forward that goes on backward.
        agree = (
            ~(apart[:, 0] > MAX_STRIDE_DISAGREEMENT)
            | (apart[:, 2] < MAX_ONE_FOOT)
            | np.array([bool(one.transition) for one in strides])
        )
        if not agree.all():
            parts = [strides[part] for part in runs(agree)]
            return [part for part in parts if any(one.walking for one in part)]
    velocity = along_heading(np.column_stack([path.velocity, np.zeros(len(inside))]), heading)[:, :2]
    speed = float(np.mean(velocity[walking, 0]))
    if path.source == "feet":
        velocity[:, 0] = steady_velocity(velocity[:, 0], phase, speed)
    share = len(inside) / len(even.times)
    # An optical laboratory has no camera that turns, and nobody walks backward on a treadmill.
    in_place_backward = precise and feet.backward and path.source == "feet"
    ahead = along_heading(level - root[:, None], heading)
    reaches = [float(np.std(ahead[walking, N[f"ankle_{side}"], 0])) for side in ("left", "right")]
    if in_place_backward or not is_walk(strides, path, speed, share, reaches):
        return []
    # Positions in walking axes: the path is integrated along the heading, so that a curve is straightened.
    travelled = np.concatenate(
        [np.zeros((1, 2)), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0) / RATE]
    )
    height = root[:, 2] - ground_height(level, phase, follow=not precise)
    ends = even.times[inside[[0, -1]]] + np.array([-0.5, 0.5]) / RATE
    frames = np.arange(*np.searchsorted(times, ends))
    at = times[frames]
    seconds = even.times[inside]
    exact_heading = np.interp(at, seconds, heading)
    exact_up = np.stack([np.interp(at, seconds, column) for column in up.T], axis=1)
    turn = multiply(
        from_axis_angle("Z", -exact_heading),
        levelling(exact_up / np.linalg.norm(exact_up, axis=1, keepdims=True)),
    )
    place = np.stack(
        [np.interp(at, seconds, line) for line in (travelled[:, 0], travelled[:, 1], height)], axis=1
    )
    p = positions[frames]
    middle = np.stack([np.interp(at, even.times, line) for line in _middle(even.positions).T], axis=1)
    return Bout(
        number=0,
        pass_number=0,
        frames=frames,
        turn=normalize(turn),
        heading=exact_heading,
        tilt=np.arccos(np.clip(exact_up[:, 2], -1.0, 1.0)),
        positions=rotate(turn[:, None], p - middle[:, None]) + place[:, None],
        phase=np.interp(at, seconds, phase),
        strides=tuple(strides),
        path=path,
        speed=speed,
        backward=feet.backward,
        period=float(np.median([stride.period for stride in strides if stride.walking])),
        running=feet.running,
        precise=precise,
    )


def _middle(positions: Array) -> Array:
    """Middle of the hips (T, 3)."""
    return np.asarray(0.5 * (positions[:, N["hip_left"]] + positions[:, N["hip_right"]]))


def _evened(values: Array, tolerance: float) -> Array:
    """Values (T,) on an even clock, replaced by a straight line if they deviate from it by less (rms)."""
    at = np.arange(len(values), dtype=np.float64)
    line = np.asarray(np.polyval(np.polyfit(at, values, 1), at), dtype=np.float64)
    return line if float(np.std(values - line)) < tolerance else values

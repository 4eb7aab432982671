"""Bouts of walking and running in a capture: where they are, how good, and the walker in walking axes.

A walking bout is a run of consecutive strides (Kluge et al. 2021, PLoS ONE 16(8), e0256541). Everything is
found from the pose: a heading and an upright axis for each frame, a phase that follows the strides, and the
path over the ground. A bad stride is left out; it does not spoil the bout.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, normalize, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.even_clock import RATE
from kinemimic.pipeline.locomotion.leg_pose import impossible_legs, is_precise, leg_angles, leg_bones
from kinemimic.pipeline.locomotion.pass_gait import PassGait, gait_of_pass, without_standing
from kinemimic.pipeline.locomotion.path.ground import ground_height
from kinemimic.pipeline.locomotion.path.ground_path import GroundPath
from kinemimic.pipeline.locomotion.path.heading import along_heading
from kinemimic.pipeline.locomotion.path.odometry import is_running_pose
from kinemimic.pipeline.locomotion.path.upright import levelling, upright_axis
from kinemimic.pipeline.locomotion.phase.frames import within
from kinemimic.pipeline.locomotion.span import Span, agreeing_parts, span_of
from kinemimic.pipeline.locomotion.stride_legs import judge_strides
from kinemimic.pipeline.locomotion.strides import Stride, frames_of
from kinemimic.pipeline.locomotion.walk_rule import consecutive_strides, is_walk

# m/s. Down stairs, the rear foot is in the air like a runner's; the slowest joggers go about as fast.
SLOWEST_RUN = 0.8


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
            out[within(self.phase, stride.start, stride.end)] |= np.array(stride.used)
        return out


def find_bouts(times: Array, passes: NDArray[np.int32], positions: Array, *, toes: bool = True) -> list[Bout]:
    """The bouts of a capture: times (T,), numbers of the passes (T,) as in `Clip`, positions (T, 20, 3) in
    metres. toes: whether the feet are measured, not derived (`nodes.shows_feet`).
    """
    lengths = leg_bones(positions)
    if not np.isfinite(lengths).any(axis=0).all():
        return []
    bones = np.nanmedian(lengths, axis=0)
    precise = is_precise(positions)
    found: list[Bout] = []
    for number in np.unique(passes[passes >= 0]).tolist():
        frames = np.flatnonzero(passes == number)
        for one in _bouts_of_pass(times[frames], positions[frames], bones, precise=precise, toes=toes):
            found.append(replace(one, pass_number=number, frames=frames[one.frames], number=len(found)))
    return found


def _bouts_of_pass(times: Array, positions: Array, bones: Array, *, precise: bool, toes: bool) -> list[Bout]:
    """The bouts of one pass, with indices into its frames: times (T,), positions (T, 20, 3)."""
    spans = spans_of_pass(times, positions, bones, precise=precise, toes=toes)
    return [_bout(times, positions, span) for span in spans if _is_bout(span)]


def spans_of_pass(
    times: Array, positions: Array, bones: Array, *, precise: bool, toes: bool
) -> Iterator[Span]:
    """The runs of consecutive strides of one pass, bouts or not: times (T,), positions (T, 20, 3).

    One whose parts alone agree with the path has the path "neither", and its parts follow.

    bones: median lengths of the legs' bones, of `leg_bones`; precise, toes: as for `find_bouts`.
    """
    gait = gait_of_pass(times, positions)
    if gait is None:
        return
    gait, strides = without_standing(gait, precise=precise)
    # An optical laboratory is level; a sensor may tilt.
    up = np.tile([0.0, 0.0, 1.0], (len(gait.phase), 1))
    if not precise:
        up = upright_axis(gait.even.positions, gait.heading, gait.phase, frames_of(strides, gait.phase))
    level = rotate(levelling(up)[:, None], gait.even.positions)
    angles, bad = _legs(gait, level, bones, precise=precise)
    strides = judge_strides(strides, gait.phase, angles, bad, compare=not precise)
    groups, ended = consecutive_strides(strides, gait.heading, gait.phase), -np.inf
    while groups:
        group = groups.pop(0)
        between = (ended, groups[0][0].start if groups else np.inf)
        span = span_of(gait, up, level, group, between=between, precise=precise, toes=toes)
        parts = None if span is None else agreeing_parts(span)
        if span is not None and parts is not None:
            yield replace(span, path=replace(span.path, source="neither"))
            groups = parts + groups
            continue
        ended = group[-1].end
        if span is not None:
            yield span


def _legs(gait: PassGait, level: Array, bones: Array, *, precise: bool) -> tuple[Array, Mask]:
    """Angles (T, 2, A) of the legs in radians, and the frames (T, 2) in which one is missing or in an
    impossible pose. level: (T, 20, 3) positions with Z up."""
    ahead = along_heading(level - place(level, "hips")[:, None], gait.heading)
    running = is_running_pose(ahead, gait.phase, RATE)
    seen = [
        gait.even.seen[:, [N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle")]].all(axis=1)
        for side in SIDES
    ]
    impossible = impossible_legs(ahead, bones, running=running, precise=precise)
    return leg_angles(ahead), impossible | ~np.stack(seen, axis=1)


def _is_bout(span: Span) -> bool:
    """Whether the strides are a walk or a run."""
    # An optical laboratory has no camera that turns, and nobody walks backward on a treadmill.
    if span.precise and span.feet.backward and span.path.source == "feet":
        return False
    ahead = along_heading(span.level - span.root[:, None], span.heading)
    reaches = [float(np.std(ahead[span.walking, N[f"ankle_{side}"], 0])) for side in SIDES]
    share = len(span.inside) / len(span.gait.even.times)
    return is_walk(span.strides, span.path, span.speed, share, reaches)


def _bout(times: Array, positions: Array, span: Span) -> Bout:
    """The bout, in the frames of the recorded pass: times (T,), positions (T, 20, 3)."""
    even, velocity = span.gait.even, span.velocity
    # The path is integrated along the heading, so that a curve is straightened.
    travelled = np.concatenate(
        [np.zeros((1, 2)), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0) / RATE]
    )
    # Walking backward is walking forward in reversed time: its stance is there.
    stance = -span.phase if span.feet.backward else span.phase
    height = span.root[:, 2] - ground_height(span.level, stance, follow=not span.precise)
    seconds = even.times[span.inside]
    frames = np.arange(*np.searchsorted(times, seconds[[0, -1]] + np.array([-0.5, 0.5]) / RATE))
    at = times[frames]
    heading = np.interp(at, seconds, span.heading)
    up = np.stack([np.interp(at, seconds, column) for column in span.up.T], axis=1)
    turn = multiply(from_axis_angle("Z", -heading), levelling(up / np.linalg.norm(up, axis=1, keepdims=True)))
    moved = np.stack(
        [np.interp(at, seconds, line) for line in (travelled[:, 0], travelled[:, 1], height)], axis=1
    )
    hips = np.stack([np.interp(at, even.times, line) for line in place(even.positions, "hips").T], axis=1)
    return Bout(
        number=0,
        pass_number=0,
        frames=frames,
        turn=normalize(turn),
        heading=heading,
        tilt=np.arccos(np.clip(up[:, 2], -1.0, 1.0)),
        positions=rotate(turn[:, None], positions[frames] - hips[:, None]) + moved[:, None],
        phase=np.interp(at, seconds, span.phase),
        strides=tuple(span.strides),
        path=span.path,
        speed=span.speed,
        backward=span.feet.backward,
        period=float(np.median([stride.period for stride in span.strides if stride.walking])),
        running=span.feet.running and abs(span.speed) > SLOWEST_RUN,
        precise=span.precise,
    )

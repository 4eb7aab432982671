"""Strides of one pass, each judged by itself: whether it is a stride of walking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.path.heading import along_heading
from kinemimic.pipeline.locomotion.phase.fourier import design
from kinemimic.pipeline.locomotion.phase.frames import frames_between
from kinemimic.pipeline.locomotion.standing import Transition, is_standing, kind_of, steady_span

# Seconds of a stride: from a sprinter to a patient with a stride of 2.1 s at 0.5 m/s.
PERIODS = (0.45, 3.0)
MIN_R2 = 0.80  # of one harmonic of the ankles' distance within the stride
MIN_AMPLITUDE = 0.08  # m, of that harmonic: half of the distance by which one ankle passes the other
# Walking differs from a jump or a kick: the trunk stays upright, and the feet alternate.
MAX_TRUNK_LEAN = np.radians(60.0)
# Share of the variance of both ankles about the hips that lies in their difference: 0.5 if one leg alone
# moves.
MIN_ALTERNATION = 0.65
MAX_SIDEWAYS = np.radians(50.0)  # between the line along which the feet part and the front of the body
# Of the heading within a stride that a depth sensor shows: it loses the legs of a person who turns round.
MAX_TURN = np.radians(120.0)
MIN_FRAMES = 6  # by which a stride can be judged
MIN_SHARE_OF_STRIDE = 0.1  # a shorter part at the edge of a pass is left to the stride beside it


@dataclass(frozen=True)
class Stride:
    """One stride, or the part of one that the edge of a pass or a half stride next to standing left.

    start, end: phase in cycles; times: seconds; period: seconds of a full stride; r2: of one harmonic of the
    ankles' distance; amplitude: metres; turn: radians by which the heading changes; walking: whether this is
    a stride of walking or running; transition: "half stride into standing" or "… out of standing", which is
    no stride of walking, else ""; why: the reason why a regular stride is not walking, else ""; used:
    whether the left and the right leg are good enough for a loop; reason: why a leg is not, "" if both are.
    """

    start: float
    end: float
    times: tuple[float, float]
    period: float
    r2: float
    amplitude: float
    turn: float
    walking: bool
    transition: str = ""
    used: tuple[bool, bool] = (False, False)
    reason: str = ""
    why: str = ""

    @property
    def cycles(self) -> float:
        return self.end - self.start


def cut_strides(
    times: Array,
    positions: Array,
    heading: Array,
    phase: Array,
    *,
    facing: Array | None = None,
    transitions: Sequence[Transition] = (),
) -> list[Stride]:
    """The strides of a pass on an even clock: times (T,), positions (T, 20, 3) with Z up, heading and phase
    (T,).

    A stride begins where the left ankle is farthest ahead. facing: (T,) radians between the heading and the
    front of the body, None where the sensor does not show the front well enough to tell steps to the side;
    transitions: the half strides next to standing, which become strides of their own.
    """
    hips = place(positions, "hips")
    left, right = (
        along_heading(positions[:, N[f"ankle_{side}"]] - hips, heading)[:, 0] for side in ("left", "right")
    )
    trunk = positions[:, N["shoulder_center"]] - hips
    lean = np.arctan2(np.hypot(trunk[:, 0], trunk[:, 1]), trunk[:, 2])
    curves = _Curves(times, phase, heading, left, right, lean, facing)
    found = []
    for start, end in pairwise(_edges(phase, transitions)):
        transition = kind_of(start, end, transitions)
        around = (start, end) if transition else steady_span(start, end, phase, transitions)
        inside = frames_between(phase, *judged_span(start, end, around))
        if inside.stop - inside.start >= MIN_FRAMES:
            standing = is_standing(start, end, transitions)
            found.append(curves.stride(start, end, inside, transition=transition, standing=standing))
    return found


@dataclass(frozen=True)
class _Curves:
    """What strides are judged by, each (T,) over the frames of a pass.

    times: seconds; phase: cycles; heading, facing: radians, as for `cut_strides`; left, right: metres of the
    ankle ahead of the hips; lean: radians of the trunk.
    """

    times: Array
    phase: Array
    heading: Array
    left: Array
    right: Array
    lean: Array
    facing: Array | None

    def stride(self, start: float, end: float, inside: slice, *, transition: str, standing: bool) -> Stride:
        """The stride from phase `start` to `end`, judged by the frames `inside`."""
        left, right = self.left[inside], self.right[inside]
        apart, together = np.var(right - left), np.var(right + left)
        r2, amplitude, mean = _harmonic(self.phase[inside], right - left)
        first, last = np.interp([start, end], self.phase, self.times)
        period = float((last - first) / (end - start))
        own = frames_between(self.phase, start, end)
        turn = float(np.ptp(self.heading[own])) if own.stop > own.start else 0.0
        lean = self.lean[inside][np.isfinite(self.lean[inside])]
        regular = (
            not transition
            and not standing
            and PERIODS[0] <= period <= PERIODS[1]
            and r2 >= MIN_R2
            and amplitude >= MIN_AMPLITUDE
        )
        why = _why_no_walk(
            passing=amplitude >= abs(mean),
            alternation=float(apart / np.maximum(apart + together, 1e-12)),
            turn=turn if self.facing is None else 0.0,
            sideways=0.0 if self.facing is None else float(np.median(self.facing[inside])),
            lean=float(np.percentile(lean, 90.0)) if len(lean) else 0.0,
        )
        return Stride(
            float(start),
            float(end),
            (float(first), float(last)),
            period,
            r2,
            amplitude,
            turn,
            bool(regular and not why),
            transition,
            why=why if regular else "",
        )


def _why_no_walk(*, passing: bool, alternation: float, turn: float, sideways: float, lean: float) -> str:
    """Why a regular stride is not one of walking, "" if it is.

    passing: whether the ankles pass each other; alternation: as for MIN_ALTERNATION; radians: turn of the
    heading, sideways between the line of the feet and the body's front, lean of the trunk.
    """
    if not sideways < MAX_SIDEWAYS:
        return "steps to the side"
    if not passing:
        return "one ankle stays ahead of the other"
    if not alternation > MIN_ALTERNATION:
        return "left and right leg differ too much: one hardly moves"
    if not turn < MAX_TURN:
        return f"turns by more than {np.degrees(MAX_TURN):.0f}°"
    if lean > MAX_TRUNK_LEAN:
        return f"the trunk leans by more than {np.degrees(MAX_TRUNK_LEAN):.0f}°"
    return ""


def judged_span(start: float, end: float, around: tuple[float, float]) -> tuple[float, float]:
    """First and last phase by which a stride is judged: a part of one with the rest of a stride beside it.

    around: first and last phase of the walk.
    """
    if end - start >= 0.9:
        return start, end
    first, last = around
    if end - 1.0 >= first:
        return end - 1.0, end
    return (start, start + 1.0) if start + 1.0 <= last else (first, last)


def _edges(phase: Array, transitions: Sequence[Transition]) -> Array:
    """Phases at which strides begin and end, with the edges of the pass and of transitions."""
    whole = np.arange(np.ceil(phase[0]), np.floor(phase[-1]) + 1.0)
    edges = np.concatenate([[phase[0]], whole, [phase[-1]]])
    keep = np.ones(len(edges), dtype=np.bool_)
    if len(edges) > 3:
        keep[1] = edges[1] - edges[0] >= MIN_SHARE_OF_STRIDE
        keep[-2] = edges[-1] - edges[-2] >= MIN_SHARE_OF_STRIDE
    edges = edges[keep]
    for one in transitions:
        # A whole phase close to the half stride would leave too short a part beside it.
        beside = (edges > one.start - MIN_SHARE_OF_STRIDE) & (edges < one.end + MIN_SHARE_OF_STRIDE)
        edges = np.sort(np.concatenate([edges[~beside], [one.start, one.end]]))
    edges = np.unique(np.concatenate([[phase[0]], edges, [phase[-1]]]))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > 1e-9])])


def _harmonic(phase: Array, distance: Array) -> tuple[float, float, float]:
    """R², amplitude and mean in metres of one harmonic through the ankles' distance (n,) at phases (n,)."""
    wave = design(phase, 1)
    fitted = np.asarray(np.linalg.lstsq(wave, distance, rcond=None)[0], dtype=np.float64)
    spread = float(np.sum((distance - distance.mean()) ** 2))
    residual = float(np.sum((distance - wave @ fitted) ** 2))
    r2 = 1.0 - residual / spread if spread > 0.0 else 0.0
    return r2, float(np.hypot(fitted[1], fitted[2])), float(fitted[0])


def frames_of(strides: list[Stride], phase: Array) -> NDArray[Any]:
    """Mask (T,) of the frames of strides of walking."""
    inside = np.zeros(len(phase), dtype=np.bool_)
    for stride in strides:
        if stride.walking:
            inside[frames_between(phase, stride.start, stride.end)] = True
    return inside

"""Resample a clip to a constant frame rate, for formats and methods that need one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.rotations import conjugate, continuous, from_rotvec, multiply, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.kinematics.spans import all_finite, distinct_times, pass_spans, runs

# Seconds; rounding error of clocks that were written with few digits.
_SLACK = 1e-6


def resample(clip: Clip, rate: float) -> Clip:
    """The clip's passes at `rate` frames per second: a step of exactly 1 / rate within each pass.

    Positions (and translations) are interpolated by cubic splines, rotations by slerp from frame to frame;
    nothing crosses a gap or the end of a pass, and frames outside passes are left out. A frame's state is the
    lower of those around it. A capture of Euler channels returns with `rotations` in their place, since Euler
    angles cannot be interpolated. Clean before resampling to a lower rate: frequencies above half the new
    rate would alias. KinemimicError if the rate is not a positive number or the clip has no pass.
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise KinemimicError(f"resample: expected a positive frame rate, found {rate:g}")
    if clip.euler is not None and clip.rotations is None and clip.orders is not None:
        recorded = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)
        clip = replace(clip, rotations=recorded)
    spans = list(pass_spans(clip.passes))
    if not spans:
        raise KinemimicError("resample: expected a pass with a person in it, found none; run `ingest` again")
    parts = [_resample_pass(clip, span, rate) for span in spans]
    even = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    angles = clip.angles and {name: even[f"angle {name}"] for name in clip.angles}
    rotations = even.get("rotations")
    positions = even["positions"]
    if clip.euler is not None and rotations is not None:
        positions = world_positions(clip.skeleton, even["translations"], rotations, clip.world_from_file)
    return replace(
        clip,
        times=even["times"],
        positions=positions,
        states=even["states"].astype(np.uint8),
        passes=even["passes"].astype(np.int32),
        euler=None,
        orders=None,
        rests=None,
        translations=even.get("translations"),
        rotations=rotations,
        angles=angles,
    )


def _resample_pass(clip: Clip, span: slice, rate: float) -> dict[str, Array]:
    times = clip.times[span]
    count = int((times[-1] - times[0] + _SLACK) * rate) + 1
    at = times[0] + np.arange(count) / rate
    frame, share = _between(at, times)
    states = clip.states[span]
    next_frame = np.where(share > 0.0, np.minimum(frame + 1, len(times) - 1), frame)
    positions = _spline(at, times, clip.positions[span])
    lower = np.minimum(states[frame], states[next_frame])
    part: dict[str, Array] = {
        "times": at,
        "positions": positions,
        "states": np.where(all_finite(positions), lower, MISSING),
        "passes": np.full(count, clip.passes[span.start]),
    }
    if clip.translations is not None:
        part["translations"] = _spline(at, times, clip.translations[span])
    if clip.rotations is not None:
        turns = clip.rotations[span]
        part["rotations"] = continuous(_slerp(turns[frame], turns[next_frame], share))
    for name, curve in (clip.angles or {}).items():
        part[f"angle {name}"] = _spline(at, times, curve[span, None, None])[:, 0, 0]
    return part


def _between(at: Array, times: Array) -> tuple[NDArray[np.intp], Array]:
    """The frame at or before each instant, and the fraction of the step to the next; 0 on a frame."""
    frame = np.clip(np.searchsorted(times, at + _SLACK, side="right") - 1, 0, len(times) - 1)
    after = np.minimum(frame + 1, len(times) - 1)
    step = np.where(after > frame, times[after] - times[frame], 1.0)
    late = at - times[frame]
    return frame, np.where(np.abs(late) <= _SLACK, 0.0, late / step)


def _spline(at: Array, times: Array, values: Array) -> Array:
    """Values (T, J, K) at instants (N,): a cubic spline through each run of frames; NaN outside them."""
    result = np.full((len(at), *values.shape[1:]), np.nan)
    there = all_finite(values)
    complete = there.all(axis=0)
    groups = [(slice(0, len(times)), complete)] if complete.any() else []
    for joint in np.flatnonzero(~complete):
        only = np.arange(there.shape[1]) == joint
        groups += [(stretch, only) for stretch in runs(there[:, joint])]
    for stretch, joints in groups:
        clock = times[stretch]
        inside = np.flatnonzero((at >= clock[0] - _SLACK) & (at <= clock[-1] + _SLACK))
        known, knots = values[stretch][:, joints], distinct_times(clock)
        if len(clock) > 1:
            curve = CubicSpline(clock[knots], known[knots])(at[inside])
        else:
            curve = known[np.zeros(len(inside), int)]
        result[np.ix_(inside, joints)] = curve
    return result


def _slerp(p: Array, q: Array, share: Array) -> Array:
    """Rotations (N, J, 4) along the shortest path from p to q, at constant speed.

    On a frame (share 0) the result is p, even if q is NaN.
    """
    turn = np.where(share[:, None, None] > 0.0, to_rotvec(multiply(conjugate(p), q)), 0.0)
    return multiply(p, from_rotvec(share[:, None, None] * turn))

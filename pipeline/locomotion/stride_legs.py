"""Which legs of the strides of one person are good enough for a loop, judged by all strides together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.locomotion.phase.frames import frames_between
from kinemimic.pipeline.locomotion.strides import Stride

# A stride for a loop: straight enough, as long as the others, with the leg in view.
MAX_USED_TURN = np.radians(60.0)
MAX_PERIOD_DEVIATION = 0.25
MIN_SEEN = 0.8  # share of a stride's frames in which a leg is seen in a possible pose
# Of the curves of knee and thigh with the medians of all good strides. Where a depth sensor guesses the far
# leg, the knee's is 0.3 to 0.7; where it sees the leg, 0.85 to 0.99.
MIN_CORRELATION = 0.80
# Of a leg with fewer good strides than these, the best ones are taken down to a lower correlation.
WANTED_STRIDES, MIN_DOUBTFUL_CORRELATION = 3, 0.60
_SAMPLES = 40  # of a stride


def judge_strides(
    strides: list[Stride], phase: Array, angles: Array, bad: Mask, *, compare: bool
) -> list[Stride]:
    """The strides of all bouts of walking of one person, with the legs that are good enough for a loop.

    phase: (T,) cycles; angles: (T, 2, A) of the left and right leg, radians; bad: (T, 2) frames in which the
    leg is missing or in an impossible pose; compare: drop legs whose angles differ from the usual curves, as
    where a depth sensor guesses the far leg.
    """
    walking = [stride for stride in strides if stride.walking]
    if not walking:
        return strides
    period = float(np.median([stride.period for stride in walking]))
    curves = _curves(strides, phase, angles)
    judged = []
    for stride in strides:
        inside = frames_between(phase, stride.start, stride.end)
        reason = _unusable(stride, period)
        used = [False, False]
        if not reason:
            used = [float(np.mean(~bad[inside, k])) >= MIN_SEEN for k in range(2)]
            reason = "" if all(used) else "a leg is missing or bent as in a tracking error"
        judged.append(replace(stride, used=(used[0], used[1]), reason=reason))
    return _drop_odd_legs(judged, curves) if compare else judged


def _unusable(stride: Stride, period: float) -> str:
    if stride.transition:
        return stride.transition
    if not stride.walking:
        return "not a stride of walking"
    if stride.turn > MAX_USED_TURN:
        return f"turns by {np.degrees(stride.turn):.0f}°"
    if abs(stride.period - period) > MAX_PERIOD_DEVIATION * period:
        return f"takes {stride.period:.2f} s, the others {period:.2f} s"
    return ""


def _curves(strides: list[Stride], phase: Array, angles: Array) -> Array:
    """Curves (K, 2, A, _SAMPLES) of each stride's legs, each from where its own foot is farthest ahead.

    NaN outside the stride.
    """
    at = np.arange(_SAMPLES) / _SAMPLES
    count = angles.shape[2]
    out = np.full((len(strides), 2, count, _SAMPLES), np.nan)
    for number, stride in enumerate(strides):
        for foot in range(2):
            # The right foot's stride is half a cycle later: the phases of its samples lie in the same frames.
            own = np.mod(at + 0.5 * foot, 1.0)
            own += np.ceil(stride.start - 1e-9 - own)
            inside = own <= stride.end + 1e-9
            # Only the frames around the stride: with all, the time would grow with the square of the strides.
            first, last = np.searchsorted(phase, (stride.start - 1.0, stride.end + 1.0))
            near = slice(max(first - 1, 0), last + 1)
            for k in range(count):
                out[number, foot, k, inside] = np.interp(own[inside], phase[near], angles[near, foot, k])
    return out


def _drop_odd_legs(strides: list[Stride], curves: Array) -> list[Stride]:
    """The strides, with every leg left out whose curves do not follow the median of all legs."""
    seen = np.array([stride.used for stride in strides])
    used = seen
    for _ in range(3):
        if not used.any():
            break
        usual = _median(curves[used])
        correlation = np.where(seen, _correlation(curves, usual), -1.0)
        best = np.sort(correlation, axis=0)[::-1][:WANTED_STRIDES][-1]
        enough = np.clip(best, MIN_DOUBTFUL_CORRELATION, MIN_CORRELATION)
        kept = correlation >= enough
        if np.array_equal(kept, used) or kept.sum() < 2:
            break
        used = kept
    return [
        replace(
            stride,
            used=(bool(used[k, 0]), bool(used[k, 1])),
            reason=stride.reason or ("" if used[k].all() else "a leg does not move as in the other strides"),
        )
        for k, stride in enumerate(strides)
    ]


def _median(curves: Array) -> Array:
    """Median (A, S) of the known samples of curves (K, A, S); NaN where none is known."""
    known = np.isfinite(curves).any(axis=0)
    out = np.full(curves.shape[1:], np.nan)
    out[known] = np.nanmedian(curves[:, known], axis=0)
    return out


def _correlation(curves: Array, usual: Array) -> Array:
    """Least Pearson correlation (K, 2) of a leg's curves (K, 2, A, S) with the usual ones (A, S).

    Over the samples at which both are known; -1 with too few.
    """
    out = np.full(curves.shape[:3], -1.0)
    for place in np.ndindex(*curves.shape[:3]):
        known = np.isfinite(curves[place]) & np.isfinite(usual[place[2]])
        if known.sum() < 0.2 * _SAMPLES:
            continue
        x, y = curves[place][known], usual[place[2]][known]
        x, y = x - x.mean(), y - y.mean()
        size = float(np.linalg.norm(x) * np.linalg.norm(y))
        out[place] = float(x @ y) / size if size > 0.0 else -1.0
    return np.asarray(out.min(axis=2))

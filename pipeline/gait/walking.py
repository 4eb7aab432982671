"""Whether somebody walks or runs in a capture, and how long a stride takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.gait.harmonic import PERIODS, Harmonic, fit_harmonic, walking_direction
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

# A stride's length wanders, so that one harmonic holds for a few strides only; enough of such windows, spread
# over the passes, tell the period of an hour's recording as well.
WINDOW = 4.0  # s
MOST_WINDOWS = 40
RATE = 40.0  # Hz is plenty for an ankle
FITS, KEPT = 0.85, 0.80  # R² of the harmonic; share of the frames that it explains
STRIDE = 0.08  # m: the harmonic's amplitude, half of the way of one ankle past the other
TRAVELS = 0.3  # m/s
# Who stays on the spot walks only if it goes on: a kick too is one wave of the ankles.
CYCLES_ON_PATH, CYCLES_ON_SPOT = 0.9, 2.0
LEAST_ON_SPOT = 0.34  # share of the windows
SHORTEST, LONGEST = 0.56, 0.98 * PERIODS[1]
# How far one ankle may be before the other in the mean, over the amplitude. Ankles pass each other, about
# evenly; where the tracker exchanges the legs at each step, one leads (by 1.5), at twice the frequency.
LEAD = 0.8
_FACING = 1.0  # s over which the hip line is averaged: its direction is noisy, and turns slowly


@dataclass(frozen=True)
class _Stretch:
    harmonic: Harmonic
    seconds: float
    speed: float  # m/s of the hips, end to end


def gait(clip: Clip, nodes: Array) -> dict[str, Any] | None:
    """Period (s), cadence (steps a minute), speed (m/s) and fit of a gait, or None if there is none.

    clip: with numbered passes; nodes: (T, 20, 3) of its frames. speed is None on a treadmill or on the spot.
    """
    windows = _windows(clip)
    found = [stretch for frames in windows if (stretch := _stretch(clip.times[frames], nodes[frames]))]
    travelling = [one for one in found if one.speed > TRAVELS]
    on_spot = [one for one in found if one.speed <= TRAVELS and _cycles(one) >= CYCLES_ON_SPOT]
    chosen = travelling if travelling else on_spot
    if not chosen or (not travelling and len(on_spot) < LEAST_ON_SPOT * len(windows)):
        return None
    period = float(np.median([one.harmonic.period for one in chosen]))
    return {
        "period_s": rounded(period, 3),
        "cadence_steps_min": rounded(120.0 / period, 1),
        "speed_m_s": rounded(np.median([one.speed for one in travelling]), 3) if travelling else None,
        "r2": rounded(np.median([one.harmonic.r2 for one in chosen]), 3),
        "windows": len(chosen),
        "windows_tried": len(windows),
    }


def _windows(clip: Clip) -> list[NDArray[np.intp]]:
    """Frames of each window of at most WINDOW seconds inside one pass, thinned to about RATE."""
    windows: list[NDArray[np.intp]] = []
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        frames = np.flatnonzero(clip.passes == number)
        times = clip.times[frames]
        # Each window begins in the middle of the one before: who walks a few strides only is in one of them.
        count = max(1, int((times[-1] - times[0]) / (WINDOW / 2.0)))
        edges = np.searchsorted(times, np.linspace(times[0], times[-1], count + 1))
        edges[-1] = len(frames)
        thin = max(1, int(1.0 / (RATE * float(np.median(np.diff(times))))))
        windows += [frames[a:b:thin] for a, b in _spans(edges.tolist())]
    if len(windows) <= MOST_WINDOWS:
        return windows
    return [windows[k] for k in np.linspace(0, len(windows) - 1, MOST_WINDOWS).astype(int)]


def _spans(edges: list[int]) -> list[tuple[int, int]]:
    """Two neighbouring intervals at a time, or the only one."""
    return list(zip(edges, edges[2:], strict=False)) or [(edges[0], edges[1])]


def _stretch(times: Array, nodes: Array) -> _Stretch | None:
    """The harmonic of the ankles in one window, if it is that of a gait."""
    hips = nodes[:, [N["hip_left"], N["hip_right"]], :2]
    apart = nodes[:, N["ankle_right"], :2] - nodes[:, N["ankle_left"], :2]
    seen = np.asarray(np.isfinite(hips).all(axis=(1, 2)) & np.isfinite(apart).all(axis=-1))
    seconds = float(times[-1] - times[0])
    if seen.sum() < 12 or seen.mean() < 0.5 or seconds < PERIODS[0]:
        return None
    heading, _ = walking_direction(nodes[seen])
    fixed = np.broadcast_to([np.cos(heading), np.sin(heading)], apart.shape)
    fits = []
    # The path in the room where there is one; in a turn, where the hip line faces; on a treadmill, or before
    # a camera that turns along and sees the hips from the side, the line on which the ankles pass each other.
    for forward in (fixed, _facing(times, hips, seen), _swing(apart[seen])):
        along = np.asarray(np.sum(np.where(seen[:, None], apart * forward, 0.0), axis=-1))
        if np.std(along[seen]) > 0.5 * STRIDE:
            one = fit_harmonic(times, along, seen.astype(np.float64))
            lead = abs(float(np.average(along, weights=one.weights))) if one.weights.any() else np.inf
            if lead < LEAD * one.amplitude:
                fits.append(one)
    if not fits:
        return None
    best = max(fits, key=lambda one: one.r2 * one.kept)
    middle = hips[seen].mean(axis=1)
    ends = max(1, len(middle) // 10)
    # From the mean place of the first tenth to that of the last: so far apart are their mean times as well.
    way, between = (
        last.mean(axis=0) - first.mean(axis=0)
        for first, last in ((of[:ends], of[-ends:]) for of in (middle, times[seen]))
    )
    stretch = _Stretch(best, seconds, float(np.linalg.norm(way) / between))
    good = best.r2 >= FITS and best.kept * len(times) >= KEPT * seen.sum() and best.amplitude >= STRIDE
    human = SHORTEST < best.period < LONGEST
    return stretch if good and human and _cycles(stretch) >= CYCLES_ON_PATH else None


def _cycles(one: _Stretch) -> float:
    return one.seconds / one.harmonic.period


def _swing(apart: Array) -> Array:
    """Unit vector (2,) along which the ankles' horizontal distance (T, 2) varies most."""
    _, axes = np.linalg.eigh(np.cov(apart.T))
    return np.asarray(axes[:, -1])


def _facing(times: Array, hips: Array, seen: NDArray[np.bool_]) -> Array:
    """Unit vectors (T, 2) square to the averaged hip line: where the pelvis faces."""
    line = np.where(seen[:, None], hips[:, 0] - hips[:, 1], 0.0)
    width = min(max(1, round(_FACING / float(np.median(np.diff(times))))), len(times))
    smooth = np.stack([np.convolve(line[:, k], np.ones(width), mode="same") for k in range(2)], axis=-1)
    forward = np.stack([smooth[:, 1], -smooth[:, 0]], axis=-1)
    size = np.linalg.norm(forward, axis=-1, keepdims=True)
    return np.asarray(forward / np.where(size > 0, size, 1.0))

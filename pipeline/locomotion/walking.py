"""Detection of walking and running: in a capture (`detect_gait`) and frame by frame (`striding_frames`).

`detect_gait` fits one harmonic to the ankles in short windows; inspection reports its period and speed.
`striding_frames` picks the frames in which the ankles pass each other fast; the quality rules use them to
determine the direction of walking.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.kinematics.body_points import between, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import runs
from kinemimic.pipeline.locomotion.harmonic import (
    PERIODS,
    Harmonic,
    end_to_end,
    fit_harmonic,
    walking_direction,
)

# Stride times vary, so one harmonic holds for a few strides only. Windows spread over the passes give the
# period of an hour's recording as well.
WINDOW = 4.0  # s
MAX_WINDOWS = 40
WINDOW_RATE = 40.0  # Hz, enough for an ankle
MIN_R2, MIN_KEPT = 0.85, 0.80  # R² of the harmonic; share of the frames that it explains
MIN_AMPLITUDE = 0.08  # m, of the harmonic: half of the distance by which one ankle passes the other
TRAVEL_SPEED = 0.3  # m/s
# Movement on the spot must repeat to count as walking: a single kick is one wave of the ankles too.
MIN_CYCLES_ON_PATH, MIN_CYCLES_ON_SPOT = 0.9, 2.0
MIN_SHARE_ON_SPOT = 0.34  # of the windows
MIN_PERIOD, MAX_PERIOD = 0.56, 0.98 * PERIODS[1]  # s
# Largest mean distance of one ankle ahead of the other, over the amplitude. Ankles pass each other about
# evenly; where the tracker exchanges the legs at each step, one leads (by 1.5), at twice the frequency.
MAX_LEAD = 0.8
FACING_SECONDS = 1.0  # over which the hip line is averaged: its direction is noisy and turns slowly

# Seconds over which velocities are taken, so that a sensor's noise does not drown them.
VELOCITY_SECONDS = 0.2
# m/s at which the ankles pass each other in walking or running.
STRIDING_SPEED = 0.8


@dataclass(frozen=True)
class _Window:
    harmonic: Harmonic
    seconds: float
    speed: float  # m/s of the hips, end to end

    @property
    def cycles(self) -> float:
        return self.seconds / self.harmonic.period


def detect_gait(clip: Clip, nodes: Array) -> dict[str, Any] | None:
    """Period (s), cadence (steps per minute), speed (m/s) and fit of a gait, or None without one.

    clip: with numbered passes; nodes: (T, 20, 3) of its frames. speed is None on a treadmill or on the spot.
    """
    windows = _windows(clip)
    found = [one for frames in windows if (one := _gait_window(clip.times[frames], nodes[frames]))]
    travelling = [one for one in found if one.speed > TRAVEL_SPEED]
    on_spot = [one for one in found if one.speed <= TRAVEL_SPEED and one.cycles >= MIN_CYCLES_ON_SPOT]
    chosen = travelling if travelling else on_spot
    if not chosen or (not travelling and len(on_spot) < MIN_SHARE_ON_SPOT * len(windows)):
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
    """Frames of each window of at most WINDOW seconds inside one pass, thinned to about WINDOW_RATE."""
    windows: list[NDArray[np.intp]] = []
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        frames = np.flatnonzero(clip.passes == number)
        times = clip.times[frames]
        # Each window begins in the middle of the one before, so that a few strides fall into one of them.
        count = max(1, int((times[-1] - times[0]) / (WINDOW / 2.0)))
        edges = np.searchsorted(times, np.linspace(times[0], times[-1], count + 1))
        edges[-1] = len(frames)
        thin = max(1, int(1.0 / (WINDOW_RATE * float(np.median(np.diff(times))))))
        windows += [frames[a:b:thin] for a, b in _overlapping(edges.tolist())]
    if len(windows) <= MAX_WINDOWS:
        return windows
    return [windows[k] for k in np.linspace(0, len(windows) - 1, MAX_WINDOWS).astype(int)]


def _overlapping(edges: list[int]) -> list[tuple[int, int]]:
    """Pairs of neighbouring intervals, or the only interval."""
    return list(zip(edges, edges[2:], strict=False)) or [(edges[0], edges[1])]


def _gait_window(times: Array, nodes: Array) -> _Window | None:
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
    # Three candidates for forward: the path in the room, if there is one; in a turn, where the hip line
    # faces; on a treadmill, or in front of a camera that turns with the subject and sees the hips from the
    # side, the line on which the ankles pass each other.
    for forward in (fixed, _facing(times, hips, seen), _swing_axis(apart[seen])):
        along = np.asarray(np.sum(np.where(seen[:, None], apart * forward, 0.0), axis=-1))
        if np.std(along[seen]) > 0.5 * MIN_AMPLITUDE:
            one = fit_harmonic(times, along, seen.astype(np.float64))
            lead = abs(float(np.average(along, weights=one.weights))) if one.weights.any() else np.inf
            if lead < MAX_LEAD * one.amplitude:
                fits.append(one)
    if not fits:
        return None
    best = max(fits, key=lambda one: one.r2 * one.kept)
    path, elapsed = end_to_end(hips[seen].mean(axis=1)), end_to_end(times[seen])
    window = _Window(best, seconds, float(np.linalg.norm(path) / elapsed))
    good = best.r2 >= MIN_R2 and best.kept * len(times) >= MIN_KEPT * seen.sum()
    human = best.amplitude >= MIN_AMPLITUDE and MIN_PERIOD < best.period < MAX_PERIOD
    return window if good and human and window.cycles >= MIN_CYCLES_ON_PATH else None


def _swing_axis(apart: Array) -> Array:
    """Unit vector (2,) along which the ankles' horizontal distance (T, 2) varies most."""
    _, axes = np.linalg.eigh(np.cov(apart.T))
    return np.asarray(axes[:, -1])


def _facing(times: Array, hips: Array, seen: Mask) -> Array:
    """Unit vectors (T, 2) perpendicular to the averaged hip line: where the pelvis faces."""
    line = np.where(seen[:, None], hips[:, 0] - hips[:, 1], 0.0)
    width = min(max(1, round(FACING_SECONDS / float(np.median(np.diff(times))))), len(times))
    smooth = np.stack([np.convolve(line[:, k], np.ones(width), mode="same") for k in range(2)], axis=-1)
    forward = _forward_of(smooth)
    size = np.linalg.norm(forward, axis=-1, keepdims=True)
    return np.asarray(forward / np.where(size > 0, size, 1.0))


def _forward_of(left: Array) -> Array:
    """Forward (T, 2) of vectors that point to the body's left (T, 2), of the same lengths."""
    return np.stack([left[:, 1], -left[:, 0]], axis=-1)


@dataclass(frozen=True)
class StridingFrames:
    """The frames in which the ankles pass each other fast.

    frames: (n,) of the clip; foot_velocity, foot_position: (n, 2) horizontal, of the lower ankle, which is
    taken for the planted foot, m/s and m; hip_velocity: (n, 2) m/s; forward: (n, 2) unit vectors, where the
    body faces if its sides are named right.
    """

    frames: NDArray[np.int64]
    foot_velocity: Array
    hip_velocity: Array
    foot_position: Array
    forward: Array

    @property
    def walking_velocity(self) -> Array:
        """(n, 2) velocity of the hips over the planted foot: the walk over the ground, or over a belt."""
        return self.hip_velocity - self.foot_velocity


def striding_frames(clip: Clip) -> StridingFrames:
    """The striding frames in all passes."""
    points = nodes_of(clip)
    hips = points[:, [N["hip_left"], N["hip_right"]]].mean(axis=1)
    ankles = points[:, [N["ankle_left"], N["ankle_right"]]]
    left = between(points, "hip_right", "hip_left") + between(points, "shoulder_right", "shoulder_left")
    parts: list[tuple[Array, ...]] = []
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        for span in runs(clip.passes == number):
            times = clip.times[span]
            if len(times) < 5:
                continue
            reach = max(1, round(0.5 * VELOCITY_SECONDS / float(np.median(np.diff(times)))))
            if len(times) <= 4 * reach:
                continue
            elapsed = (times[2 * reach :] - times[: -2 * reach])[:, None]
            middle = slice(reach, -reach)
            hip_velocity = _velocity(hips[span], reach, elapsed)
            velocities = np.stack([_velocity(ankles[span, side], reach, elapsed) for side in (0, 1)], axis=1)
            low = np.argmin(np.nan_to_num(ankles[span][middle][..., 2], nan=np.inf), axis=1)
            rows = np.arange(len(low))
            forward = _forward_of(left[span][middle])
            with np.errstate(invalid="ignore", divide="ignore"):
                forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
            passing = np.linalg.norm(velocities[:, 0] - velocities[:, 1], axis=1)
            found = (velocities[rows, low], hip_velocity, ankles[span][middle][rows, low, :2], forward)
            good = np.isfinite(np.concatenate(found, axis=1)).all(axis=1) & (passing > STRIDING_SPEED)
            frames = (span.start + reach + rows)[good]
            parts.append((frames, *(values[good] for values in found)))
    if not parts:
        empty = np.zeros((0, 2))
        return StridingFrames(np.zeros(0, dtype=np.int64), empty, empty, empty, empty)
    return StridingFrames(*(np.concatenate([part[k] for part in parts]) for k in range(5)))


def _velocity(places: Array, reach: int, elapsed: Array) -> Array:
    """Horizontal velocity (T - 2 reach, 2): the straight way over 2 reach + 1 frames, smoothed by three."""
    padded = np.concatenate([places[:1], places, places[-1:]])[:, :2]
    smooth = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return np.asarray((smooth[2 * reach :] - smooth[: -2 * reach]) / elapsed)

"""The frames in which the ankles pass each other fast: walking or running, before its axes and sides are
known.

The quality rules determine the direction of walking from them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import between, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import runs

# Seconds over which velocities are taken, so that a sensor's noise does not drown them.
VELOCITY_SECONDS = 0.2
# m/s at which the ankles pass each other in walking or running.
STRIDING_SPEED = 0.8


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


def _forward_of(left: Array) -> Array:
    """Forward (T, 2) of vectors that point to the body's left (T, 2), of the same lengths."""
    return np.stack([left[:, 1], -left[:, 0]], axis=-1)

"""Steps, as far as rules need them: which foot is planted, how fast it moves, and where the walk goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import between, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.spans import runs

# Velocities are taken over this time (seconds), so that a sensor's noise does not drown them.
SPAN = 0.2
# Feet that pass each other faster than this (m/s) belong to somebody who walks or runs.
STRIDING = 0.8


@dataclass(frozen=True)
class Steps:
    """The striding moments of a clip. frames: (n,) of the clip; planted: (n, 2) horizontal velocity of the
    lower ankle, m/s; hips: (n, 2) likewise; place: (n, 2) the ankle's; forward: (n, 2) unit, to where the
    body faces by its sides' names."""

    frames: NDArray[np.int64]
    planted: Array
    hips: Array
    place: Array
    forward: Array

    @property
    def walk(self) -> Array:
        """(n, 2) velocity of the hips over the planted foot: the walk over the ground, or over a belt."""
        return self.hips - self.planted


def steps(clip: Clip) -> Steps:
    """The striding moments in all passes."""
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
            reach = max(1, round(0.5 * SPAN / float(np.median(np.diff(times)))))
            if len(times) <= 4 * reach:
                continue
            elapsed = (times[2 * reach :] - times[: -2 * reach])[:, None]
            middle = slice(reach, -reach)
            of_hips = _velocity(hips[span], reach, elapsed)
            of_ankles = np.stack([_velocity(ankles[span, side], reach, elapsed) for side in (0, 1)], axis=1)
            low = np.argmin(np.nan_to_num(ankles[span][middle][..., 2], nan=np.inf), axis=1)
            rows = np.arange(len(low))
            across = left[span][middle][:, :2]
            forward = np.stack([across[:, 1], -across[:, 0]], axis=1)
            with np.errstate(invalid="ignore", divide="ignore"):
                forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
            parting = np.linalg.norm(of_ankles[:, 0] - of_ankles[:, 1], axis=1)
            found = (of_ankles[rows, low], of_hips, ankles[span][middle][rows, low, :2], forward)
            good = np.isfinite(np.concatenate(found, axis=1)).all(axis=1) & (parting > STRIDING)
            frames = (span.start + reach + rows)[good]
            parts.append((frames, *(values[good] for values in found)))
    if not parts:
        empty = np.zeros((0, 2))
        return Steps(np.zeros(0, dtype=np.int64), empty, empty, empty, empty)
    return Steps(*(np.concatenate([part[k] for part in parts]) for k in range(5)))


def _velocity(places: Array, reach: int, elapsed: Array) -> Array:
    """Horizontal velocity (T - 2 reach, 2): the straight way over 2 reach + 1 frames, smoothed by three."""
    padded = np.concatenate([places[:1], places, places[-1:]])[:, :2]
    smooth = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return np.asarray((smooth[2 * reach :] - smooth[: -2 * reach]) / elapsed)

"""A pinhole camera that accompanies a figure without swaying with its hips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from kinemimic.evaluate.film.figures import Humanoid
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate

Floats = NDArray[np.float32]

Part = tuple[int, int, int, int]  # left, top, right, bottom, pixels; empty if left is right

CAMERAS = ("follow", "side")
AIM = 0.86  # m: height of the picture's centre, about half of a standing figure
ROOM = 2.05, 1.50  # m around the figure that a picture shows at least: height, width
# Angle from the figure's heading to the view, the view's angle below the horizon, and the vertical angle of
# view, degrees. `side` is a long lens at a right angle to the walk, from which joint angles are judged.
VIEWS = {"follow": (58.0, 11.0, 30.0), "side": (90.0, 5.0, 18.0)}
SMOOTHING = 0.5, 1.0  # s: standard deviation of the filters of the path and of the heading


@dataclass(frozen=True)
class Camera:
    """A camera in the world. position: (3,) m; yaw, pitch: of the view, radians, pitch positive downwards;
    focal: length in pixels; size: width and height of the picture in pixels."""

    position: Array
    yaw: float
    pitch: float
    focal: float
    size: tuple[int, int]

    @property
    def axes(self) -> Array:
        """Right, down and forward in the world, the rows of (3, 3)."""
        (c, s), (cp, sp) = (np.cos(self.yaw), np.sin(self.yaw)), (np.cos(self.pitch), np.sin(self.pitch))
        return np.array([[s, -c, 0.0], [-c * sp, -s * sp, -cp], [c * cp, s * cp, -sp]])

    def to_camera(self, points: Array) -> Array:
        """Points (..., 3) of the world in the camera's axes: right, down, forward."""
        return (points - self.position) @ self.axes.T

    def project(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 3) of the world in front of the camera."""
        seen = self.to_camera(points)
        return self.focal * seen[..., :2] / seen[..., 2:] + 0.5 * np.array(self.size)

    def rays(self, part: Part, samples: int) -> Floats:
        """Unit directions (H, W, 3) in the camera's axes through the sub-pixels of a part of the picture,
        `samples` of each pixel along each axis."""
        left, top, right, bottom = part
        x, y = (
            low + (np.arange((high - low) * samples, dtype=np.float32) + 0.5) / samples - 0.5 * whole
            for low, high, whole in zip((left, top), (right, bottom), self.size, strict=True)
        )
        length = np.sqrt(x * x + y[:, None] * y[:, None] + np.float32(self.focal**2))
        rays = np.empty((len(y), len(x), 3), np.float32)
        rays[..., 0], rays[..., 1], rays[..., 2] = x / length, y[:, None] / length, self.focal / length
        return rays


def camera_path(
    kind: str, figure: Humanoid, guide: Humanoid, rate: float, size: tuple[int, int], fallen_at: int
) -> list[Camera]:
    """A camera for each frame (F): aimed at `figure`, turned with the heading of `guide` until the fall.

    kind: "follow" or "side"; rate: frames a second; size: width and height in pixels.
    """
    turn, pitch, angle = (np.radians(value) for value in VIEWS[kind])
    width, height = size
    focal = 0.5 * height / np.tan(0.5 * angle)
    distance = focal * max(ROOM[0] / height, ROOM[1] / width)
    path = _smooth(figure.positions[:, 0, :2], SMOOTHING[0] * rate)
    ahead = rotate(guide.rotations[:, 0], np.array([1.0, 0.0, 0.0]))
    heading = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    # A figure that lies on the ground is looked at from where it fell.
    heading = heading[np.minimum(np.arange(len(heading)), min(fallen_at, len(heading) - 1))]
    yaws = _smooth(heading[:, None], SMOOTHING[1] * rate)[:, 0] + turn
    cameras = []
    for place, yaw in zip(path, yaws.tolist(), strict=True):
        forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])
        position = np.array([*place, AIM]) - distance * forward
        cameras.append(Camera(position, yaw, float(pitch), float(focal), size))
    return cameras


def _smooth(values: Array, deviation: float) -> Array:
    """Values (F, K) through a Gaussian filter; their ends are extended by point reflection."""
    pad = min(round(4 * deviation), len(values) - 1)
    longer = np.pad(values, ((pad, pad), (0, 0)), mode="reflect", reflect_type="odd")
    smooth: Array = gaussian_filter1d(longer, deviation, axis=0, mode="nearest")
    return smooth[pad : pad + len(values)]

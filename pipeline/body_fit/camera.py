"""A fixed pinhole camera above a level floor, and how its image moves with what is unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array

# From the world (X away from the camera, Y left, Z up) to a level camera (x right, y down, z forward).
LEVEL: Array = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
# Unknowns of the camera, in this order.
CAMERA_UNKNOWNS: tuple[str, ...] = ("height", "pitch", "roll", "log_focal")
# Nothing is nearer to the camera, in metres: a limit for the projection of wild steps.
_NEAREST = 0.05


@dataclass(frozen=True)
class SceneCamera:
    """A camera at (0, 0, height) that looks along X.

    size: (width, height) of the image in pixels; focal: pixels; height: metres above the floor; pitch:
    radians, positive looking down; roll: radians, clockwise as seen from behind the camera. The principal
    point is the middle of the image.
    """

    size: tuple[int, int]
    focal: float
    height: float
    pitch: float = 0.0
    roll: float = 0.0

    @property
    def rotation(self) -> Array:
        """(3, 3), from the world to the camera."""
        cp, sp, cr, sr = np.cos(self.pitch), np.sin(self.pitch), np.cos(self.roll), np.sin(self.roll)
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
        turn = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(turn @ tilt @ LEVEL)

    @property
    def place(self) -> Array:
        """(3,) metres in the world."""
        return np.array([0.0, 0.0, self.height])

    def seen(self, points: Array) -> Array:
        """Points (..., 3) of the world in the camera's axes, metres."""
        return np.asarray((points - self.place) @ self.rotation.T)

    def project(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 3) of the world."""
        return self.project_seen(self.seen(points))

    def project_seen(self, seen: Array) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera's axes."""
        depth = np.maximum(seen[..., 2:], _NEAREST)
        return np.asarray(self.focal * seen[..., :2] / depth + np.array(self.size) / 2.0)

    def by_point(self, seen: Array) -> Array:
        """(..., 2, 3): pixels per metre of the world, at points (..., 3) in the camera's axes."""
        return np.asarray(self._by_seen(seen) @ self.rotation)

    def by_camera(self, seen: Array) -> Array:
        """(..., 2, 4): pixels per unit of CAMERA_UNKNOWNS, at points (..., 3) in the camera's axes."""
        by = np.zeros((*seen.shape[:-1], 3, 4))
        by[..., 0] = -self.rotation[:, 2]
        sideways = np.array([np.cos(self.roll), np.sin(self.roll), 0.0])
        by[..., 1] = np.cross(sideways, seen)
        by[..., 2] = np.cross([0.0, 0.0, 1.0], seen)
        pixels = self._by_seen(seen) @ by
        pixels[..., 3] = self.project_seen(seen) - np.array(self.size) / 2.0
        return np.asarray(pixels)

    def moved(self, step: Array) -> SceneCamera:
        """The camera after a step (4,) of CAMERA_UNKNOWNS."""
        height, pitch, roll, log_focal = (float(value) for value in step)
        return replace(
            self,
            height=self.height + height,
            pitch=self.pitch + pitch,
            roll=self.roll + roll,
            focal=self.focal * float(np.exp(log_focal)),
        )

    def _by_seen(self, seen: Array) -> Array:
        depth = np.maximum(seen[..., 2], _NEAREST)
        by = np.zeros((*seen.shape[:-1], 2, 3))
        by[..., 0, 0] = by[..., 1, 1] = self.focal / depth
        by[..., :2, 2] = -self.focal * seen[..., :2] / depth[..., None] ** 2
        return by


def focal_of(size: tuple[int, int], field_of_view: float) -> float:
    """Focal length in pixels of a field of view in radians along the longer side of an image."""
    return float(max(size) / 2.0 / np.tan(field_of_view / 2.0))

"""A pinhole camera with lens distortion: pixels to rays, to metres, and back.

Axes as in OpenCV: x to the image's right, y down, z forward; (0, 0) is the middle of the upper left pixel.
The distortion is Brown's with Conrady's tangential part and, with k4 to k6, OpenCV's rational form:
x'' = x' (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) + 2 p1 x' y' + p2 (r² + 2 x'²),
y'' = y' (likewise) + p1 (r² + 2 y'²) + 2 p2 x' y', with r² = x'² + y'².
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

# The inverse of the distortion is a fixed-point iteration; 20 steps suffice for every lens that was tried
# (Kinect v1, v2, Azure), OpenCV's own 5 leave up to 2 pixels in an Azure Kinect's corners.
_CRITERIA = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-10)
# Beyond the edge of what the lens sees the iteration ends anywhere: its result is believed if it leads back.
_CLOSE = 0.01  # pixels


@dataclass(frozen=True)
class Camera:
    """width, height, fx, fy, cx, cy: pixels; distortion: k1, k2, p1, p2, k3, k4, k5, k6, in that sequence."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0,) * 8

    def project(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera's axes.

        NaN for what is missing, behind the camera, or so far aside that the distortion's polynomial folds
        back and would put it into the image.
        """
        flat = points.reshape(-1, 3)
        pixels = np.full((len(flat), 2), np.nan)
        ahead = np.flatnonzero(flat[:, 2] > 1e-6)
        rays = flat[ahead, :2] / flat[ahead, 2:]
        found = self._distort(rays)
        true = np.linalg.norm(self.undistort(found) - rays, axis=-1) < _CLOSE / min(self.fx, self.fy)
        pixels[ahead[true]] = found[true]
        return pixels.reshape(*points.shape[:-1], 2)

    def undistort(self, pixels: Array) -> Array:
        """x / z and y / z (..., 2) of the rays that fall on pixels (..., 2); NaN where no ray does."""
        flat = pixels.reshape(-1, 2)
        rays = np.full(flat.shape, np.nan)
        there = np.flatnonzero(np.isfinite(flat).all(axis=-1))
        if len(there):
            found = cv2.undistortPoints(
                np.ascontiguousarray(flat[there, None]), self._matrix, self._coefficients, criteria=_CRITERIA
            )
            rays[there] = np.asarray(found, dtype=np.float64).reshape(-1, 2)
            off = np.linalg.norm(self._distort(rays[there]) - flat[there], axis=-1)
            rays[there[~(off < _CLOSE)]] = np.nan
        return rays.reshape(pixels.shape)

    def back_project(self, pixels: Array, depth: Array) -> Array:
        """Points (..., 3) in the camera's axes, metres, of pixels (..., 2) at depths (...,) along z."""
        rays = self.undistort(pixels)
        return np.concatenate([rays * depth[..., None], depth[..., None]], axis=-1)

    def inside(self, pixels: Array) -> NDArray[np.bool_]:
        """Whether pixels (..., 2) fall into the image; False where NaN."""
        size = np.array([self.width, self.height])
        # Pixel 0 reaches from -0.5 to 0.5.
        return np.asarray(((pixels >= -0.5) & (pixels < size - 0.5)).all(axis=-1), dtype=np.bool_)

    @property
    def _matrix(self) -> Array:
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def _coefficients(self) -> Array:
        return np.array(self.distortion, dtype=np.float64)

    def _distort(self, rays: Array) -> Array:
        """Pixels (N, 2) of rays x / z, y / z (N, 2)."""
        if not len(rays):
            return np.empty((0, 2))
        points = np.concatenate([rays, np.ones((len(rays), 1))], axis=-1)
        still = np.zeros(3)
        pixels, _ = cv2.projectPoints(points, still, still, self._matrix, self._coefficients)
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

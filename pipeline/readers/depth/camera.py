"""A pinhole camera with lens distortion: pixels to rays, to metres, and back.

Axes as in OpenCV: x to the image's right, y down, z forward; (0, 0) is the centre of the upper left pixel.
The distortion is Brown's with Conrady's tangential part and, with k4 to k6, OpenCV's rational form:
x'' = x' (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) + 2 p1 x' y' + p2 (r² + 2 x'²),
y'' = y' (same factor) + p1 (r² + 2 y'²) + 2 p2 x' y', with r² = x'² + y'².
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

# The distortion is inverted by fixed-point iteration; 20 steps suffice for every lens that was tried (Kinect
# v1, v2, Azure), OpenCV's default of 5 leaves up to 2 pixels in an Azure Kinect's corners.
_CRITERIA = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-10)
# Outside the lens's field of view the iteration does not converge: a result counts only if it maps back this
# closely.
_MAX_ERROR = 0.01  # pixels


@dataclass(frozen=True)
class Camera:
    """width, height, fx, fy, cx, cy: pixels; distortion: k1, k2, p1, p2, k3, k4, k5, k6, in that order."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0,) * 8

    def project(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera's axes.

        NaN for points that are missing, behind the camera, or so far aside that the distortion's polynomial
        folds back and would place them inside the image.
        """
        flat = points.reshape(-1, 3)
        pixels = np.full((len(flat), 2), np.nan)
        ahead = np.flatnonzero(flat[:, 2] > 1e-6)
        rays = flat[ahead, :2] / flat[ahead, 2:]
        found = self._distort(rays)
        valid = np.linalg.norm(self.undistort(found) - rays, axis=-1) < _MAX_ERROR / min(self.fx, self.fy)
        pixels[ahead[valid]] = found[valid]
        return pixels.reshape(*points.shape[:-1], 2)

    def undistort(self, pixels: Array) -> Array:
        """x / z and y / z (..., 2) of the rays through pixels (..., 2); NaN where there is no such ray."""
        flat = pixels.reshape(-1, 2)
        rays = np.full(flat.shape, np.nan)
        finite = np.flatnonzero(np.isfinite(flat).all(axis=-1))
        if len(finite):
            found = cv2.undistortPoints(
                np.ascontiguousarray(flat[finite, None]), self._matrix, self._coefficients, criteria=_CRITERIA
            )
            rays[finite] = np.asarray(found, dtype=np.float64).reshape(-1, 2)
            error = np.linalg.norm(self._distort(rays[finite]) - flat[finite], axis=-1)
            rays[finite[~(error < _MAX_ERROR)]] = np.nan
        return rays.reshape(pixels.shape)

    def back_project(self, pixels: Array, depth: Array) -> Array:
        """Points (..., 3) in the camera's axes, in metres, for pixels (..., 2) at depths (...,) along z."""
        rays = self.undistort(pixels)
        return np.concatenate([rays * depth[..., None], depth[..., None]], axis=-1)

    def inside(self, pixels: Array) -> NDArray[np.bool_]:
        """Whether pixels (..., 2) are inside the image; False for NaN."""
        size = np.array([self.width, self.height])
        # Pixel 0 spans -0.5 to 0.5.
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
        zeros = np.zeros(3)
        pixels, _ = cv2.projectPoints(points, zeros, zeros, self._matrix, self._coefficients)
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

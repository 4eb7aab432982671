"""The square of the image that the landmark network looks at."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.video.decode import Image

# Side of the square over the diameter of the body's circle, as the network was trained.
_MARGIN = 1.25


@dataclass(frozen=True)
class Region:
    """A turned square: centre (2,) and side in the image's pixels, angle in radians, clockwise."""

    centre: Array
    side: float
    angle: float

    @classmethod
    def about(cls, centre: Array, circle: Array) -> Region:
        """The square about a body: its upward axis goes from the centre of the hips to `circle` (2,)."""
        x, y = circle - centre
        angle = float(np.arctan2(x, -y))
        return cls(centre, 2.0 * _MARGIN * float(np.hypot(x, y)), angle)

    @property
    def axes(self) -> Array:
        """(2, 2): columns are the square's own axes, to the right and downwards, in the image."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s], [s, c]])

    def to_image(self, points: Array) -> Array:
        """Pixels (N, 2) of the image for points (N, 2) as shares of the square."""
        return self.centre + ((points - 0.5) * self.side) @ self.axes.T

    def crop(self, image: Image, side: int) -> Array:
        """The square as (1, side, side, 3) of red, green and blue, 0 to 255; black outside the image."""
        turn = self.axes * (self.side / side)
        # From pixels of the square to pixels of the image, whole numbers being the centres of pixels.
        shift = self.centre + turn @ np.full(2, 0.5 - side / 2.0) - 0.5
        matrix = np.column_stack([turn, shift])
        flags = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        shrunk = image
        if self.side > 2 * side:
            # Without averaging, a large person would be sampled at every second pixel.
            blur = self.side / side / 3.0
            x0, y0, x1, y1 = self._bounds(image)
            shrunk = image.copy()
            shrunk[y0:y1, x0:x1] = cv2.GaussianBlur(image[y0:y1, x0:x1], (0, 0), blur)
        return cv2.warpAffine(shrunk, matrix, (side, side), flags=flags)[None, :, :, ::-1].astype(np.float64)

    def inside(self, image: Image) -> bool:
        """Whether the square is larger than a few pixels and meets the image."""
        height, width = image.shape[:2]
        reach = self.side / 2.0
        x, y = self.centre
        return bool(
            np.isfinite([x, y, self.side]).all()
            and 8.0 < self.side < 8.0 * max(height, width)
            and -reach < x < width + reach
            and -reach < y < height + reach
        )

    def _bounds(self, image: Image) -> tuple[int, int, int, int]:
        reach = self.side * 0.75
        low = np.clip(self.centre - reach, 0, [image.shape[1] - 1, image.shape[0] - 1]).astype(int)
        high = np.clip(self.centre + reach, low + 1, [image.shape[1], image.shape[0]]).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])
